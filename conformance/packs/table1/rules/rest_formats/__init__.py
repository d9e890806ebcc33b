"""Checks of the conformance class rest-formats that know the paper's robot."""
