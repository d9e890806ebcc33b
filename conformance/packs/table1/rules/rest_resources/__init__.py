"""Checks of the conformance class rest-resources."""
