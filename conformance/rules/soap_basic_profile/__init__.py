"""Checks of the conformance class soap-basic-profile."""
