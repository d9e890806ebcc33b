"""What both interfaces share of HTTP: requests and answers, negotiation, tokens, and the connection's own limits."""
