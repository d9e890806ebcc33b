"""HTTP requests as resources and services get them, and HTTP responses.

Content negotiation: the response format that a client's Accept field selects (RFC 9110 12.5.1).
Adjustments to a request before parsing, and checks of its complete head.
"""

import re
from collections.abc import Sequence
from functools import lru_cache
from http import HTTPStatus
from time import perf_counter
from typing import Final

from httptools import parse_url

from reference_robot.webservices.representation.problems import PROBLEM_JSON, PROBLEM_XML, Problem, not_yet
from reference_robot.webservices.representation.writing import JSON, XML

BODY_LIMIT: Final = 1024 * 1024  # bytes; the contract allows 64 KiB to 10 MiB

Field = tuple[bytes, bytes]

_NO_CONTENT: Final = 204
_SLASH: Final = ord("/")


class Request:
    """One HTTP request with its body.

    Attributes:
        method: The method as sent, in upper case.
        authority: The host and port that the client addressed: from an absolute request target (RFC 9112 3.2.2), else
            from the Host field; empty without either. Behind a trusted proxy, the host that the client sent to the
            proxy.
        scheme: ``http`` or ``https`` if a trusted proxy reports it; otherwise empty, and the port's scheme applies.
        path: The raw path as bytes, with its percent-encoding.
        query: The raw query, without the question mark.
        headers: Field values by lower-case name; repeated fields are joined by a comma.
        body: The body; complete when the request is answered.
        keep_alive: Whether the client wants to keep the connection open for further requests.
        began: When the head was complete, by ``time.perf_counter``.
    """

    __slots__ = ("authority", "began", "body", "headers", "keep_alive", "method", "path", "query", "scheme")

    def __init__(self, method: str, target: bytes, headers: dict[bytes, bytes], *, keep_alive: bool) -> None:
        """Create a request from its head.

        Raises:
            httptools' HttpParserInvalidURLError: The request target is invalid (RFC 9112 3.2).
        """
        self.method = method
        self.authority = headers.get(b"host", b"")
        self.scheme = ""
        if target[0] == _SLASH and b"#" not in target:
            self.path, _, self.query = target.partition(b"?")
        else:  # the absolute form, the asterisk, or an invalid fragment
            url = parse_url(target)
            self.path, self.query = url.path or b"/", url.query or b""
            if url.host:
                host = b"[%b]" % url.host if b":" in url.host else url.host
                self.authority = b"%b:%d" % (host, url.port) if url.port else host
        self.headers = headers
        self.body = b""
        self.keep_alive = keep_alive
        self.began = perf_counter()

    def content(self) -> bytes:
        """Return the body; raise the Problem 415 if it has a content coding (RFC 9110 8.4)."""
        coding = self.headers.get(b"content-encoding")
        if coding is None or coding.lower() == b"identity":
            return self.body
        raise Problem(
            415,
            f"Content-Encoding {coding.decode('latin-1')[:80]!a} is not supported",
            ((b"accept-encoding", b"identity"),),
        )


class Response:
    """A response: its serialized head, without the fields that each connection adds, and its body."""

    __slots__ = ("body", "head", "status")

    def __init__(self, status: int, headers: tuple[Field, ...] = (), body: bytes = b"") -> None:
        self.status = status
        self.body = body
        self.head = _head(status, headers)
        if status != _NO_CONTENT:
            self.head += b"content-length: %d\r\n" % len(body)


def content(status: int, media_type: str, body: bytes, headers: tuple[Field, ...] = ()) -> Response:
    """Return a response with a body and its Content-Type."""
    return Response(status, ((b"content-type", _type_field(media_type)), *headers), body)


@lru_cache(maxsize=256)
def _head(status: int, headers: tuple[Field, ...]) -> bytes:
    phrase = HTTPStatus(status).phrase.encode()
    return b"HTTP/1.1 %d %b\r\n" % (status, phrase) + b"".join(b"%b: %b\r\n" % field for field in headers)


@lru_cache(maxsize=16)
def _type_field(media_type: str) -> bytes:
    return (f"{media_type}; charset=utf-8" if media_type.startswith("text/") else media_type).encode()


@lru_cache(maxsize=256)
def chosen(accept: bytes | None, offers: Sequence[str]) -> str:
    """Return the offered media type that the client prefers, the first of equals; without Accept, the first offer.

    Raises:
        Problem: 406, if no offer is acceptable (RFC 9110 15.5.7).
    """
    ranges = _ranges(accept)
    best = max(offers, key=lambda offer: _quality(ranges, offer))  # max keeps the first of equals
    if _quality(ranges, best) > 0:
        return best
    field = (accept or b"").decode("latin-1")
    raise Problem(406, f"Accept: {field[:200]!a} excludes all formats of this resource: {', '.join(offers)}")


@lru_cache(maxsize=256)
def problem_format(accept: bytes | None) -> str:
    """Return the media type for error responses: XML if the client prefers XML to JSON, otherwise JSON."""
    ranges = _ranges(accept)
    likes_json = max(_quality(ranges, JSON), _quality(ranges, PROBLEM_JSON))
    likes_xml = max(_quality(ranges, XML), _quality(ranges, PROBLEM_XML))
    return PROBLEM_XML if likes_xml > likes_json else PROBLEM_JSON


def _ranges(accept: bytes | None) -> dict[str, float]:
    """Return the weight of each media range in an Accept field; members without a slash are ignored."""
    if accept is None or not accept.strip():
        return {"*/*": 1.0}
    ranges: dict[str, float] = {}
    for member in accept.decode("latin-1").lower().split(","):
        media_range, *parameters = (part.strip() for part in member.split(";"))
        quality = 1.0
        for parameter in parameters:
            name, _, value = parameter.partition("=")
            if name.strip() == "q":
                quality = _qvalue(value.strip())
        if "/" in media_range:
            ranges[media_range] = max(quality, ranges.get(media_range, 0.0))
    return ranges


