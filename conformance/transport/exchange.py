"""Requests and responses as values that can be recorded, shown and sent again."""

import re
import time
from dataclasses import dataclass, field, replace
from email.utils import parsedate_to_datetime
from enum import StrEnum
from functools import cached_property
from typing import Final, NamedTuple, Self
from urllib.parse import quote

from conformance.transport.codings import Content, content_of
from conformance.transport.shell_command import bytes_command, shell_command

# Methods that change nothing (RFC 9110 9.2.1), so they may be sent again without permission.
SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
# Characters of a request target (RFC 3986 2).
_SENDABLE: Final = "".join(map(chr, range(0x21, 0x7F)))
# Methods that have the same effect when sent twice (RFC 9110 9.2.2): a client may repeat them on a new connection.
IDEMPOTENT_METHODS = SAFE_METHODS | {"PUT", "DELETE"}
# A path segment that matches _VALUE, or is longer than _LONG_SEGMENT, is a value and no name.
_VALUE = re.compile(r"\d|%|NaN|Infinity")
_LONG_SEGMENT = 40
_PARTIAL: Final = 206
#: Statuses by which an overloaded server refuses any request (RFC 6585 4, RFC 9110 15.6.4).
TOO_MANY, UNAVAILABLE = 429, 503
BUSY: Final = frozenset({TOO_MANY, UNAVAILABLE})
_SECONDS: Final = re.compile(r"\d{1,9}", re.ASCII)
# The first element in a SOAP Body names the operation: the operations of a service share one URL.
_SOAP_OPERATION = re.compile(rb"<(?:[\w.-]+:)?Body[^>]*>\s*<(?:[\w.-]+:)?([\w.-]+)")
_SOAP_HEAD = 4096


@dataclass(frozen=True)
class Outgoing:
    """One HTTP request that is to be sent.

    Attributes:
        method: HTTP method.
        target: path and query below the base URL.
        headers: (name, value) pairs, beside those of every request.
        body: request body.
    """

    method: str
    target: str
    headers: tuple[tuple[str, str], ...] = ()
    body: bytes = b""

    @classmethod
    def of(
        cls, method: str, target: str, content_type: str, body: bytes, headers: tuple[tuple[str, str], ...] = ()
    ) -> Self:
        """Return a request with a Content-Type; empty means without one."""
        return cls(method, target, (*headers, *((("Content-Type", content_type),) if content_type else ())), body)

    @property
    def content_type(self) -> str:
        """The value of Content-Type; empty without the header."""
        return next((value for name, value in self.headers if name.lower() == "content-type"), "")

    @property
    def media_type(self) -> str:
        """The media type in Content-Type, without parameters, in lower case; empty without the header."""
        return media_type_of(self.content_type)

    def having_type(self, content_type: str) -> Self:
        """Return the request with another Content-Type."""
        others = tuple(pair for pair in self.headers if pair[0].lower() != "content-type")
        return replace(self, headers=(*others, ("Content-Type", content_type)))


