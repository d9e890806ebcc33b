"""HTTP messages as values that a mutant can alter in any way, the octets that they become, and what a change is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from typing import Any, Protocol

_REASONS = {status.value: status.phrase for status in HTTPStatus}
_INFORMATIONAL = range(100, 200)
_NO_BODY = {204, 304}


class _Message:
    """What requests and responses share: header fields in their order."""

    fields: list[tuple[str, str]]
    version: str
    raw: bytes | None

    def field(self, name: str) -> str | None:
        """The first value of a field, whatever its case."""
        return next((value for key, value in self.fields if key.lower() == name.lower()), None)

    def drop(self, name: str) -> None:
        """Remove a field."""
        self.fields = [(key, value) for key, value in self.fields if key.lower() != name.lower()]

    def put(self, name: str, value: str) -> None:
        """Set a field, once."""
        if self.field(name) != value or self._count(name) > 1:
            self.drop(name)
            self.fields.append((name, value))

    def _count(self, name: str) -> int:
        return sum(key.lower() == name.lower() for key, _ in self.fields)

    @property
    def media_type(self) -> str:
        """The media type of the body, without parameters; empty where none is said."""
        return (self.field("Content-Type") or "").partition(";")[0].strip().lower()

    @property
    def is_last(self) -> bool:
        """Whether its connection ends with it: it says so, or where it ends is not known."""
        closes = "close" in (self.field("Connection") or "").lower()
        return closes or self.raw is not None or self.version == "HTTP/1.0"

    def _head(self, line: str) -> bytes:
        lines = [line, *(f"{key}: {value}" for key, value in self.fields), "", ""]
        return "\r\n".join(lines).encode("latin-1", "replace")


@dataclass
class Request(_Message):
    """A request.

    Attributes:
        side: "rest" or "soap", by the port that it came to.
        raw: its octets, where they are no HTTP; then all the rest is empty.
        came: its octets as they came, in pieces.
    """

    side: str
    method: str = ""
    target: str = ""
    version: str = "HTTP/1.1"
    fields: list[tuple[str, str]] = field(default_factory=list)
    body: bytes = b""
    raw: bytes | None = None
    came: tuple[bytes, ...] = ()

    @property
    def path(self) -> str:
        """The target without its query."""
        return self.target.partition("?")[0]

    @property
    def query(self) -> str:
        """What follows the question mark."""
        return self.target.partition("?")[2]

    def copy(self, **changes: Any) -> Request:
        """A copy with other parts; its fields can be altered without altering ours."""
        return replace(self, **{"fields": list(self.fields), **changes})

    def octets(self) -> bytes:
        """Its octets, with a Content-Length that fits unless several contradict each other."""
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
    """A response.

    Attributes:
        raw: octets to send in its place, after which the connection is closed.
        method: of its request.
    """

    status: int
    fields: list[tuple[str, str]] = field(default_factory=list)
    body: bytes = b""
    version: str = "HTTP/1.1"
    reason: str = ""
    raw: bytes | None = None
    method: str = "GET"

    def copy(self) -> Response:
        """A copy whose fields can be altered without altering ours."""
        return replace(self, fields=list(self.fields))

    def octets(self) -> bytes:
        """Its octets, with a Content-Length that fits."""
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
    """The connection is closed without a response."""


class Change(Protocol):
    """What a proxy does to exchanges; one instance for one run, so it may remember."""

    def __call__(self, request: Request, forward: Forward) -> Response:
        """Respond to a request; ``forward`` asks the robot, as often as one likes.

        Raises:
            HangUpError: there is to be no response.
        """


class IncompleteRequest(Protocol):
    """What a mutant does with a request that was never completed."""

    def __call__(self, side: str, octets: bytes, forward: Forward) -> None:
        """Take what had come when the client went away."""


def unchanged(request: Request, forward: Forward) -> Response:
    """The change that changes nothing."""
    return forward(request)
