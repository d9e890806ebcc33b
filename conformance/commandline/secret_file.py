"""Read files with secrets, and warn of those that other users of the machine can read.

A module of its own, because the suite, the load tests and the robot read such files.
"""

import os
import shlex
import stat
from functools import partial
from pathlib import Path
from typing import Final

import click

_TOLD: Final = set[str]()


def read_secret(path: str | Path) -> str:
    """Return the text of a file with a secret, without the blanks around it; see `warn_if_shared`.

    Raises:
        OSError: the file cannot be read.
        UnicodeDecodeError: it is not UTF-8.
    """
    warn_if_shared(path)
    return Path(path).read_text(encoding="utf-8").strip()


def warn_if_shared(path: str | Path, *, at_once: bool = False) -> None:
    """Write a warning to stderr if the group or others can read a file with a secret; once for each file.

    It comes at the end of a command, below its result, or ``at_once``. The file is read all the same: what mounts
    secrets into containers often makes them readable to all.
    """
    try:
        mode = Path(path).stat().st_mode
    except OSError:
        return  # who reads it tells that
    name = str(path)
    if os.name == "posix" and stat.S_ISREG(mode) and mode & (stat.S_IRGRP | stat.S_IROTH) and name not in _TOLD:
        _TOLD.add(name)
        shown = shlex.quote(name) if name.isprintable() else repr(name)
        context = None if at_once else click.get_current_context(silent=True)
        tell = partial(click.echo, f"warning: other users can read the secret in {shown}: chmod 600 {shown}", err=True)
        tell() if context is None else context.call_on_close(tell)
