"""The header fields and the content of every response: framing, types, dates, Allow, charset, JSON text."""

import re
from collections.abc import Iterator
from email.utils import parsedate_to_datetime
from functools import lru_cache
from http import HTTPStatus
from typing import Final

from conformance.checkers.occasion import Occasion
from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json, is_xml, resource_at
from conformance.transport.exchange import Response
from conformance.verdict.evidence import SENTENCE, Case

WELL_FRAMED: Final = "well-framed HTTP"
# Headers that clients act on, and that several values make meaningless (RFC 9110 5.3).
_SINGLE = ("Content-Type", "Location", "Retry-After")
_TIMES = frozenset({"date", "last-modified"})  # headers that contain one time and nothing else
# Grammar of a time in a header (RFC 9110 5.6.7).
_IMF_FIXDATE = re.compile(
    r"(?:Mon|Tue|Wed|Thu|Fri|Sat|Sun), \d{2} (?:Jan|Feb|Mar|Apr|May|Jun|Jul|Aug|Sep|Oct|Nov|Dec) \d{4} "
    r"\d{2}:\d{2}:\d{2} GMT",
    re.ASCII,
)
# Statuses by which a web server refuses a request before the application sees it, unless the description declares them.
_OF_PARSERS = frozenset({400, 413, 414, 431})
# Last-Modified may be later than Date by this, s: a proxy may set Date, and servers write the same Date for a second.
_SKEW_S: Final = 60.0
# RFC 9110 8.8.3: entity-tag.
_ENTITY_TAG = re.compile(r'(?:W/)?"[\x21\x23-\x7e\x80-\xff]*"')


def framing(occasion: Occasion) -> Iterator[Case]:
    """Judge that a response has only one length (RFC 9112 6.2): of two, readers may take either."""
    answer = occasion.response
    both = answer.header("transfer-encoding") is not None and answer.header("content-length") is not None
    found = "Content-Length beside Transfer-Encoding"
    yield occasion.case("http/framing", not both, WELL_FRAMED, found, cause="two lengths")


def content_type(occasion: Occasion) -> Iterator[Case]:
    """Judge that a body has a media type (RFC 9110 8.3)."""
    answer = occasion.response
    if answer.body:
        named = answer.header("content-type")
        found = f"{f'Content-Type: {named}' if named else 'no Content-Type'} with a body of {len(answer.body)} bytes"
        yield occasion.case("http/content-type", "/" in answer.media_type, "a Content-Type with a media type", found)


def once(occasion: Occasion) -> Iterator[Case]:
    """Judge that no header field occurs twice unless its value is a list (RFC 9110 5.3)."""
    twice = occasion.response.repeated_name(*_SINGLE)
    yield occasion.case("http/field-once", not twice, "no header twice unless it is a list", f"{twice} several times")


def date(occasion: Occasion) -> Iterator[Case]:
    """Judge Date, which RFC 9110 6.6.1 leaves 5xx free to omit."""
    status, operation = occasion.response.status, occasion.operation
    by_server = status in _OF_PARSERS and not (operation and str(status) in operation.responses)
    if status < HTTPStatus.INTERNAL_SERVER_ERROR and occasion.request.raw is None and not by_server:
        said = occasion.response.header("date")
        found = "no header field Date" if said is None else f"Date: {said}"
        yield occasion.case("http/date", _is_date(said), "Date with the time of the response", found)


def formats(occasion: Occasion) -> Iterator[Case]:
    """Judge the form of times and entity tags."""
    for name, value in occasion.response.headers:
        if name.lower() in _TIMES:
            expected, found = f"{name} in the format Sun, 06 Nov 1994 08:49:37 GMT", f"{name}: {value}"
            holds = _IMF_FIXDATE.fullmatch(value.strip()) is not None
            yield occasion.case("http/date-format", holds, expected, found, cause=name.lower())
        elif name.lower() == "etag":
            holds = _ENTITY_TAG.fullmatch(value.strip()) is not None
            expected = 'ETag with a tag in double quotes, such as "a1" or W/"a1"'
            yield occasion.case("http/etag-format", holds, expected, f"ETag: {value}", cause="etag")


