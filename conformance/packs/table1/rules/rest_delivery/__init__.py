"""Checks of the conformance class rest-delivery."""
