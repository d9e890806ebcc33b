"""What a terminal is shown of a robot's own words."""


def inert(text: str) -> str:
    r"""Write each character that does not print as its escape, such as `\x1b`: a terminal obeys none of them."""
    return "".join(char if char.isprintable() else repr(char)[1:-1] for char in text)
