"""Safe terminal output of text from a robot or a result."""

import re
import shutil
import sys
import textwrap

_NARROWEST, _WIDEST = 60, 200
# What CI systems run as commands when a job prints it: GitHub's at the beginning of a line, and Azure's, TeamCity's and
# GitHub's older ones anywhere.
_COMMAND = re.compile(r"^(?=\s*::)|(?<=#)#(?=\w*\[)")


def inert(text: str) -> str:
    r"""Return a text on one line that controls neither a terminal nor a CI job.

    Unprintable characters are escaped (`\x1b`). A text that a CI system would run as a command, such as
    `::error::` or `##[group]`, gets a backslash before it.
    """
    line = text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return _COMMAND.sub(lambda found: f"\\{found[0]}", line)


def columns() -> int | None:
    """Return how wide text is, 60 to 200 columns; None if stdout is no terminal, so that lines stay whole."""
    if not sys.stdout.isatty():
        return None
    return min(max(shutil.get_terminal_size().columns, _NARROWEST), _WIDEST)


def wrapped(text: str, indent: str = "") -> str:
    """Return a text whose lines are as wide as the terminal.

    Args:
        text: one line of words; what is to be copied as it is must not be given.
        indent: what each line begins with.
    """
    width = columns()
    if width is None:
        return f"{indent}{text}"
    lines = textwrap.wrap(text, width - len(indent), break_long_words=False, break_on_hyphens=False)
    return "\n".join(f"{indent}{line}" for line in lines)
