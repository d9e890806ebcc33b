"""What keeps the load generator itself from working."""


class GeneratorError(Exception):
    """The load generator cannot work: a port is in use, or workers do not start."""
