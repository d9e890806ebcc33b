"""Checks of the conformance class soap-delivery."""
