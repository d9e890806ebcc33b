"""TLS of the client: the authorities that it trusts, and the certificate that proves who it is."""

import ssl
from pathlib import Path
from typing import NamedTuple

from conformance.commandline.device_options import advice
from conformance.commandline.secrecy import SECRETS
from conformance.commandline.secret_file import read_secret


class CertificateError(ValueError):
    """Raised for a client certificate or a key that cannot be used; the message shows no secret."""


class ClientCertificate(NamedTuple):
    """The files of a client certificate (PEM).

    Attributes:
        file: the certificate, and its key if ``key_file`` is None.
        key_file: the key, or None.
        passphrase_file: the passphrase of an encrypted key, or None.
    """

    file: str
    key_file: str | None = None
    passphrase_file: str | None = None

    def load_into(self, context: ssl.SSLContext) -> None:
        """Give a context the certificate with its key. Nobody is asked for a passphrase.

        Raises:
            CertificateError: a file cannot be read or holds neither, or the passphrase is missing or wrong.
        """
        key, is_encrypted = self.key_file or self.file, False
        try:
            passphrase = read_secret(self.passphrase_file) if self.passphrase_file else ""
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "it is not UTF-8"
            raise CertificateError(f"passphrase file {self.passphrase_file!r}: {reason}") from None

        SECRETS.keep(passphrase, "$ROAAS_KEY_PASSPHRASE")

        def given() -> str:
            nonlocal is_encrypted
            is_encrypted = True
            return passphrase

        try:
            context.load_cert_chain(self.file, self.key_file, given)
        except (OSError, ValueError) as error:
            if is_encrypted and not self.passphrase_file:
                how = advice(": name the file with its passphrase by --client-key-passphrase-file")
                raise CertificateError(f"the client key in {key} is encrypted{how}") from None
            if is_encrypted:
                raise CertificateError(
                    f"the passphrase in {self.passphrase_file} does not decrypt the client key in {key}"
                ) from None
            missing = next((name for name in (self.file, key) if not Path(name).is_file()), "")
            reason = f"{missing} cannot be read" if missing else getattr(error, "reason", None) or str(error)
            raise CertificateError(f"client certificate {self.file}, key {key}: {reason}") from None


def explained(text: str) -> str:
    """Return the text of an error of TLS, with what the user can do about it where that is known."""
    if any(said in text for said in ("WRONG_VERSION_NUMBER", "RECORD_LAYER_FAILURE", "PACKET_LENGTH_TOO_LONG")):
        return "this port does not speak TLS; is the address http://?"
    if "self-signed certificate" in text or "unable to get local issuer" in text:
        kind = "self-signed" if "self-signed certificate (" in text else "signed by an authority that nobody here knows"
        return f"its certificate is {kind}{advice(': name it, or its authority, by --ca-file')}"
    return text


def tls_context(ca_file: Path | None, certificate: ClientCertificate | None = None) -> ssl.SSLContext:
    """Return a TLS context that trusts the authorities in ``ca_file``, or the system's if it is None.

    Args:
        ca_file: the authorities (PEM).
        certificate: the client's, or None.

    Raises:
        OSError: ``ca_file`` cannot be read, or (ssl.SSLError) holds no certificate.
        CertificateError: the client's certificate cannot be used.
    """
    context = ssl.create_default_context(cafile=str(ca_file) if ca_file else None)
    context.set_alpn_protocols(["http/1.1"])
    if certificate is not None:
        certificate.load_into(context)
    return context
