"""Small files of common media types, which a device that looks into an upload accepts."""

import gzip
import io
import struct
import wave
import zipfile
import zlib
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

#: First part of the media types of images, sounds and films.
MEDIA: Final = frozenset({"image", "audio", "video"})
# Content of a file that is only to be accepted.
_USUAL: Final = b"roaas"
# Most octets of a part of a comment in GIF, whose length is one octet.
_GIF_PART: Final = 255
# Pixels of a line. Devices refuse images that are wider than their screen, or no wider than a line.
_PIXELS: Final = 64


def keeps_octets(media_type: str) -> bool:
    """Return whether content of a media type is a file, in which every byte matters."""
    is_other = media_type in {"application/octet-stream", "application/pdf", "application/zip"}
    return is_other or media_type.partition("/")[0] in MEDIA


def file_of(media_type: str, octets: bytes = _USUAL) -> bytes:
    """Return a valid file in which the octets stand as they are; the octets alone where the type is not known.

    Args:
        media_type: without parameters.
        octets: at most 30,000: an image's pixels, a sound's samples or a comment. SVG has them in hexadecimal digits.
    """
    make = _MAKERS.get(media_type.lower())
    return make(octets) if make is not None else octets


def is_made(media_type: str) -> bool:
    """Return whether files of a media type can be made."""
    return media_type.lower() in _MAKERS


def _png(octets: bytes) -> bytes:
    """Return an image of lines of 64 grey pixels, each an octet (PNG, third edition, 5 and 11)."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    lines = _lines(octets, _PIXELS)
    header = struct.pack(">IIBBBBB", _PIXELS, len(lines), 8, 0, 0, 0, 0)
    pixels = zlib.compress(b"".join(b"\0" + line for line in lines), 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


def _lines(octets: bytes, width: int) -> list[bytes]:
    """Return the octets in lines of one width, the last one filled up with zeros."""
    return [octets[start : start + width].ljust(width, b"\0") for start in range(0, len(octets), width)]


def _jpeg(octets: bytes) -> bytes:
    """Return a grey pixel with a comment (ITU-T T.81, B.2)."""

    def segment(marker: int, data: bytes) -> bytes:
        return struct.pack(">BBH", 0xFF, marker, len(data) + 2) + data

    # Two tables of Huffman codes, of the direct and of the alternating part, each of one code of one bit.
    codes = bytes((1, *(0,) * 15, 0))
    return b"".join(
        (
            b"\xff\xd8",
            segment(0xE0, b"JFIF\0\1\1\0\0\1\0\1\0\0"),
            segment(0xFE, octets),
            segment(0xDB, b"\0" + b"\1" * 64),
            segment(0xC0, bytes((8, 0, 1, 0, 1, 1, 1, 0x11, 0))),
            segment(0xC4, b"\x00" + codes),
            segment(0xC4, b"\x10" + codes),
            segment(0xDA, bytes((1, 1, 0, 0, 63, 0))),
            b"\x3f\xff\xd9",
        )
    )


def _gif(octets: bytes) -> bytes:
    """Return a pixel with a comment (GIF89a, 17 to 27)."""
    parts = (octets[start : start + _GIF_PART] for start in range(0, len(octets), _GIF_PART))
    comment = b"\x21\xfe" + b"".join(bytes((len(part),)) + part for part in parts) + b"\0"
    screen = b"\1\0\1\0\x80\0\0" + b"\0\0\0\xff\xff\xff"
    return b"GIF89a" + screen + comment + b"\x2c\0\0\0\0\1\0\1\0\0" + b"\2\2\x44\1\0" + b"\x3b"


def _bmp(octets: bytes) -> bytes:
    """Return an image of lines of 64 pixels, each three octets."""
    lines = _lines(octets, 3 * _PIXELS)
    size = 3 * _PIXELS * len(lines)
    header = struct.pack("<IiiHHIIiiII", 40, _PIXELS, len(lines), 1, 24, 0, size, 2835, 2835, 0, 0)
    return b"BM" + struct.pack("<IHHI", 14 + len(header) + size, 0, 0, 14 + len(header)) + header + b"".join(lines)


def _wav(octets: bytes) -> bytes:
    """Return a sound of one channel, each octet a sample."""
    file = io.BytesIO()
    with wave.open(file, "wb") as sound:
        sound.setnchannels(1)
        sound.setsampwidth(1)
        sound.setframerate(8000)
        sound.writeframes(octets)
    return file.getvalue()


def _zip(octets: bytes) -> bytes:
    """Return an archive of one file, which is not compressed."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(zipfile.ZipInfo("roaas.bin"), octets)
    return file.getvalue()


def _pdf(octets: bytes) -> bytes:
    """Return an empty page, with a stream that it does not show (ISO 32000-1, 7.5)."""
    objects = (
        b"<</Type/Catalog/Pages 2 0 R>>",
        b"<</Type/Pages/Kids[3 0 R]/Count 1>>",
        b"<</Type/Page/Parent 2 0 R/MediaBox[0 0 72 72]/Resources<<>>>>",
        b"<</Length %d>>\nstream\n%b\nendstream" % (len(octets), octets),
    )
    made, places = b"%PDF-1.4\n", list[int]()
    for number, content in enumerate(objects, 1):
        places.append(len(made))
        made += b"%d 0 obj\n%b\nendobj\n" % (number, content)
    table = b"".join(b"%010d 00000 n \n" % place for place in places)
    count = len(objects) + 1
    trailer = b"trailer\n<</Size %d/Root 1 0 R>>\nstartxref\n%d\n%%%%EOF\n" % (count, len(made))
    return made + b"xref\n0 %d\n0000000000 65535 f \n%b%b" % (count, table, trailer)


def _svg(octets: bytes) -> bytes:
    """Return an empty drawing with a comment, in which the octets are hexadecimal."""
    comment = f"<!--{octets.hex()}-->"
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1">{comment}</svg>'.encode()


_MAKERS: Final[Mapping[str, Callable[[bytes], bytes]]] = MappingProxyType(
    {
        "image/png": _png,
        "image/jpeg": _jpeg,
        "image/gif": _gif,
        "image/bmp": _bmp,
        "image/svg+xml": _svg,
        **dict.fromkeys(("audio/wav", "audio/x-wav", "audio/wave"), _wav),
        "application/pdf": _pdf,
        **dict.fromkeys(("application/zip", "application/x-zip-compressed"), _zip),
        **dict.fromkeys(("application/gzip", "application/x-gzip"), lambda octets: gzip.compress(octets, 0, mtime=0)),
    }
)
