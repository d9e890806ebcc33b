"""The fingerprints by which a signed page is checked, as text and as a QR code (ISO/IEC 18004)."""

from dataclasses import dataclass

import segno
from markupsafe import Markup


@dataclass(frozen=True, slots=True)
class Seal:
    """Fingerprints of a page.

    Attributes:
        result: SHA-256 of result.json, in hexadecimal.
        key: fingerprint of the signing key, or None if it is not signed.
    """

    result: str
    key: str | None = None

    @property
    def text(self) -> str:
        """Return both in a line, as in the QR code; `roaas verify` prints the same two."""
        return f"RoAAS result sha256:{self.result} key sha256:{self.key}"

    @property
    def code(self) -> Markup:
        """Return the QR code as SVG: dark on white, with the margin that scanners need."""
        picture = segno.make(self.text, error="m").svg_inline(scale=3, light="#fff", omitsize=True)
        return Markup(picture)  # noqa: S704 - drawn here, from two digests
