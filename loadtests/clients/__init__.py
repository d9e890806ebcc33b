"""Clients that send requests: the wire client, the library clients, and the requests themselves."""
