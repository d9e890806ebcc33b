"""Checks of the conformance class soap-subscribers."""
