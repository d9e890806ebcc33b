"""Safe terminal output of text from a robot or a result."""

import re

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
