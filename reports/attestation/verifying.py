"""Verify a certificate: its signature, the policy, and whether the files beside it are the ones that were signed."""

import datetime as dt
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from securesystemslib.signer import Key

from reports.attestation.policy import Known, Point, Policy, judge
from reports.attestation.signature import unseal
from reports.attestation.statement import PAGE_SUBJECTS, RESULT_SUBJECT, Statement, sha256
from reports.errors import ResultUnreadableError

PROVED = (
    "Proved: the holder of this key vouches that this run took place and gave this result, and nothing was changed "
    "since it was signed."
)
NOT_PROVED = (
    "Not proved: that the robot is genuine, that the named suite really ran, or that another run would give the same "
    "result. You have to know who holds the key, and decide whether to trust them."
)


@dataclass(frozen=True)
class Verification:
    """The signed statement, and the points of the policy, including the compared files."""

    statement: Statement
    points: tuple[Point, ...]

    @property
    def accepted(self) -> bool:
        """Return whether every point is met."""
        return all(point.met for point in self.points)


def verify(
    octets: bytes, key: Key, policy: Policy, known: Known, *, now: dt.datetime, directory: Path | None = None
) -> Verification:
    """Verify an envelope, and the result in a directory if one is given.

    Raises:
        EnvelopeRefusedError: it is not signed by the key, or not a certificate.
        ResultUnreadableError: the directory's result cannot be read.
    """
    statement = unseal(octets, key)
    files = () if directory is None else _files(statement, directory)
    return Verification(statement, (*judge(statement, policy, known, now), *files))


def _files(statement: Statement, directory: Path) -> Iterator[Point]:
    """Yield, for result.json and each page that exists, whether the file is the one that was signed."""
    for name in (RESULT_SUBJECT, *PAGE_SUBJECTS):
        path = directory / name
        if name in PAGE_SUBJECTS and not path.exists():
            continue
        try:
            digest = sha256(path.read_bytes())
        except OSError as error:
            raise ResultUnreadableError(f"{path}: {error.strerror or error}") from error
        same = digest == statement.digest_of(name)
        yield Point(name, same, "as it was signed" if same else "not the file that was signed")
