"""What a signed page is checked by: two fingerprints, as text and as a QR code (ISO/IEC 18004)."""

from dataclasses import dataclass

import segno
from markupsafe import Markup


@dataclass(frozen=True, slots=True)
class Seal:
    """Fingerprints of a page.

    Attributes:
        result: SHA-256 of result.json, in hexadecimal.
        key: fingerprint of the key that signed it, or None where none did.
    """

    result: str
    key: str | None = None

    @property
    def text(self) -> str:
        """Both in a line, as the QR code has them; `roaas verify` tells the same two."""
        return f"RoAAS result sha256:{self.result} key sha256:{self.key}"

    @property
    def code(self) -> Markup:
        """The QR code as SVG: dark on white, whatever the page's colours, with the quiet zone that scanners need."""
        picture = segno.make(self.text, error="m").svg_inline(scale=3, light="#fff", omitsize=True)
        return Markup(picture)  # noqa: S704 - drawn here, from two digests
