"""Mutants: messages on the wire, and one change between a client and a good device."""
