"""Those that send requests: the wire client, the library clients, and what they send."""