@dataclass(frozen=True)
class Request:
    """A sent HTTP request.

    Attributes:
        method: HTTP method.
        url: absolute URL with the request target as sent.
        headers: (name, value) pairs in sending order, with variables in place of credentials.
        body: request body.
        raw: the bytes on the socket if the request was written by hand and is not plain HTTP; otherwise None.
        query: what credentials add to the URL, with variables in their place.
    """

    method: str
    url: str
    headers: tuple[tuple[str, str], ...] = ()
    body: bytes = b""
    raw: bytes | None = None
    query: str = ""

    @property
    def size(self) -> int:
        """Return how much there is to read; findings show the smallest failing request."""
        if self.raw is not None:
            return len(self.raw)
        return len(self.url) + len(self.body) + sum(len(name) + len(value) for name, value in self.headers)

    @property
    def target(self) -> str:
        """Return the request target as sent; for a raw request, that in its first line."""
        target = "/" + self.url.split("//", 1)[-1].partition("/")[2]
        if self.raw is not None:
            words = self.raw.split(b"\r\n", 1)[0].decode("latin-1").split(" ")
            target = words[1] if len(words) > 1 else ""
            if target.startswith(("http://", "https://")):
                target = "/" + target.split("//", 1)[1].partition("/")[2]
        return target

    @property
    def media_type(self) -> str:
        """The media type in Content-Type, without parameters, in lower case; empty without the header."""
        return media_type_of(next((value for name, value in self.headers if name.lower() == "content-type"), ""))

    @property
    def endpoint(self) -> str:
        """Return method, server and path without parameter values, and the operation of a SOAP message."""
        path = "/".join(
            "*" if _VALUE.search(part) or len(part) > _LONG_SEGMENT else part
            for part in self.target.split("?", 1)[0].split("/")
        )
        scheme, _, rest = self.url.partition("//")
        found = _SOAP_OPERATION.search(self.body[:_SOAP_HEAD]) if self.method == "POST" else None
        operation = f" {found[1].decode('latin-1')}" if found else ""
        return f"{self.method} {scheme}//{rest.partition('/')[0]}{path}{operation}"

    def curl(self) -> str:
        """Return a shell command that sends the request again: curl, or Python where curl cannot."""
        if self.raw is not None:
            return bytes_command(self.url, self.raw)
        return shell_command(self.method, self.url, self.headers, self.body, self.query)


def sendable(target: str) -> str:
    """Return a request target with everything percent-encoded that HTTP cannot carry, such as letters beyond ASCII."""
    is_sendable = target.isascii() and target.isprintable() and " " not in target
    return target if is_sendable else quote(target, safe=_SENDABLE, errors="surrogateescape")


def media_type_of(content_type: str) -> str:
    """Return the media type in the value of a Content-Type, without parameters, in lower case (RFC 9110 8.3)."""
    return content_type.partition(";")[0].strip().lower()


@dataclass(frozen=True)
class Response:
    """One HTTP response.

    Attributes:
        status: status code.
        headers: (name, value) pairs in the order and case as received.
        octets: content after transfer decoding and before content decoding.
        elapsed_ms: time from the first byte sent to the last byte received, ms.
        http_version: ``HTTP/1.1`` or ``HTTP/1.0``.
        received_s: when the last byte was received, s on the monotonic clock; 0 if unknown.
        cut: why the suite stopped reading the body before its end, or empty.
    """

    status: int
    headers: tuple[tuple[str, str], ...]
    octets: bytes
    elapsed_ms: float
    http_version: str = "HTTP/1.1"
    received_s: float = field(default=0.0, compare=False)
    cut: str = ""

    @cached_property
    def content(self) -> Content:
        """The content with its coding. No Accept-Encoding allows a server any coding (RFC 9110 12.5.3)."""
        is_whole = not self.cut and self.status != _PARTIAL
        return content_of(self.octets, self.header("content-encoding"), is_whole=is_whole)

    @cached_property
    def body(self) -> bytes:
        """The content without its coding, as every reader of a representation needs it."""
        return self.content.octets

    @cached_property
    def _by_name(self) -> dict[str, list[str]]:
        """The values of each header by its name in lower case. Cached, because many checks read it."""
        found: dict[str, list[str]] = {}
        for name, value in self.headers:
            found.setdefault(name.lower(), []).append(value)
        return found

    def header(self, name: str) -> str | None:
        """Return the value of a header, several joined by commas (RFC 9110 5.3), or None."""
        values = self._by_name.get(name.lower())
        return ", ".join(values) if values else None

    def repeated_name(self, *names: str) -> str:
        """Return the first of these headers that occurs more than once, or an empty text."""
        return next((name for name in names if len(self._by_name.get(name.lower(), ())) > 1), "")

    @cached_property
    def media_type(self) -> str:
        """The media type in Content-Type, without parameters, in lower case; empty without the header."""
        return media_type_of(self.header("content-type") or "")

    @cached_property
    def put_off_s(self) -> float | None:
        """For how long an overloaded server puts the request off, s (RFC 9110 10.2.3); None if it does not.

        A 429 without Retry-After leaves the time open: 0.
        """
        if self.status not in BUSY:
            return None
        after, otherwise = (self.header("retry-after") or "").strip(), 0.0 if self.status == TOO_MANY else None
        if _SECONDS.fullmatch(after):
            return float(after)
        try:
            now = parsedate_to_datetime(self.header("date") or "").timestamp()
        except ValueError:
            now = time.time()
        try:
            return max(0.0, parsedate_to_datetime(after).timestamp() - now)
        except (ValueError, OverflowError):
            return otherwise

    @property
    def ok(self) -> bool:
        """Whether the status is 2xx."""
        return 200 <= self.status < 300  # noqa: PLR2004 - RFC 9110 15.3


