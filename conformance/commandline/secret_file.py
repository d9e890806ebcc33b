"""Read secrets from files, warn of those that other users of the machine can read, and refuse secrets in URLs.

A module of its own, because the suite, the load tests and the robot read such files.
"""

import os
import re
import shlex
import stat
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any, Final

import click

_TOLD: Final = set[str]()
# A URL with a user, alone or as the value of an option. A port has no slash, but a password may.
_USERINFO: Final = re.compile(
    r"(?:-[\w-]+=)?\s*[A-Za-z][A-Za-z0-9+.-]*:[/\\]{2}(?:[^/?#\s]*|[^/?#\s:\[]*:(?!\d+(?:[/?#]|\Z))[^\s]*)@", re.ASCII
)
#: Why a URL with a user is refused; it does not repeat the URL.
IN_URL: Final = (
    "a URL has a user or a password in it, which every user of the machine can see in the list of processes, and "
    "which is not sent: leave it out, and name a file with user:password by --basic-file or --digest-file"
)


def names_user(value: Any) -> bool:
    """Return whether a text, or one in lists and tables, is a URL with a user or a password (RFC 3986 3.2.1)."""
    if isinstance(value, str):
        return _USERINFO.match(value) is not None
    if isinstance(value, dict):
        return names_user(list(value.values()))
    return isinstance(value, Iterable) and any(map(names_user, value))


def read_secret(path: str | Path) -> str:
    """Return the text of a file with a secret, without the blanks around it; see `warn_if_shared`.

    Raises:
        OSError: the file cannot be read; its text names the file.
        UnicodeDecodeError: it is not UTF-8.
    """
    warn_if_shared(path)
    try:
        return Path(path).read_text(encoding="utf-8").strip()
    except OSError as error:
        raise OSError(f"the file {str(path)!r} with a secret cannot be read: {error.strerror}") from error


def warn_if_shared(path: str | Path, *, at_once: bool = False) -> None:
    """Write a warning to stderr if the group or others can read a file with a secret; once for each file.

    It comes at the end of a command, below its result, or ``at_once``. The file is read all the same: what mounts
    secrets into containers often makes them readable to all.
    """
    try:
        mode = Path(path).stat().st_mode
    except OSError:
        return  # the code that reads the file reports that
    name = str(path)
    if os.name == "posix" and stat.S_ISREG(mode) and mode & (stat.S_IRGRP | stat.S_IROTH) and name not in _TOLD:
        _TOLD.add(name)
        shown = shlex.quote(name) if name.isprintable() else repr(name)
        context = None if at_once else click.get_current_context(silent=True)
        tell = partial(click.echo, f"warning: other users can read the secret in {shown}: chmod 600 {shown}", err=True)
        tell() if context is None else context.call_on_close(tell)