def last_modified(occasion: Occasion) -> Iterator[Case]:
    """Judge that Last-Modified is not later than the response's Date (RFC 9110 8.8.2.1)."""
    said, now = (occasion.response.header(name) or "" for name in ("last-modified", "date"))
    if all(_IMF_FIXDATE.fullmatch(text.strip()) and _is_date(text) for text in (said, now)):
        late = parsedate_to_datetime(said) - parsedate_to_datetime(now)
        expected, holds = f"Last-Modified no later than Date: {now}", late.total_seconds() <= _SKEW_S
        yield occasion.case("http/last-modified", holds, expected, f"Last-Modified: {said}", cause="late")


@lru_cache(maxsize=64)
def _is_date(value: str | None) -> bool:
    try:
        return value is not None and parsedate_to_datetime(value) is not None
    except (ValueError, TypeError, IndexError):
        return False


# Methods that a proxy or web server may refuse without asking the resource.
_OF_SERVERS = frozenset({"TRACE", "CONNECT"})
_ALWAYS_ALLOWED = frozenset({"HEAD", "OPTIONS", "TRACE"})


def allow(occasion: Occasion) -> Iterator[Case]:
    """Judge Allow where a device refuses a method that its description does not have, or answers OPTIONS."""
    method, response, is_claimed = occasion.request.method, occasion.response, occasion.contract.is_claimed
    is_refused = response.status == HTTPStatus.METHOD_NOT_ALLOWED and occasion.operation is None
    is_asked = method == "OPTIONS" and response.ok
    if not (is_refused or is_asked) or not occasion.context.usual or method in _OF_SERVERS:
        return
    said, resource = response.header("allow"), resource_at(occasion.contract, occasion.context.target.split("?", 1)[0])
    if resource is None:
        return
    if is_refused:
        yield occasion.case("http/allow", said is not None, "the header field Allow", "no header field Allow")
    if said is None:
        return
    named, wanted = {name.strip() for name in said.split(",")} - {""}, set(resource.methods) - _ALWAYS_ALLOWED
    besides, missing = named - wanted - _ALWAYS_ALLOWED, wanted - named if is_refused or is_claimed else set()
    # A framework's router may name the methods of one of several routes, so only a claimed contract demands them all.
    cause, left_out = f"{', '.join(sorted(besides))} besides", f"no {', '.join(sorted(missing))}"
    declared, found = (
        f"Allow: {', '.join(sorted(wanted))}, as declared",
        f"Allow: {said} ({cause if besides else left_out})",
    )
    yield occasion.case("description/allow", not besides | missing, declared, found, cause=cause)
    if is_asked and not is_claimed:
        return  # a response to OPTIONS need not have Allow (RFC 9110 9.3.7), so it need not name all methods either
    yield occasion.case(
        "http/allow-agrees",
        not (is_refused and method in named - _ALWAYS_ALLOWED) and not (is_claimed and missing),
        f"Allow: {', '.join(sorted(wanted))} (others may stand beside them, but none that got 405)",
        f"Allow: {said}",
        cause="methods left out",
    )


# A header field with its value in a sentence of a description on all responses.
_PROMISED = re.compile(r"\b(?:all|every|each)\b[^`]*`([A-Za-z-]+):\s*([^`]+)`", re.IGNORECASE)


@lru_cache(maxsize=16)
def _promises(text: str) -> tuple[tuple[str, str], ...]:
    said = [sentence for sentence in re.split(r"\.\s", text) if "response" in sentence.lower()]
    return tuple((found[1], found[2].strip()) for sentence in said for found in _PROMISED.finditer(sentence))


def promised_fields(occasion: Occasion) -> Iterator[Case]:
    """Judge the header fields that the head of the description promises for all responses."""
    head = str(occasion.contract.openapi.get("info", {}).get("description", ""))
    # A web server refuses some requests by itself.
    is_own = occasion.operation is not None and occasion.response.ok
    for name, value in _promises(head) if is_own else ():
        got = occasion.response.header(name)
        expected = f"{name}: {value}, as the description says of all responses"
        holds, found = value.lower() in (got or "").lower(), f"no {name}" if got is None else f"{name}: {got}"
        yield occasion.case("description/headers", holds, expected, found, cause=f"{name} promised", doubt=SENTENCE)


def challenge(occasion: Occasion) -> Iterator[Case]:
    """Judge that 401 names the credentials that are wanted (RFC 9110 15.5.2)."""
    if occasion.response.status == HTTPStatus.UNAUTHORIZED:
        there = occasion.response.header("www-authenticate") is not None
        name = "WWW-Authenticate"
        yield occasion.case("http/authentication", there, f"the header field {name}", f"no header field {name}")


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
