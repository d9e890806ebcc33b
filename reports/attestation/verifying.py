"""Verify a certificate: its signature, the recipient's policy, and the files that belong to the certificate.

`PROVED` and `NOT_PROVED` are the texts that say what a successful verification proves and what it does not.
"""

import datetime as dt
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from securesystemslib.dsse import Envelope
from securesystemslib.exceptions import VerificationError
from securesystemslib.signer import Key, Signature

from reports.attestation.envelope import open_envelope, statement_in, strict_json
from reports.attestation.files import compare, remarks_on
from reports.attestation.judging import Point, judge
from reports.attestation.policy import Known, Policy
from reports.attestation.statement import PAYLOAD_TYPE, RESULT_SUBJECT, Statement, run_of
from reports.errors import EnvelopeRefusedError, ResultMissingError
from reports.given_files import read_octets

PROVED = (
    "Proved: the holder of this key vouches that this run took place and gave the result with the digest above, and "
    "the envelope was not changed since. A file that is REFUSED above is not the one that was signed."
)
NOT_PROVED = (
    "Not proved: that the robot is genuine, that the named suite really ran, or that another run would give the same "
    "result. You have to know who holds the key, and decide whether to trust them."
)
DESCRIBED = (
    "This device was judged by its own description: give the folder of the description too, as in "
    "--contract description (docs/certificates.md#a-device-that-was-judged-by-its-own-description)."
)


@dataclass(frozen=True)
class Verification:
    """The outcome of verifying one certificate.

    Attributes:
        statement: the signed statement.
        points: the checks of the policy, followed by those of the compared files.
        remarks: sentences on files that were not compared.
    """

    statement: Statement
    points: tuple[Point, ...]
    remarks: tuple[str, ...] = ()

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
        directory: folder with result.json and the files beside it to compare with the signed digests, or None.

    Raises:
        EnvelopeRefusedError: the envelope is not signed by the key, or is not a certificate.
        ResultMissingError: the directory has no result.json.
        ResultUnreadableError: a file of the directory cannot be read.
    """
    statement = unseal(octets, key)
    points = judge(statement, policy, known, now)
    if directory is None:
        return Verification(statement, tuple(points))
    result = _result_in(directory)
    name = _statement_name(result)
    points += (_file(*one) for one in compare(statement, directory, name))
    points.append(_agreement(statement, result))
    return Verification(statement, tuple(points), tuple(remarks_on(statement, directory, name)))


def _result_in(directory: Path) -> Any:
    """Return the content of result.json as it was parsed, without validation; None if it is not JSON."""
    path = directory / RESULT_SUBJECT
    try:
        return strict_json(read_octets(path, root=directory))
    except ResultMissingError as error:
        raise ResultMissingError(f"{path}: no such file. Name the folder that the vendor sent") from error
    except (ValueError, RecursionError):
        return None


def _statement_name(result: Any) -> str | None:
    """Return the file name of the vendor's statement, by result.json."""
    try:
        return Path(result["places"]["statement"]["file"]).name or None
    except (KeyError, TypeError):
        return None


def _file(name: str, problem: str) -> Point:
    return Point(
        name, not problem, problem or "as it was signed", "the file that was signed",
        "ask the vendor for the file of this run; if the vendor changed it, for another run",
    )  # fmt: skip


def _agreement(statement: Statement, result: Any) -> Point:
    """Return the check that the envelope says what result.json says, as far as both know the facts."""
    signed = msgspec.to_builtins(statement.predicate.roaas)
    try:
        read = msgspec.to_builtins(run_of(result))
        other = sorted(key for key in signed if signed[key] != read.get(key))
    except (KeyError, TypeError, AttributeError, IndexError, msgspec.ValidationError):
        other = ["all"]
    text = f"the certificate says otherwise than result.json: {', '.join(other)}" if other else "the same facts in both"
    return Point("agreement", not other, text, "a certificate that says what result.json says", "do not rely on it")


def unseal(octets: bytes, key: Key) -> Statement:
    """Verify an envelope's signature by a trusted public key, and return the signed statement.

    Raises:
        EnvelopeRefusedError: the envelope is not signed by that key, or is not as `signing.seal` writes envelopes.
    """
    opened = open_envelope(octets)
    if opened.keyid != key.keyid:
        raise EnvelopeRefusedError(
            f"foreign key: it is signed by {opened.keyid[:64]!r}, but your key is {key.keyid}. "
            "If the vendor has a new key, compare its fingerprint over a second channel, and use that key"
        )
    signature = Signature(opened.keyid, opened.signature.hex())
    try:
        Envelope(opened.payload, PAYLOAD_TYPE, {opened.keyid: signature}).verify([key], 1)
    except VerificationError as error:
        raise EnvelopeRefusedError(
            "the signature was not made by your key over this content: somebody changed it, or signed it "
            "with another key. Do not rely on it; ask the vendor for the file as `roaas sign` wrote it"
        ) from error
    return statement_in(opened)
