"""Checks of the conformance class xml-security."""
