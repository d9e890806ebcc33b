"""Errors of the load generator itself."""


class GeneratorError(Exception):
    """The load generator cannot work: a port is in use, or workers do not start."""
