"""Checks of the conformance class http."""
