"""The envelope around a signed statement, as a file: DSSE v1 (Dead Simple Signing Envelope) with one signature.

What securesystemslib leaves open is checked here: that the payload's type is in-toto's, that there is one signature,
that the base64 is the one way to write the octets, and that there is nothing else in the envelope, such as a key: whom
to trust is for the relying party to say, never for the file. Nothing here verifies; see `signature`.
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
"""A certificate has some kilobytes; what is larger is none, and is not parsed."""


class _Signature(msgspec.Struct, forbid_unknown_fields=True):
    keyid: str
    sig: str


class _Envelope(msgspec.Struct, forbid_unknown_fields=True, rename="camel"):
    payload: str
    payload_type: str
    signatures: Annotated[list[_Signature], msgspec.Meta(min_length=1, max_length=1)]


class Opened(NamedTuple):
    """An envelope, of which nothing is verified.

    Attributes:
        payload: what the signature is over, with its type.
        keyid: the key that the signature names.
        signature: the signature.
    """

    payload: bytes
    keyid: str
    signature: bytes


def read_envelope(path: Path) -> bytes:
    """Read an envelope's file, of one that is too large no more than shows it.

    Raises:
        ResultMissingError: there is none.
        ResultUnreadableError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(_MOST_OCTETS + 1)
    except FileNotFoundError as error:
        raise ResultMissingError(f"{path}: there is no such file") from error
    except OSError as error:
        raise ResultUnreadableError(f"{path}: {error.strerror or error}") from error


def open_envelope(octets: bytes) -> Opened:
    """Take an envelope apart.

    Raises:
        EnvelopeRefusedError: it is not as `signature.seal` makes it.
    """
    if len(octets) > _MOST_OCTETS:
        raise EnvelopeRefusedError(f"it is no certificate: it has more than {_MOST_OCTETS} octets")
    try:
        envelope = msgspec.json.decode(octets, type=_Envelope)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise EnvelopeRefusedError(f"it is no envelope with one signature: {error}") from error
    if envelope.payload_type != PAYLOAD_TYPE:
        raise EnvelopeRefusedError(f"its payload type is {envelope.payload_type[:80]!r}, and not {PAYLOAD_TYPE}")
    signature = envelope.signatures[0]
    if not signature.keyid:
        raise EnvelopeRefusedError("its signature names no key")
    return Opened(_octets(envelope.payload, "payload"), signature.keyid, _octets(signature.sig, "signature"))


def statement_in(opened: Opened) -> Statement:
    """What an envelope says, whoever signed it.

    Raises:
        EnvelopeRefusedError: it is no certificate.
    """
    try:
        statement = msgspec.json.decode(opened.payload, type=Statement)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise EnvelopeRefusedError(f"what was signed is no certificate of a run: {error}") from error
    for found, wanted in ((statement.type, STATEMENT_TYPE), (statement.predicate_type, PREDICATE_TYPE)):
        if found != wanted:
            raise EnvelopeRefusedError(f"what was signed is {found[:80]!r}, and not {wanted}")
    return statement


def _octets(text: str, what: str) -> bytes:
    try:
        octets = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise EnvelopeRefusedError(f"its {what} is no base64: {error}") from error
    if base64.b64encode(octets).decode() != text:
        raise EnvelopeRefusedError(f"its {what} is base64 as no encoder writes it")
    return octets
