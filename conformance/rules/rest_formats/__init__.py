"""Checks of the conformance class rest-formats."""
