"""Checks of the conformance class http that know the paper's robot."""
