"""The folder that a command writes its results to, and texts without this machine's folders."""

import datetime as dt
import json
import os
import re
import secrets
import shlex
import socket
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from conformance.commandline.secrecy import SECRETS

LOCK_NAME: Final = ".roaas.lock"
_ROOM: Final = bytes(1 << 18)  # a result has some hundred kilobytes; if these bytes cannot be written, it cannot either
_MOST: Final = 1000  # bytes of the lock file that are read, at most


class FolderError(Exception):
    """The error for a folder that cannot take a run's results; the message is the end of a sentence."""


@contextmanager
def hold(folder: Path) -> Iterator[None]:
    """Make a folder for results, and lock it against other runs before anything is sent.

    A run that is killed leaves its lock, which the next run takes over. On Windows there is no lock.

    Raises:
        FolderError: it cannot be made or written to, or another run uses it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _try_to_write(folder)
        descriptor = _lock(folder / LOCK_NAME)
    except OSError as error:
        raise FolderError(f"nothing can be written to this folder: {error.strerror or error}") from error
    try:
        yield
    finally:
        with suppress(OSError):
            (folder / LOCK_NAME).unlink()
        os.close(descriptor)


def own_folder(folder: Path) -> Path:
    """Make a folder inside that of the results, in place of a link that would lead elsewhere; return it.

    Raises:
        OSError: it cannot be made.
    """
    if folder.is_symlink():
        folder.unlink()
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _try_to_write(folder: Path) -> None:
    draft = folder / f".{secrets.token_hex(4)}.part"
    try:
        with draft.open("xb") as file:
            file.write(_ROOM)
    finally:
        draft.unlink(missing_ok=True)


def _lock(path: Path) -> int:
    """Return the descriptor of a locked file, which contains the owner's name.

    The lock ends with the process, however that ends.
    """
    while True:
        if path.is_symlink():
            path.unlink()
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
        if sys.platform == "win32":
            return descriptor
        import fcntl  # noqa: PLC0415 - there is none on Windows

        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            try:
                raise FolderError(f"another run uses this folder: {_owner(descriptor)}") from None
            finally:
                os.close(descriptor)
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                break
        os.close(descriptor)  # in between, the earlier run ended and removed its file
    os.ftruncate(descriptor, 0)
    owner = {"pid": os.getpid(), "host": socket.gethostname(), "since": f"{dt.datetime.now(dt.UTC):%Y-%m-%dT%H:%M:%SZ}"}
    os.write(descriptor, json.dumps(owner).encode())
    return descriptor


def _owner(descriptor: int) -> str:
    """Return whose the lock is, for a sentence."""
    try:
        owner = json.loads(os.pread(descriptor, _MOST, 0))
        return f"process {int(owner['pid'])} on {str(owner['host'])[:100]!r}, since {str(owner['since'])[:30]}"
    except (OSError, ValueError, KeyError, TypeError):
        return f"its file {LOCK_NAME} does not say which"


#: Folders of an absolute path, anywhere in a word; addresses such as http://host/path do not match.
_FOLDERS = re.compile(r"(?<![\w:/.~-])(?:file://)?~?/(?:[^\s/]+/)*")


def without_folders(word: str) -> str:
    """Return a word with paths relative to the working directory; of a file elsewhere, only the name.

    `--out=/home/me/tests/out/new` becomes `--out=out/new` in /home/me/tests, and `--out=new` in other folders.
    """
    here = re.escape(f"{Path.cwd().as_posix().rstrip('/')}/")
    return _FOLDERS.sub("", re.sub(rf"(?<![\w:/.~-])(?:file://)?{here}(?=[^\s/])", "", word))


def command_without_folders(words: Sequence[str], patterns: Sequence[str] = ()) -> str:
    """Return the command that repeats a run.

    Args:
        words: the words after `roaas`.
        patterns: options whose values are no files, but may look so: `--call /api/move`.
    """
    shown = (
        word if before in patterns or word.partition("=")[0] in patterns else without_folders(word)
        for before, word in pairwise(["roaas", *words])
    )
    return shlex.join(["roaas", *shown])


def write_atomically(path: Path, text: str) -> Path:
    """Write a file so that a reader sees either the old content or the whole new content; return its path.

    The temporary file is opened like any other, so that its mode follows the umask.

    Raises:
        OSError: the file cannot be written; the old content is kept, and no temporary file remains.
    """
    return _write(path, SECRETS.masked(text))


def write_json(path: Path, value: Any, **options: Any) -> Path:
    """Write JSON atomically; return its path. It stays JSON, whatever in it was a secret.

    Args:
        path: the path of the file.
        value: its content.
        options: options of json.dumps().

    Raises:
        OSError: as above.
    """
    return _write(path, json.dumps(SECRETS.masked_json(value), **options) + "\n")


def _write(path: Path, text: str) -> Path:
    return write_octets(path, text.encode())


def write_octets(path: Path, octets: bytes) -> Path:
    """Write octets, in which nothing is masked, atomically; return the path. A link of that name is replaced.

    Raises:
        OSError: as above.
    """
    draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with draft.open("xb") as file:
            file.write(octets)
        return draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
