"""HTTP requests as resources and services get them, and HTTP responses, in the format that Accept selects."""

from collections.abc import Sequence
from functools import lru_cache
from http import HTTPStatus
from time import perf_counter
from typing import Final

from httptools import parse_url

from reference_robot.webservices.representation.problems import PROBLEM_JSON, PROBLEM_XML, Problem
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
def choose_type(accept: bytes | None, offers: Sequence[str]) -> str:
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