def _qvalue(text: str) -> float:
    """Return a weight (RFC 9110 12.4.2: 0 to 1, at most three decimals); 0 for an invalid weight."""
    whole, _, decimals = text.partition(".")
    if whole not in {"0", "1"} or (decimals and not (decimals.isascii() and decimals.isdigit())):
        return 0.0
    return min(float(text), 1.0)


def _quality(ranges: dict[str, float], offer: str) -> float:
    """Return the weight of the most specific media range that matches an offer (RFC 9110 12.5.1)."""
    for media_range in (offer, offer.partition("/")[0] + "/*", "*/*"):
        if media_range in ranges:
            return ranges[media_range]
    return 0.0


TARGET_LIMIT: Final = 8000  # bytes (RFC 9110 4.1 requires at least that)
HEAD_LIMIT: Final = 64 * 1024  # bytes: request line and fields (RFC 6585 5)
FRAMING_LIMIT: Final = 64 * 1024  # bytes of chunk sizes, chunk extensions and trailers, besides those for each byte:
FRAMING_PER_BYTE: Final = 8  # a chunk of one byte takes six
_FIELD_MARKS: Final = 4  # bytes of a field line besides name and value: colon, space and line end
_VERSIONS: Final = frozenset({"1.1", "1.0"})
FRAMING_FIELDS: Final = (b"content-length", b"transfer-encoding")

# Fields that may occur only once in a request (RFC 9110 5.3; 9112 3.2 for Host).
_SINGLE: Final = frozenset({b"host", b"content-type", b"content-length", b"authorization"})

_SERVED: Final = (b"GET ", b"PUT ", b"POST ", b"DELETE ", b"HEAD ", b"OPTIONS ")
_METHOD: Final = re.compile(rb"[!#$%&'*+.^_`|~0-9A-Za-z-]++(?= [^ \r\n]+ HTTP/1\.[01]\r?\n)")


def readable(data: bytes) -> bytes:
    """Return the first bytes of a request, changed so that the HTTP parser accepts them.

    A method that no resource offers is replaced by TRACE. The parser would reject unknown methods; so they get the same
    405 or 404 as any unsupported method (RFC 9110 15.5.6).
    """
    if not data.startswith(_SERVED):
        method = _METHOD.match(data)
        if method is not None:
            return b"TRACE" + data[method.end() :]
    return data


def fields_by_name(fields: list[Field]) -> dict[bytes, bytes]:
    """Return field values by lower-case name, with repeated fields joined by a comma.

    Raises:
        Problem: 400 for a repeated field that may occur only once.
    """
    headers: dict[bytes, bytes] = {}
    for name, value in fields:
        if name not in headers:
            headers[name] = value
        elif name in _SINGLE:
            raise Problem(400, f"the field {name.decode('latin-1')} occurs more than once (RFC 9110 5.3)")
        else:
            headers[name] += b", " + value
    return headers


def require_head(version: str, fields: list[Field]) -> None:
    """Raise the Problem for a head that is too long, or that leaves in doubt where the request ends.

    Raises:
        Problem: 431 for fields that are too long, 505 for a version other than HTTP/1 (RFC 9110 15.6.6), 400 for a
            transfer coding in HTTP/1.0, and 501 for a transfer coding other than ``chunked`` (RFC 9112 6.1).
    """
    if sum(len(name) + len(value) + _FIELD_MARKS for name, value in fields) > HEAD_LIMIT:
        raise head_too_large()
    if version not in _VERSIONS:
        raise Problem(505, f"HTTP/{version} is not supported, only HTTP/1.1 and HTTP/1.0")
    codings = b",".join(value for name, value in fields if name == b"transfer-encoding")
    if codings and version == "1.0":
        raise Problem(400, "HTTP/1.0 has no Transfer-Encoding (RFC 9112 6.1)")
    if codings and codings.lower() != b"chunked":
        raise Problem(501, f"Transfer-Encoding {codings.decode('latin-1')[:80]!a} is not supported, only chunked")


def framing_too_large() -> Problem:
    """Return the Problem 431 for chunk extensions and trailers that are too long (RFC 6585 5)."""
    return Problem(431, f"chunk sizes, chunk extensions and trailers exceed {FRAMING_LIMIT} bytes")


def head_too_large() -> Problem:
    """Return the Problem 431 for a head that is too long (RFC 6585 5)."""
    return Problem(431, f"the head of the request exceeds {HEAD_LIMIT} bytes")


def require_old_version(version: str) -> None:
    """Raise the Problem 400 for a missing Host field, unless the version is HTTP/1.0, which has no Host field."""
    if version != "1.0":
        raise Problem(400, "the request has no Host field (RFC 9112 3.2)")


def require_bounded(size: int) -> None:
    """Raise the Problem 413 if the body's size exceeds the limit (RFC 9110 15.5.14)."""
    if size > BODY_LIMIT:
        raise Problem(413, f"the body of {size} bytes exceeds the limit of {BODY_LIMIT} bytes")


def no_request(error: BaseException) -> Problem:
    """Return the Problem 400 for bytes that the parser rejects (RFC 9112 2.2)."""
    return Problem(400, f"the request is not valid HTTP: {error}")


def full() -> Problem:
    """Return the Problem 503 for a request that would exceed the memory kept for clients (RFC 9110 15.6.4)."""
    return not_yet("the memory for requests of clients is full")
