"""Content codings (RFC 9110 8.4.1): the content of a response before the server compressed it."""

import zlib
from typing import Final, NamedTuple

_GZIP: Final = frozenset({"gzip", "x-gzip"})
_GZIP_BITS = 31  # argument of zlib for gzip data
_DEFLATE_BITS = (15, -15)  # for zlib data, and for the raw data that some servers send as deflate (RFC 9110 8.4.1.2)
_LARGEST = 1 << 25  # longest decoded content that is read, bytes
_MEMBERS = 100  # most members of gzip data: each of them copies the remaining data


class Content(NamedTuple):
    """The content of a response.

    Attributes:
        octets: decoded, or as received where that cannot be done.
        coding: the value of Content-Encoding in lower case; empty without a coding.
        is_plain: whether the octets are the content without a coding.
        fault: what is wrong with the coded octets, a noun phrase, or empty.
    """

    octets: bytes
    coding: str
    is_plain: bool
    fault: str = ""


def content_of(octets: bytes, encoding: str | None, *, is_whole: bool) -> Content:
    """Return the content of a response that has these octets and this Content-Encoding.

    Content is not decoded if its coding is not gzip or deflate, if it exceeds 32 MiB or 100 members, or if it is cut
    not decoded.
    """
    coding = (encoding or "").strip().lower()
    coding = "" if coding == "identity" else coding
    if not coding or not octets:
        return Content(octets, coding, is_plain=True)
    found, fault = None, ""
    for bits in (_GZIP_BITS,) if coding in _GZIP else _DEFLATE_BITS if coding == "deflate" else ():
        if is_whole and found is None:
            found, fault = _unpack(octets, bits)
    return Content(octets if found is None else found, coding, found is not None, fault if coding in _GZIP else "")


def _unpack(octets: bytes, bits: int) -> tuple[bytes | None, str]:
    """Return decompressed content, or None if it is too large or not compressed; and the error or an empty text."""
    left, found = octets, bytearray()
    for _ in range(_MEMBERS):  # several members of gzip are one content (RFC 1952 2.2)
        if not left:
            return bytes(found), ""
        unpacker = zlib.decompressobj(bits)
        try:
            found += unpacker.decompress(left, _LARGEST - len(found) + 1)
        except zlib.error as error:
            return None, f"{len(left)} bytes after the end of the gzip data" if found else f"no gzip data ({error})"
        if len(found) > _LARGEST:
            return None, ""
        if not unpacker.eof:
            return None, f"{len(octets)} bytes of gzip data that end before their checksum"
        left = unpacker.unused_data
    return None, ""
