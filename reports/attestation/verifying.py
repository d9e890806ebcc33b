"""Verify a certificate: its signature, the recipient's policy, and the files that belong to the certificate.

`PROVED` and `NOT_PROVED` are the texts that say what a successful verification proves and what it does not.
"""

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
    """The outcome of verifying one certificate.

    Attributes:
        statement: the signed statement.
        points: the checks of the policy, followed by those of the compared files.
    """

    statement: Statement
    points: tuple[Point, ...]

    @property
    def accepted(self) -> bool:
        """Return whether the certificate passed every check."""
        return all(point.met for point in self.points)


def verify(
    octets: bytes, key: Key, policy: Policy, known: Known, *, now: dt.datetime, directory: Path | None = None
) -> Verification:
    """Verify a signed envelope by a trusted key and a policy, and optionally compare the signed files.

    Args:
        octets: the content of the envelope file.
        key: the public key that the recipient trusts.
        policy: the requirements that the certificate must meet.
        known: digests and profiles of the installed suite.
        now: the time from which the age of the run is counted.
        directory: folder with result.json and the pages to compare with the signed digests, or None.

    Raises:
        EnvelopeRefusedError: the envelope is not signed by the key, or is not a certificate.
        ResultUnreadableError: a file of the directory cannot be read.
    """
    statement = unseal(octets, key)
    files = () if directory is None else _files(statement, directory)
    return Verification(statement, (*judge(statement, policy, known, now), *files))


def _files(statement: Statement, directory: Path) -> Iterator[Point]:
    """Compare result.json and each existing page in the directory with the signed digests; yield one check per file."""
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
