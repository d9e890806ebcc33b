"""What sends requests: the wire client, the library clients, and the requests themselves."""
