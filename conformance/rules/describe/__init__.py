"""Checks of the conformance class describe."""
