"""What keeps the load generator itself from working."""


class GeneratorError(Exception):
    """The load generator cannot work: a port in use, workers that do not come up."""
