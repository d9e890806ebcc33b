"""Parse the envelope file of a signed certificate: DSSE v1 (Dead Simple Signing Envelope), one signature.

This module checks what securesystemslib does not: the payload type is in-toto's, there is exactly one signature, the
base64 is canonical, and the envelope has no other members. An envelope that includes a key, for example, is refused,
because only the recipient decides whom to trust. `verifying.unseal` verifies the signature.
"""

import base64
import binascii
import json
from collections import Counter
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import msgspec

from reports.attestation.statement import PAYLOAD_TYPE, PREDICATE_TYPE, STATEMENT_TYPE, Statement
from reports.errors import EnvelopeRefusedError
from reports.given_files import read_octets

ENVELOPE_NAME = "certificate.intoto.json"
_MOST_BYTES = 4 << 20
"""A certificate has some kilobytes; a larger file is not parsed."""
_ASK = f"Ask the vendor for the file {ENVELOPE_NAME} as `roaas sign` wrote it"


class _Signature(msgspec.Struct, forbid_unknown_fields=True):
    keyid: str
    sig: str


class _Envelope(msgspec.Struct, forbid_unknown_fields=True, rename="camel"):
    payload: str
    payload_type: str
    signatures: Annotated[list[_Signature], msgspec.Meta(min_length=1, max_length=1)]


class Opened(NamedTuple):
    """The decoded parts of an envelope, before its signature is verified.

    Attributes:
        payload: the signed content, in bytes.
        keyid: the id of the signing key, as the signature names it.
        signature: the signature's bytes.
    """

    payload: bytes
    keyid: str
    signature: bytes


def read_envelope(path: Path, root: Path | None = None) -> bytes:
    """Return the bytes of an envelope file, but at most 4 MiB + 1 so that `open_envelope` can refuse a larger file.

    Args:
        path: the file.
        root: the folder that it must lie in, links followed; None means wherever it is.

    Raises:
        ResultMissingError: the file does not exist.
        ResultUnreadableError: the file cannot be read, is no regular file, or is a link out of `root`.
    """
    return read_octets(path, _MOST_BYTES + 1, root, cut=True)


def open_envelope(octets: bytes) -> Opened:
    """Parse the bytes of an envelope and return its payload, key id and signature, without verifying the signature.

    Raises:
        EnvelopeRefusedError: the envelope is larger than 4 MiB, malformed, or not as `signing.seal` writes envelopes.
    """
    if len(octets) > _MOST_BYTES:
        raise EnvelopeRefusedError(f"not a certificate: the file is larger than {_MOST_BYTES} bytes. {_ASK}")
    try:
        envelope = msgspec.json.decode(octets, type=_Envelope)
        strict_json(octets)
    except (ValueError, RecursionError) as error:
        raise EnvelopeRefusedError(f"not an envelope with one signature: {error}. {_ASK}") from error
    if envelope.payload_type != PAYLOAD_TYPE:
        raise EnvelopeRefusedError(f"the payload type is {envelope.payload_type[:80]!r}, not {PAYLOAD_TYPE}. {_ASK}")
    signature = envelope.signatures[0]
    if not signature.keyid:
        raise EnvelopeRefusedError(f"the signature names no key. {_ASK}")
    return Opened(_octets(envelope.payload, "payload"), signature.keyid, _octets(signature.sig, "signature"))


def statement_in(opened: Opened) -> Statement:
    """Parse the payload of an envelope and return the in-toto statement, without verifying the signature.

    Raises:
        EnvelopeRefusedError: the payload is not the statement of a conformance run.
    """
    try:
        statement = msgspec.json.decode(opened.payload, type=Statement)
        strict_json(opened.payload)
    except (ValueError, RecursionError) as error:
        raise EnvelopeRefusedError(f"the signed content is not a certificate of a run: {error}. {_ASK}") from error
    for found, wanted in ((statement.type, STATEMENT_TYPE), (statement.predicate_type, PREDICATE_TYPE)):
        if found != wanted:
            raise EnvelopeRefusedError(f"the signed content is of type {found[:80]!r}, not {wanted}. {_ASK}")
    return statement


def strict_json(octets: bytes) -> Any:
    """Parse JSON in which no object has a name twice: of two members, readers may take either.

    Raises:
        ValueError: it is not JSON, or a name occurs twice in one object.
        RecursionError: it is nested too deeply.
    """
    return json.loads(octets, object_pairs_hook=_object)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        twice = next(name for name, count in Counter(name for name, _ in pairs).items() if count > 1)
        raise ValueError(f"the name {twice[:80]!r} occurs twice in one object")
    return found


def _octets(text: str, what: str) -> bytes:
    try:
        octets = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise EnvelopeRefusedError(f"the {what} is not base64: {error}. {_ASK}") from error
    if base64.b64encode(octets).decode() != text:
        raise EnvelopeRefusedError(f"the {what} is not canonical base64. {_ASK}")
    return octets
