"""The command selftest."""
