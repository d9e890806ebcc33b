"""Read and check the file around a signed statement: a DSSE v1 envelope with one signature.

DSSE is Dead Simple Signing Envelope. This module checks what securesystemslib does not: the payload's type is
in-toto's,
there is exactly one signature, the base64 is canonical, and the envelope has no other members. An envelope with a key
in it, for example, is refused, because only the relying party decides which keys to trust. `signature` verifies the
signature.
"""

import base64
import binascii
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec

from reports.attestation.statement import PAYLOAD_TYPE, PREDICATE_TYPE, STATEMENT_TYPE, Statement
from reports.errors import EnvelopeRefusedError, ResultMissingError, ResultUnreadableError

ENVELOPE_NAME = "certificate.intoto.json"
_MOST_OCTETS = 4 << 20
"""A certificate has some kilobytes; a larger file is not parsed."""


class _Signature(msgspec.Struct, forbid_unknown_fields=True):
    keyid: str
    sig: str


class _Envelope(msgspec.Struct, forbid_unknown_fields=True, rename="camel"):
    payload: str
    payload_type: str
    signatures: Annotated[list[_Signature], msgspec.Meta(min_length=1, max_length=1)]


class Opened(NamedTuple):
    """An envelope whose signature is not verified.

    Attributes:
        payload: the signed content.
        keyid: the key that the signature names.
        signature: the signature itself.
    """

    payload: bytes
    keyid: str
    signature: bytes


def read_envelope(path: Path) -> bytes:
    """Return an envelope's file, cut off shortly after the largest size that is accepted.

    Raises:
        ResultMissingError: there is no such file.
        ResultUnreadableError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(_MOST_OCTETS + 1)
    except FileNotFoundError as error:
        raise ResultMissingError(f"{path}: no such file") from error
    except OSError as error:
        raise ResultUnreadableError(f"{path}: {error.strerror or error}") from error


def open_envelope(octets: bytes) -> Opened:
    """Return the parts of an envelope.

    Raises:
        EnvelopeRefusedError: it is not as `signature.seal` writes it.
    """
    if len(octets) > _MOST_OCTETS:
        raise EnvelopeRefusedError(f"not a certificate: it has more than {_MOST_OCTETS} octets")
    try:
        envelope = msgspec.json.decode(octets, type=_Envelope)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise EnvelopeRefusedError(f"not an envelope with one signature: {error}") from error
    if envelope.payload_type != PAYLOAD_TYPE:
        raise EnvelopeRefusedError(f"the payload type is {envelope.payload_type[:80]!r}, not {PAYLOAD_TYPE}")
    signature = envelope.signatures[0]
    if not signature.keyid:
        raise EnvelopeRefusedError("the signature names no key")
    return Opened(_octets(envelope.payload, "payload"), signature.keyid, _octets(signature.sig, "signature"))


def statement_in(opened: Opened) -> Statement:
    """Return the statement in an envelope, whose signature is not verified.

    Raises:
        EnvelopeRefusedError: it is not a certificate.
    """
    try:
        statement = msgspec.json.decode(opened.payload, type=Statement)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise EnvelopeRefusedError(f"the signed content is not a certificate of a run: {error}") from error
    for found, wanted in ((statement.type, STATEMENT_TYPE), (statement.predicate_type, PREDICATE_TYPE)):
        if found != wanted:
            raise EnvelopeRefusedError(f"the signed content is of type {found[:80]!r}, not {wanted}")
    return statement


def _octets(text: str, what: str) -> bytes:
    try:
        octets = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise EnvelopeRefusedError(f"the {what} is not base64: {error}") from error
    if base64.b64encode(octets).decode() != text:
        raise EnvelopeRefusedError(f"the {what} is not canonical base64")
    return octets
