"""Checks of the conformance class safety."""
