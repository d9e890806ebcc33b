"""Which device a command names: its description, its statement, its contract, and how to connect to it."""
