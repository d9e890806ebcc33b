"""Read and verify the envelopes for a registry site: accept those that a trusted key signed, and refuse the others.

Nothing from a refused envelope is shown. The site identifies its file by digest and gives a reason in its own words.
The person who builds the site sees the details.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
from securesystemslib.signer import SSlibKey

from reports.attestation.envelope import ENVELOPE_NAME, open_envelope, read_envelope
from reports.attestation.keys import public_key
from reports.attestation.signature import unseal
from reports.attestation.statement import Run, Statement, sha256
from reports.errors import (
    EnvelopeRefusedError,
    KeyUnusableError,
    ReportError,
    ResultMissingError,
    ResultUnreadableError,
)
from reports.given_files import read_octets

_PRIVATE = b"PRIVATE KEY-----"
_MOST_KEY = 1 << 20


@dataclass(frozen=True)
class Certificate:
    """An envelope whose signature was verified by one of the registry's trusted keys.

    Attributes:
        octets: content of the envelope's file.
        statement: the signed statement.
        key: fingerprint of the signing key.
        publishable: False if the signed content has fields that this version does not know, which might be addresses.
    """

    octets: bytes
    statement: Statement
    key: str
    publishable: bool

    @property
    def run(self) -> Run:
        """Return the facts about the conformance run from the signed statement."""
        return self.statement.predicate.roaas

    @property
    def digest(self) -> str:
        """Return the SHA-256 of the envelope's file, in hexadecimal."""
        return sha256(self.octets)


@dataclass(frozen=True)
class Refused:
    """An envelope that was refused, for example because no trusted key signed it.

    Attributes:
        digest: SHA-256 of its file, in hexadecimal.
        reason: for the site; it contains nothing from the envelope.
        detail: for the person who builds the site: the file's path, and what is wrong with the file.
    """

    digest: str
    reason: str
    detail: str


def find_envelopes(places: Iterable[Path]) -> list[Path]:
    """Return the given files, and the path of every certificate.intoto.json at any depth in the given folders.

    Raises:
        ResultMissingError: a folder holds no certificate.
        ResultUnreadableError: a certificate in a folder is a link that leads out of it.
    """
    found: dict[Path, None] = {}
    for place in places:
        # A folder from others may hold a pipe, or a device that never ends.
        inside = sorted(filter(Path.is_file, place.rglob(ENVELOPE_NAME))) if place.is_dir() else [place]
        if not inside:
            raise ResultMissingError(f"{place}: it holds no {ENVELOPE_NAME}")
        if place.is_dir() and (leads := [one for one in inside if not one.resolve().is_relative_to(place.resolve())]):
            raise ResultUnreadableError(f"{leads[0]}: it is a link to a file outside {place}")
        found |= dict.fromkeys(inside)
    return list(found)


def read_keys(directory: Path) -> tuple[dict[str, SSlibKey], list[Path]]:
    """Return the public keys of a folder (*.pem) by fingerprint, and the paths of private keys, which are ignored.

    Raises:
        KeyUnusableError: the folder holds no public key, or a file is not an Ed25519 key.
    """
    keys: dict[str, SSlibKey] = {}
    private: list[Path] = []
    for path in sorted(directory.glob("*.pem")):
        try:
            if _PRIVATE in read_octets(path, _MOST_KEY):
                private.append(path)
                continue
        except ReportError as error:
            raise KeyUnusableError(error.message) from error
        key = public_key(path)
        keys[key.keyid] = key
    if not keys:
        raise KeyUnusableError(f"{directory}: it holds no public key (*.pem) of a signer whom you trust")
    return keys, private


def read_entries(paths: Iterable[Path], keys: Mapping[str, SSlibKey]) -> list[Certificate | Refused]:
    """Read envelope files and verify each by the trusted keys; identical files count once.

    Raises:
        ResultMissingError: a file does not exist.
        ResultUnreadableError: a file cannot be read.
    """
    files: dict[bytes, Path] = {}
    for path in paths:
        files.setdefault(read_envelope(path), path)
    entries = {path: entry_of(octets, keys) for octets, path in files.items()}
    return [
        replace(one, detail=f"{path}: {one.detail}") if isinstance(one, Refused) else one
        for path, one in entries.items()
    ]


def entry_of(octets: bytes, keys: Mapping[str, SSlibKey]) -> Certificate | Refused:
    """Verify the content of one envelope file by the trusted keys; return the certificate or the refusal."""
    reason = "it is not an envelope with one signature"
    try:
        opened = open_envelope(octets)
        reason = "it is signed by a key that this registry does not trust"
        if opened.keyid not in keys:
            raise EnvelopeRefusedError(f"foreign key: {opened.keyid[:64]!r}")  # noqa: TRY301 - refused as all others are
        reason = "its signature does not verify with the key that it names, or it is not a certificate of a run"
        statement = unseal(octets, keys[opened.keyid])
    except EnvelopeRefusedError as error:
        return Refused(sha256(octets), reason, str(error))
    return Certificate(octets, statement, opened.keyid, msgspec.json.encode(statement) == opened.payload)
