"""Checks of the conformance class equivalence."""
