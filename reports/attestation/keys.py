"""Make, read and identify Ed25519 keys in PEM files, which `openssl pkey` reads as well.

A key is identified by its fingerprint: SHA-256 of the public key as DER (SubjectPublicKeyInfo, RFC 8410), as
`openssl pkey -pubin -in public-key.pem -outform DER | sha256sum` prints it.
"""

import hashlib
import os
import stat
import sys
from contextlib import suppress
from pathlib import Path

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    PublicFormat,
    load_pem_private_key,
    load_pem_public_key,
)
from securesystemslib.signer import CryptoSigner, SSlibKey

from reports.errors import KeyUnusableError, ReportError
from reports.given_files import read_octets
from reports.pages.untrusted import on_a_line

_MOST_BYTES = 1 << 20
PRIVATE_NAME = "signing-key.pem"
PUBLIC_NAME = "public-key.pem"
_FITS_MANY = b"\1" + bytes(63)
"""A signature with the neutral point and zero. For a key of order 8, it fits one content in eight."""
_TRIES = 128


def generate(directory: Path) -> str:
    """Make an Ed25519 key pair, write signing-key.pem (mode 0600) and public-key.pem, and return the fingerprint.

    Raises:
        KeyUnusableError: one of the files exists already, or the folder cannot be written to.
    """
    signer = CryptoSigner.generate_ed25519()
    public = load_pem_private_key(signer.private_bytes, None).public_key()
    assert isinstance(public, Ed25519PublicKey)  # noqa: S101 - for the type checker: it was made so
    pem = public.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        for name, octets, mode in ((PRIVATE_NAME, signer.private_bytes, 0o600), (PUBLIC_NAME, pem, 0o644)):
            # The mode is set at creation, and an existing key is never overwritten.
            with os.fdopen(os.open(directory / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
                file.write(octets)
    except OSError as error:
        raise KeyUnusableError(
            f"{error.filename or directory}: cannot be written: {error.strerror or error}"
        ) from error
    return fingerprint(public)


def signer_of(path: Path) -> CryptoSigner:
    """Read an Ed25519 private key from a PEM file and return a signer that signs with this key.

    Raises:
        KeyUnusableError: the file cannot be read, has a passphrase, or does not hold an Ed25519 private key.
    """
    _warn_if_shared(path)
    try:
        key = load_pem_private_key(_octets(path), None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise KeyUnusableError(
            f"{path}: not a private key in PEM without a passphrase; `roaas keygen` makes one"
        ) from error
    if not isinstance(key, Ed25519PrivateKey):
        raise KeyUnusableError(f"{path}: not an Ed25519 key; `roaas keygen` makes one")
    return CryptoSigner(key, _with_key_id(key.public_key()))


def public_key(path: Path) -> SSlibKey:
    """Read an Ed25519 public key from a PEM file and return the key, with its fingerprint as key id.

    Raises:
        KeyUnusableError: the file cannot be read, or does not hold an Ed25519 public key.
    """
    octets = _octets(path)
    try:
        key = load_pem_public_key(octets)
    except (ValueError, UnsupportedAlgorithm) as error:
        raise KeyUnusableError(f"{path}: not a public key in PEM; `roaas keygen` writes one, {PUBLIC_NAME}") from error
    if not isinstance(key, Ed25519PublicKey):
        raise KeyUnusableError(f"{path}: not an Ed25519 key; ask the signer for the key that `roaas keygen` wrote")
    if octets.count(b"-----BEGIN") != 1:
        raise KeyUnusableError(f"{path}: more than one key; give a file with the one key that you trust")
    if _is_weak(key):
        raise KeyUnusableError(f"{path}: a weak key, for which anybody can sign; do not trust it")
    return _with_key_id(key)


def _is_weak(key: Ed25519PublicKey) -> bool:
    """Return whether a public key is a point of small order: one signature then fits many contents."""
    for number in range(_TRIES):
        try:
            key.verify(_FITS_MANY, b"%d" % number)
        except InvalidSignature:
            continue
        return True
    return False


def fingerprint(key: Ed25519PublicKey) -> str:
    """Return the key's fingerprint: the SHA-256 of its DER form, in hexadecimal."""
    return hashlib.sha256(key.public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo)).hexdigest()


def _with_key_id(key: Ed25519PublicKey) -> SSlibKey:
    return SSlibKey.from_crypto(key, keyid=fingerprint(key))


def _octets(path: Path) -> bytes:
    try:
        return read_octets(path, _MOST_BYTES)
    except ReportError as error:
        raise KeyUnusableError(error.message) from error


def _warn_if_shared(path: Path) -> None:
    """Write a warning to stderr if the group or others can read a private key."""
    with suppress(OSError):  # the code that reads the key reports that
        mode = path.stat().st_mode
        if os.name == "posix" and stat.S_ISREG(mode) and mode & (stat.S_IRGRP | stat.S_IROTH):
            shown = on_a_line(str(path), 1000)
            sys.stderr.write(f"warning: other users can read the private key in {shown}: chmod 600 {shown}\n")
