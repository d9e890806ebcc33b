"""Read and verify the envelopes for a registry site: accept those that a trusted key signed, and refuse the others.

Nothing from a refused envelope is shown. The site identifies its file by digest and gives a reason in its own words.
The person who builds the site sees the details.
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
from securesystemslib.signer import SSlibKey

from reports.attestation.envelope import ENVELOPE_NAME, open_envelope, read_envelope
from reports.attestation.keys import public_key
from reports.attestation.statement import Run, Statement, sha256
from reports.attestation.verifying import unseal
from reports.errors import EnvelopeRefusedError, KeyUnusableError, ReportError, ResultMissingError
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
        digest: SHA-256 of its file, in hexadecimal; empty if the file cannot be read.
        reason: for the site; it contains nothing from the envelope.
        detail: for the person who builds the site: the file's path, and what is wrong with the file.
    """

    digest: str
    reason: str
    detail: str


def read_keys(directory: Path) -> tuple[dict[str, SSlibKey], list[str]]:
    """Return the public keys of a folder (*.pem) by fingerprint, and a sentence on each file that cannot be used.

    Raises:
        KeyUnusableError: the folder holds no public key.
    """
    keys: dict[str, SSlibKey] = {}
    unusable: list[str] = []
    for path in sorted(directory.glob("*.pem")):
        try:
            if _PRIVATE in read_octets(path, _MOST_KEY):
                unusable.append(f"{path} is a private key. It was not used; keep it somewhere else.")
                continue
            key = public_key(path)
        except ReportError as error:
            unusable.append(f"{error.message}. It was not used, so nothing that it signed is accepted.")
            continue
        keys[key.keyid] = key
    if not keys:
        said = f"{directory}: it holds no public key (*.pem) of a signer whom you trust"
        raise KeyUnusableError("; ".join([said, *unusable]))
    return keys, unusable


def read_entries(places: Iterable[Path], keys: Mapping[str, SSlibKey]) -> list[Certificate | Refused]:
    """Read the envelopes of files and folders and verify each by the trusted keys; identical files count once.

    What others put there stops nothing: a file that cannot be read is refused as one that does not verify.

    Raises:
        ResultMissingError: a file or folder does not exist, or there is no certificate at all.
    """
    paths: dict[Path, Path | None] = {}
    found: list[Certificate | Refused] = []
    for place in places:
        if not os.path.lexists(place):
            raise ResultMissingError(f"{place}: no such file")
        root = place if place.is_dir() else None
        inside = [place] if root is None else sorted(_named_like_envelopes(root))
        paths |= dict.fromkeys(inside, root)
        if not inside:
            found.append(Refused("", "the folder has no certificate", f"{place}: it holds no {ENVELOPE_NAME}"))
    if not paths:
        raise ResultMissingError("; ".join(refusal.detail for refusal in found if isinstance(refusal, Refused)))
    files: dict[bytes, Path] = {}
    for path, root in paths.items():
        try:
            files.setdefault(read_envelope(path, root), path)
        except ReportError as error:
            found.append(Refused("", "the file cannot be read", error.message))
    for octets, path in files.items():
        entry = entry_of(octets, keys)
        found.append(replace(entry, detail=f"{path}: {entry.detail}") if isinstance(entry, Refused) else entry)
    return found


def _named_like_envelopes(root: Path) -> Iterator[Path]:
    """Yield each path in a folder that has a certificate's name; also dangling links, which `rglob` leaves out."""
    for folder, folders, files in os.walk(root):
        if ENVELOPE_NAME in (*folders, *files):
            yield Path(folder) / ENVELOPE_NAME


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
