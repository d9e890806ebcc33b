"""The header fields of every response: framing, Content-Type, Date, ETag, and fields that may stand there once."""

import re
from collections.abc import Iterator
from email.utils import parsedate_to_datetime
from functools import lru_cache
from http import HTTPStatus
from typing import Final

from conformance.checkers.occasion import Occasion
from conformance.verdict.case import Case

WELL_FRAMED: Final = "well-framed HTTP"
# Fields that clients act on, and that several values make meaningless (RFC 9110 5.3).
_SINGLE = ("Content-Type", "Location", "Retry-After")
# Fields that contain one time and nothing else, in lower case, and the grammar of that time (RFC 9110 5.6.7).
_TIMES = frozenset({"date", "last-modified"})
_IMF_FIXDATE = re.compile(
    r"(?:Mon|Tue|Wed|Thu|Fri|Sat|Sun), \d{2} (?:Jan|Feb|Mar|Apr|May|Jun|Jul|Aug|Sep|Oct|Nov|Dec) \d{4} "
    r"\d{2}:\d{2}:\d{2} GMT",
    re.ASCII,
)
# What a web server answers by itself when it refuses a request, unless the API's author declares it.
_OF_PARSERS = frozenset({400, 413, 414, 431})
# RFC 9110 8.8.3: entity-tag.
_ENTITY_TAG = re.compile(r'(?:W/)?"[\x21\x23-\x7e\x80-\xff]*"')


def framing(occasion: Occasion) -> Iterator[Case]:
    """Judge that a response has one length (RFC 9112 6.2): of two, readers may take either one."""
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
        expected = "a Content-Type header field with a media type"
        yield occasion.case("http/content-type", "/" in answer.media_type, expected, found)


def once(occasion: Occasion) -> Iterator[Case]:
    """Judge that no field is there twice whose value is no list (RFC 9110 5.3)."""
    twice = occasion.response.repeated(*_SINGLE)
    expected = "no header twice, unless its value is a list"
    yield occasion.case("http/field-once", not twice, expected, f"{twice} several times")


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


@lru_cache(maxsize=64)
def _is_date(value: str | None) -> bool:
    try:
        return value is not None and parsedate_to_datetime(value) is not None
    except (ValueError, TypeError, IndexError):
        return False