@dataclass(frozen=True)
class Exchange:
    """A request with its response."""

    request: Request
    response: Response

    @property
    def came(self) -> str:
        """A short description of the response, for findings."""
        kind = f", {self.response.media_type}" if self.response.media_type else ""
        return f"status {self.response.status}{kind}"


class NoAnswer(StrEnum):
    """Why no response was received."""

    REFUSED = "refused"
    TIMEOUT = "timeout"
    CLOSED = "closed"
    TLS = "tls"
    MALFORMED = "malformed"
    # the endpoint hung before, so the request was not sent
    CIRCUIT_OPEN = "circuit-open"
    # hangs have cost so much time that the run did not wait until the deadline: this shows nothing about the device
    HURRIED = "hurried"
    # A gateway responded in the place of a device that is away.
    BAD_GATEWAY = "502"
    UNAVAILABLE = "503"
    GATEWAY_TIMEOUT = "504"


#: The kind of missing response that a gateway reports by its status (RFC 9110 15.6.3 to 15.6.5).
OF_GATEWAY: Final = {502: NoAnswer.BAD_GATEWAY, 503: NoAnswer.UNAVAILABLE, 504: NoAnswer.GATEWAY_TIMEOUT}


class Unanswered(NamedTuple):
    """A request without an HTTP response. In a file of traces it is a JSON array, and so differs from an exchange.

    Attributes:
        request: the request.
        problem: what happened instead, in words ("no response within 10 s").
        kind: the same as an enum value.
    """

    request: Request
    problem: str
    kind: NoAnswer

    @property
    def came(self) -> str:
        """Return a short description of what happened instead of a response, for findings."""
        return self.problem


class Sending(NamedTuple):
    """A request that was sent, and why it got no response, or None."""

    request: Request
    kind: NoAnswer | None


# A request and its outcome; findings refer to it as evidence.
Attempt = Exchange | Unanswered


class NoAnswerError(Exception):
    """Raised when a request gets no HTTP response.

    Attributes:
        unanswered: the request, and what happened instead.
    """

    def __init__(self, unanswered: Unanswered) -> None:
        super().__init__(unanswered.problem)
        self.unanswered = unanswered

    @property
    def kind(self) -> NoAnswer:
        """Return what happened instead of a response."""
        return self.unanswered.kind


class NotPermittedError(Exception):
    """Raised instead of sending a request that this run may not send; the message explains why."""


class Listener:
    """Base class for objects that are called with every response and every request without a response. Does nothing."""

    def on_response(self, exchange: Exchange) -> None:
        """Handle a response."""

    def by_hand(self, exchange: Exchange) -> None:
        """Handle a response to bytes over a raw socket; the request has their method and URL alone."""

    def acted_by_hand(self, *, deletes: bool) -> None:
        """Handle that bytes over a raw socket may have changed something, or deleted it."""

    def on_no_response(self, request: Unanswered) -> None:
        """Handle a request without a response."""
