"""Signs a statement into an envelope, and verifies one: Ed25519 by securesystemslib, which signs and verifies DSSE."""

import msgspec
from securesystemslib.dsse import Envelope
from securesystemslib.exceptions import VerificationError
from securesystemslib.signer import Key, Signature, Signer

from reports.attestation.envelope import open_envelope, statement_in
from reports.attestation.statement import PAYLOAD_TYPE, Statement
from reports.errors import EnvelopeRefusedError


def seal(statement: Statement, signer: Signer) -> str:
    """Sign a statement; returns the envelope as JSON."""
    envelope = Envelope(msgspec.json.encode(statement), PAYLOAD_TYPE, {})
    envelope.sign(signer)
    return msgspec.json.format(msgspec.json.encode(envelope.to_dict()), indent=1).decode() + "\n"


def unseal(octets: bytes, key: Key) -> Statement:
    """Verify an envelope by a key that the relying party has, and read what was signed.

    Raises:
        EnvelopeRefusedError: it is not signed by that key, or is not as `seal` makes it.
    """
    opened = open_envelope(octets)
    if opened.keyid != key.keyid:
        raise EnvelopeRefusedError(f"foreign key: it is signed by {opened.keyid[:64]!r}, and your key is {key.keyid}")
    signature = Signature(opened.keyid, opened.signature.hex())
    try:
        Envelope(opened.payload, PAYLOAD_TYPE, {opened.keyid: signature}).verify([key], 1)
    except VerificationError as error:
        raise EnvelopeRefusedError("the signature is not by your key over this content") from error
    return statement_in(opened)
