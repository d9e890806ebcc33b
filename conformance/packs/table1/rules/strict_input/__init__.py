"""Checks of the conformance class strict-input that know the paper's robot."""
