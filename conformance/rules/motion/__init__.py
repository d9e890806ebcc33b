"""Checks of the conformance class motion."""
