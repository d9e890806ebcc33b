"""Format the fingerprints by which a printed certificate is checked, as text and QR code (ISO/IEC 18004)."""

from dataclasses import dataclass

import segno
from markupsafe import Markup


@dataclass(frozen=True, slots=True)
class Seal:
    """The fingerprints that a certificate page shows.

    Attributes:
        result: SHA-256 of result.json, in hexadecimal.
        key: fingerprint of the signing key, or None if the result is not signed.
    """

    result: str
    key: str | None = None

    @property
    def text(self) -> str:
        """Return both fingerprints as one line of text, as in the QR code; `roaas verify` prints the same two."""
        return f"RoAAS result sha256:{self.result} key sha256:{self.key}"

    @property
    def code(self) -> Markup:
        """Return the QR code of both fingerprints as SVG: dark on white, with the margin that scanners need."""
        picture = segno.make(self.text, error="m").svg_inline(scale=3, light="#fff", omitsize=True)
        return Markup(picture)  # noqa: S704 - drawn here, from two digests
