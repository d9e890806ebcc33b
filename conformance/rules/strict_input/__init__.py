"""Checks of the conformance class strict-input."""
