"""The files of a result's folder: which are signed, and whether those that somebody was sent are the signed ones."""

import hashlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from reports.attestation.envelope import ENVELOPE_NAME
from reports.attestation.outcomes import first_names
from reports.attestation.statement import CONTRACT_SUBJECT, STATEMENT_SUBJECT, Statement
from reports.errors import ResultUnreadableError, ResultUnsignableError

RECORDED = ("traces.json.gz", "history.jsonl.gz")
"""Files that a run records beside its result, each of which may be missing."""
DESCRIPTION = "description"
"""Folder of a result with the description that a device was judged by."""
_MOST_FILES = 2000
_MOST_BYTES = 1 << 30
# Subjects that name no file of the folder.
_NO_FILES = (STATEMENT_SUBJECT, CONTRACT_SUBJECT)


class Compared(NamedTuple):
    """The comparison of a file with its signed digest.

    Attributes:
        name: path of the file in the folder.
        problem: how the file differs from what was signed; empty if it does not.
    """

    name: str
    problem: str


def digests_in(directory: Path, *, described: bool) -> dict[str, str]:
    """Return the SHA-256 of each file that a run leaves beside result.json and the pages, by its path in the folder.

    Args:
        directory: the folder.
        described: whether the device was judged by its own description, so that the folder's description is the run's.

    Raises:
        ResultUnsignableError: one of them is a link or no regular file, which cannot be signed.
        ResultUnreadableError: a file cannot be read.
    """
    names = [name for name in RECORDED if os.path.lexists(directory / name)]
    names += (f"{DESCRIPTION}/{name}" for name in _names_in(directory / DESCRIPTION) if described)
    found = {}
    for name in names:
        found[name] = _digest(directory / name)
        if not found[name]:
            raise ResultUnsignableError(
                f"{directory / name}: not a regular file; replace it by the file, and sign again"
            )
    return found


def compare(statement: Statement, directory: Path, statement_name: str | None) -> Iterator[Compared]:
    """Compare the signed files that are in a folder with their digests, and yield one comparison for each.

    Args:
        statement: the signed statement.
        directory: the folder.
        statement_name: file name of the vendor's statement, by result.json; None if it names none.

    Raises:
        ResultUnreadableError: a file cannot be read.
    """
    there = frozenset(_names_in(directory))
    for name, signed in _places(statement, statement_name).items():
        if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
            yield Compared(name[:80], "a signed name that leads out of the folder; do not rely on this certificate")
        elif name in there:
            found = _digest(directory / name)
            problem = "not the file that was signed" if found else "not a regular file"
            yield Compared(name, "" if found and found == signed else problem)
    for name in sorted(there - _places(statement, statement_name).keys()):
        if statement.predicate.roaas.described and name.startswith(f"{DESCRIPTION}/"):
            yield Compared(name, "added after the signature: no run judged the device by it")


def remarks_on(statement: Statement, directory: Path, statement_name: str | None) -> Iterator[str]:
    """Yield sentences on the files that are signed and not in a folder, and on those that are there and not signed."""
    there = frozenset(_names_in(directory))
    files = [subject.name for subject in statement.subject if not subject.name.startswith(_NO_FILES)]
    if missing := [name for name in files if name not in there]:
        yield f"Signed, but not in {directory}: {first_names(missing)}. They were not compared."
    added = sorted(there - _places(statement, statement_name).keys() - {ENVELOPE_NAME})
    if added:
        yield f"In {directory}, but not signed: {first_names(added)}. Nothing is proved about them."


def _places(statement: Statement, statement_name: str | None) -> dict[str, str]:
    """Return the signed digest of each file by its path in a result's folder."""
    found: dict[str, str] = {}
    for subject in statement.subject:
        if subject.name.startswith(CONTRACT_SUBJECT):
            found.setdefault(f"{DESCRIPTION}/{subject.name.removeprefix(CONTRACT_SUBJECT)}", subject.sha256)
        elif subject.name != STATEMENT_SUBJECT:
            found[subject.name] = subject.sha256
        elif statement_name:
            found.setdefault(statement_name, subject.sha256)
    return found


def _names_in(directory: Path) -> list[str]:
    """Return the paths of all that is in a folder and no folder, relative to it; links to folders are not followed.

    Raises:
        ResultUnreadableError: the folder holds more than 2,000 files.
    """
    found: list[str] = []
    for folder, folders, files in os.walk(directory):
        links = [name for name in folders if (Path(folder) / name).is_symlink()]
        found += ((Path(folder) / name).relative_to(directory).as_posix() for name in (*files, *links))
        if len(found) > _MOST_FILES:
            raise ResultUnreadableError(f"{directory}: more than {_MOST_FILES} files; give the folder of one result")
    return sorted(found)


def _digest(path: Path) -> str:
    """Return the SHA-256 of a regular file of at most 1 GiB in hexadecimal; empty for anything else.

    Raises:
        ResultUnreadableError: the file cannot be read.
    """
    try:
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > _MOST_BYTES:
            return ""
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ResultUnreadableError(f"{path}: {error.strerror or error}") from error
