"""HTTP requests and responses as values that a mutant can change, and the protocol of a change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from typing import Any, Protocol

from conformance.transport.exchange import media_type_of

_REASONS = {status.value: status.phrase for status in HTTPStatus}
_INFORMATIONAL = range(100, 200)
_NO_BODY = {204, 304}


class _Message:
    """The header fields, version and raw bytes that requests and responses share."""

    fields: list[tuple[str, str]]
    version: str
    raw: bytes | None

    def field(self, name: str) -> str | None:
        """Return the first value of a header, or None; the name's case does not matter."""
        return next((value for key, value in self.fields if key.lower() == name.lower()), None)

    def drop(self, name: str) -> None:
        """Remove all headers of a name."""
        self.fields = [(key, value) for key, value in self.fields if key.lower() != name.lower()]

    def put(self, name: str, value: str) -> None:
        """Set a header, replacing all of its name."""
        if self.field(name) != value or self._count(name) > 1:
            self.drop(name)
            self.fields.append((name, value))

    def _count(self, name: str) -> int:
        return sum(key.lower() == name.lower() for key, _ in self.fields)

    @property
    def media_type(self) -> str:
        """The media type in Content-Type, without parameters, in lower case; empty without the header."""
        return media_type_of(self.field("Content-Type") or "")

    @property
    def is_last(self) -> bool:
        """Whether the connection must be closed after this message."""
        closes = "close" in (self.field("Connection") or "").lower()
        return closes or self.raw is not None or self.version == "HTTP/1.0"

    def _head(self, line: str) -> bytes:
        lines = [line, *(f"{key}: {value}" for key, value in self.fields), "", ""]
        return "\r\n".join(lines).encode("latin-1", "replace")


@dataclass
class Request(_Message):
    """A request as a client sent it.

    Attributes:
        side: "rest" or "soap", by the port that received it.
        raw: its bytes if they are not HTTP; the other attributes are then empty. None for HTTP.
        came: its bytes as received, in pieces.
        nth: its number on its connection, from 1.
        beside: whether its client came while another one was connected.
    """

    side: str
    method: str = ""
    target: str = ""
    version: str = "HTTP/1.1"
    fields: list[tuple[str, str]] = field(default_factory=list)
    body: bytes = b""
    raw: bytes | None = None
    came: tuple[bytes, ...] = ()
    nth: int = 1
    beside: bool = False

    @property
    def path(self) -> str:
        """The request target without its query."""
        return self.target.partition("?")[0]

    @property
    def query(self) -> str:
        """The query of the request target, without the question mark."""
        return self.target.partition("?")[2]

    def copy(self, **changes: Any) -> Request:
        """Return a copy with some attributes replaced; its headers can be changed independently."""
        return replace(self, **{"fields": list(self.fields), **changes})

    def octets(self) -> bytes:
        """Return its bytes, with a matching Content-Length unless it has several that contradict each other."""
        if self.raw is not None:
            return self.raw
        body = self.body
        if "chunked" in (self.field("Transfer-Encoding") or "").lower():
            body = (b"%x\r\n%b\r\n" % (len(body), body) if body else b"") + b"0\r\n\r\n"
        else:
            lengths = self._count("Content-Length")
            if lengths == 1 or (body and not lengths):
                self.put("Content-Length", str(len(body)))
        return self._head(f"{self.method} {self.target} {self.version}") + body


@dataclass
class Response(_Message):
    """A response to a client.

    Attributes:
        raw: bytes to send instead of the other attributes, before the connection is closed; or None.
        method: the method of its request.
    """

    status: int
    fields: list[tuple[str, str]] = field(default_factory=list)
    body: bytes = b""
    version: str = "HTTP/1.1"
    reason: str = ""
    raw: bytes | None = None
    method: str = "GET"

    def copy(self) -> Response:
        """Return a copy whose headers can be changed independently."""
        return replace(self, fields=list(self.fields))

    def octets(self) -> bytes:
        """Return its bytes, with a matching Content-Length."""
        if self.raw is not None:
            return self.raw
        self.drop("Transfer-Encoding")
        if self.status in _NO_BODY or self.status in _INFORMATIONAL:
            self.drop("Content-Length")
            self.body = b""
        elif self.method != "HEAD":
            self.put("Content-Length", str(len(self.body)))
        head = self._head(f"{self.version} {self.status} {self.reason or _REASONS.get(self.status, 'Unknown')}")
        return head if self.method == "HEAD" else head + self.body


Forward = Callable[[Request], Response]


class HangUpError(Exception):
    """Raised by a change to close the connection without a response."""


class Change(Protocol):
    """A proxy's changes of requests and responses. Each run has its own instance, which may keep state."""

    def __call__(self, request: Request, forward: Forward) -> Response:
        """Return the response to a request. ``forward`` sends a request to the device, any number of times.

        Raises:
            HangUpError: the connection is to be closed without a response.
        """


class IncompleteRequest(Protocol):
    """A mutant's reaction to a request that its client never completed."""

    def __call__(self, side: str, octets: bytes, forward: Forward) -> None:
        """Take the bytes that were received before the client disconnected."""


def unchanged(request: Request, forward: Forward) -> Response:
    """Forward the request and return the response unchanged."""
    return forward(request)
