"""Content that can be read: JSON by RFC 8259, and text in the charset that is named."""

import re
from collections.abc import Iterator

from conformance.checkers.occasion import Occasion
from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json, is_xml
from conformance.transport.exchange import Response
from conformance.verdict.case import Case

_CHARSET = re.compile(r"""charset\s*=\s*["']?([^\s;"']+)""", re.IGNORECASE)


def json(occasion: Occasion) -> Iterator[Case]:
    """Judge the text of a JSON document."""
    answer = occasion.response
    if not answer.body or occasion.context.is_head or not is_json(answer.media_type):
        return
    text = read_json(answer.body)
    expected, found = "JSON with finite numbers", f"the number {text.non_finite}"
    yield occasion.case("http/json-finite", not text.non_finite, expected, found, cause="non-finite")
    yield occasion.case("http/json-encoding", not text.encoding, "UTF-8 without a BOM", text.encoding)
    found = f"the name {text.twice!r} twice in one object"
    yield occasion.case("http/json-unique-names", not text.twice, "each name once in an object", found)


def charset(occasion: Occasion) -> Iterator[Case]:
    """Judge whether XML and plain text are in the charset that Content-Type names."""
    answer = occasion.response
    if answer.body and (is_xml(answer.media_type) or answer.media_type == "text/plain"):
        wrong = _other_charset(answer)
        yield occasion.case("rest-formats/charset", not wrong, "content in the charset that Content-Type names", wrong)


def _other_charset(answer: Response) -> str:
    """Return why the body is not in the charset of Content-Type; empty if it is.

    Without charset, XML declares its encoding itself, and plain text is UTF-8, unless it is a server's own error. A
    byte order mark is ignored.
    """
    named = _CHARSET.search(answer.header("content-type") or "")
    if named is None and (is_xml(answer.media_type) or not answer.ok):
        return ""
    charset = named[1] if named else "utf-8"
    found = f"Content-Type {answer.header('content-type')!r} with bytes that are not {charset}"
    try:
        text = answer.body.decode(charset).lstrip("\ufeff")
    except (UnicodeError, LookupError):
        return found
    try:
        return "" if text == answer.body.decode().lstrip("\ufeff") else found
    except UnicodeDecodeError:
        return ""
