"""SOAP messages in multipart/related: MTOM and XOP (W3C), and SOAP with Attachments (W3C note)."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from email.message import Message
from typing import TYPE_CHECKING, Final
from urllib.parse import unquote

from conformance.documents.xml import NotXmlError, parse

if TYPE_CHECKING:
    from lxml import etree

# Budget of a multipart body: _MOST_PARTS, and _MOST_OCTETS of included parts, counted each time they are included.
_MOST_PARTS: Final = 10_000
_MOST_OCTETS: Final = 64 * 1024 * 1024
_INCLUDE: Final = "{http://www.w3.org/2004/08/xop/include}Include"
_XOP: Final = "application/xop+xml"


@dataclass(frozen=True)
class Part:
    """One part of a multipart body.

    Attributes:
        content_type: its Content-Type, or empty.
        id: its Content-ID, without angle brackets; empty without one.
        body: its content.
    """

    content_type: str
    id: str
    body: bytes

    @property
    def media_type(self) -> str:
        """Its media type; that of the packaged document, if it is a XOP package."""
        own = parameter(self.content_type)
        return parameter(parameter(self.content_type, "type")) if own == _XOP else own


def parameter(content_type: str, name: str = "") -> str:
    """Return a parameter of a Content-Type; without a name, the media type in lower case."""
    fields = Message()
    fields["Content-Type"] = content_type or "application/octet-stream"
    return str(fields.get_param(name, "")) if name else fields.get_content_type() if content_type else ""


def parts_of(content_type: str, body: bytes) -> list[Part]:
    """Return the parts of a multipart body, the root part first (RFC 2387).

    Raises:
        NotXmlError: it is no multipart body; the message says why.
    """
    boundary = parameter(content_type, "boundary").encode("latin-1", "replace")
    if not boundary:
        raise NotXmlError("multipart/related without a boundary")
    pieces = (b"\r\n" + body).split(b"\r\n--" + boundary)
    if len(pieces) < 3 or not pieces[-1].startswith(b"--"):  # noqa: PLR2004 - a part between two delimiters
        raise NotXmlError("multipart/related that does not end with its boundary")
    if len(pieces) > _MOST_PARTS:
        raise NotXmlError(f"multipart/related with more than {_MOST_PARTS:,} parts")
    found = [_part(piece.partition(b"\r\n")[2]) for piece in pieces[1:-1]]
    start = parameter(content_type, "start").strip("<>")
    root = next((part for part in found if start and part.id == start), found[0])
    return [root, *(part for part in found if part is not root)]


def _part(octets: bytes) -> Part:
    head, _, body = (b"\r\n" + octets).partition(b"\r\n\r\n")
    fields = Message()
    for line in head.decode("latin-1").replace("\r\n ", " ").replace("\r\n\t", " ").split("\r\n"):
        name, colon, value = line.partition(":")
        if colon:
            fields[name.strip()] = value.strip()
    if fields.get("Content-Transfer-Encoding", "").lower() == "base64":
        try:
            body = base64.b64decode(body)
        except ValueError as error:
            raise NotXmlError(f"a part that is no base64: {error}") from error
    return Part(fields.get("Content-Type", ""), fields.get("Content-ID", "").strip("<>"), body)


def root_of(content_type: str, body: bytes) -> etree._Element:
    """Return the root element of a message, with the parts that it includes by XOP in their places.

    Raises:
        NotXmlError: it is not well-formed, is no multipart body, or includes a part that is not there.
    """
    if parameter(content_type) != "multipart/related":
        return parse(in_utf_8(content_type, body), doctype=True)
    root, *others = parts_of(content_type, body)
    document = parse(in_utf_8(root.content_type, root.body), doctype=True)
    by_id = {part.id: part for part in others}
    octets = 0
    for include in list(document.iter(_INCLUDE)):
        wanted, parent = unquote(include.get("href", "")).removeprefix("cid:"), include.getparent()
        if wanted not in by_id:
            raise NotXmlError(f"xop:Include names the part {wanted!r}, which is not there")
        octets += len(by_id[wanted].body)
        if octets > _MOST_OCTETS:
            raise NotXmlError(f"the parts that xop:Include repeats have more than {_MOST_OCTETS:,} bytes")
        if parent is not None:
            parent.remove(include)
            parent.text = base64.b64encode(by_id[wanted].body).decode()
    return document


def in_utf_8(content_type: str, body: bytes) -> bytes:
    """Return XML in UTF-8 if its Content-Type names another charset, which outranks the document (RFC 7303, 3.2)."""
    charset = parameter(content_type, "charset").strip("'\"").lower()
    # A byte order mark outranks the charset, and an encoding in the document itself is left to the parser.
    if charset in {"", "utf-8", "idna", "punycode"} or body.startswith((b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")):
        return body
    try:
        text = body.decode(charset)
    except (LookupError, UnicodeError):
        return body
    declaration = text.startswith("<?xml") and "?>" in text
    return (text.partition("?>")[2] if declaration else text).encode()
