"""What both interfaces share of HTTP: requests and answers, bearer tokens, and the connection's own limits."""
