"""Safe terminal output of text from a robot."""


def inert(text: str) -> str:
    r"""Return a text with unprintable characters escaped (`\x1b`), so that it cannot control the terminal."""
    return "".join(char if char.isprintable() else repr(char)[1:-1] for char in text)
