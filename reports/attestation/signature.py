"""Sign a statement into an envelope, and verify an envelope: Ed25519 and DSSE by securesystemslib."""

import msgspec
from securesystemslib.dsse import Envelope
from securesystemslib.exceptions import VerificationError
from securesystemslib.signer import Key, Signature, Signer

from reports.attestation.envelope import open_envelope, statement_in
from reports.attestation.statement import PAYLOAD_TYPE, Statement
from reports.errors import EnvelopeRefusedError


def seal(statement: Statement, signer: Signer) -> str:
    """Sign a statement and return the signed DSSE envelope as indented JSON text."""
    envelope = Envelope(msgspec.json.encode(statement), PAYLOAD_TYPE, {})
    envelope.sign(signer)
    return msgspec.json.format(msgspec.json.encode(envelope.to_dict()), indent=1).decode() + "\n"


def unseal(octets: bytes, key: Key) -> Statement:
    """Verify an envelope's signature by a trusted public key, and return the signed statement.

    Raises:
        EnvelopeRefusedError: the envelope is not signed by that key, or is not as `seal` writes envelopes.
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
