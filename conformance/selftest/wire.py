"""HTTP messages as octets: read leniently, kept as they came, so that a proxy can hand on or alter any of it."""

from __future__ import annotations

import re
import select
import socket
from dataclasses import dataclass, field, replace
from http import HTTPStatus

_MOST_HEAD = 1024 * 1024
_LINE = re.compile(rb"[!-~]+ \S+ HTTP/\d\.\d")
_NO_BODY = {204, 304}
_WAIT_S = 30.0


class IncompleteMessageError(Exception):
    """A connection ended in the middle of a message; ``got`` is what had come."""

    def __init__(self, got: bytes) -> None:
        super().__init__(f"{len(got)} octets, and no more")
        self.got = got


class _Fields:
    """What requests and answers share: header fields in their order."""

    fields: list[tuple[str, str]]

    def field(self, name: str) -> str | None:
        """The first value of a field, whatever its case."""
        return next((value for key, value in self.fields if key.lower() == name.lower()), None)

    def drop(self, name: str) -> None:
        """Remove a field."""
        self.fields = [(key, value) for key, value in self.fields if key.lower() != name.lower()]

    def put(self, name: str, value: str) -> None:
        """Set a field, once."""
        self.drop(name)
        self.fields.append((name, value))

    @property
    def media_type(self) -> str:
        """The media type of the body, without parameters; empty where none is said."""
        return (self.field("Content-Type") or "").partition(";")[0].strip().lower()


@dataclass
class Request(_Fields):
    """A request.

    Attributes:
        side: "rest" or "soap", by the port that it came to.
        raw: its octets, where it was no HTTP that could be read; then the rest is empty.
    """

    side: str
    method: str = ""
    target: str = ""
    version: str = "HTTP/1.1"
    fields: list[tuple[str, str]] = field(default_factory=list)
    body: bytes = b""
    raw: bytes | None = None

    @property
    def path(self) -> str:
        """The target without its query."""
        return self.target.partition("?")[0]

    @property
    def query(self) -> str:
        """What follows the question mark."""
        return self.target.partition("?")[2]

    def copy(self, **changes: object) -> Request:
        """A copy with other parts; its fields can be altered without altering ours."""
        return replace(self, **{"fields": list(self.fields), **changes})  # type: ignore[arg-type] # fields by name

    def wire(self) -> bytes:
        """Its octets, with a Content-Length that fits unless several contradict each other."""
        if self.raw is not None:
            return self.raw
        lengths = [value for key, value in self.fields if key.lower() == "content-length"]
        chunked = "chunked" in (self.field("Transfer-Encoding") or "").lower()
        if len(lengths) <= 1 and not chunked and (self.body or lengths):
            self.put("Content-Length", str(len(self.body)))
        head = [f"{self.method} {self.target} {self.version}", *(f"{key}: {value}" for key, value in self.fields)]
        body = b"%x\r\n%b\r\n0\r\n\r\n" % (len(self.body), self.body) if chunked and self.body else self.body
        if chunked and not self.body:
            body = b"0\r\n\r\n"
        return "\r\n".join([*head, "", ""]).encode("latin-1") + body


@dataclass
class Response(_Fields):
    """A response.

    Attributes:
        raw: octets to send in its place, after which the connection is closed.
        asked: the method that was asked with.
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

    def wire(self) -> bytes:
        """Its octets, with a Content-Length that fits."""
        if self.raw is not None:
            return self.raw
        self.drop("Transfer-Encoding")
        if self.status in _NO_BODY or 100 <= self.status < 200:  # noqa: PLR2004 - informational
            self.drop("Content-Length")
            self.body = b""
        elif self.method != "HEAD":
            self.put("Content-Length", str(len(self.body)))
        reason = self.reason or (HTTPStatus(self.status).phrase if self.status in set(HTTPStatus) else "Unknown")
        lines = [f"{self.version} {self.status} {reason}", *(f"{key}: {value}" for key, value in self.fields), "", ""]
        return "\r\n".join(lines).encode("latin-1", "replace") + (b"" if self.method == "HEAD" else self.body)


class Stream:
    """A socket that is read message by message."""

    def __init__(self, sock: socket.socket) -> None:
        self.sock = sock
        self._buffer = b""

    def more(self) -> bool:
        """Read what comes. Returns whether anything came."""
        try:
            data = self.sock.recv(262_144)
        except ConnectionResetError:
            data = b""
        self._buffer += data
        return bool(data)

    def request(self, side: str) -> Request | None:
        """The next request, or None at the end of the connection.

        Raises:
            TornError: the client went away in the middle of it.
            OSError: the connection broke.
        """
        head = self._head(requests=True)
        if head is None:
            return None
        line, *rest = head.split(b"\r\n")
        if not _LINE.fullmatch(line):
            return Request(side, raw=head + b"\r\n\r\n" + self._all())
        method, target, version = line.decode("latin-1").split(" ")
        request = Request(side, method, target, version, _fields(rest))
        lengths = {value for key, value in request.fields if key.lower() == "content-length"}
        # Where a message ends is not clear: the robot is to say so, and at once.
        unclear = len(lengths) > 1 or not all(length.isdigit() for length in lengths)
        if len(request.fields) < len([one for one in rest if one]) or unclear:
            return Request(side, raw=head + b"\r\n\r\n" + self._all())
        if (request.field("Expect") or "").lower() == "100-continue":
            self.sock.sendall(b"HTTP/1.1 100 Continue\r\n\r\n")
            request.drop("Expect")
        request.body = self._body(request, None)
        return request

    def response(self, method: str) -> Response:
        """The next answer; informational ones are passed over.

        Raises:
            TornError: the server went away before or in the middle of it.
            OSError: the connection broke.
        """
        while True:
            head = self._head(requests=False)
            if head is None:
                raise IncompleteMessageError(b"")
            line, *rest = head.split(b"\r\n")
            version, status, reason = (*line.decode("latin-1").split(" ", 2), "", "")[:3]
            response = Response(int(status), _fields(rest), b"", version, reason, method=method)
            if not 100 <= response.status < 200:  # noqa: PLR2004 - informational
                break
        if method != "HEAD" and response.status not in _NO_BODY:
            response.body = self._body(response, -1)
        return response

    def _head(self, *, requests: bool) -> bytes | None:
        while b"\r\n\r\n" not in self._buffer:
            self._buffer = self._buffer.lstrip(b"\r\n") if requests else self._buffer
            line, ended, _ = self._buffer.partition(b"\r\n")
            # A line that is no request is answered at once by most servers: nothing more need come.
            if requests and ended and not _LINE.fullmatch(line):
                return self._all().removesuffix(b"\r\n")
            if len(self._buffer) > _MOST_HEAD or not self.more():
                if not self._buffer:
                    return None
                raise IncompleteMessageError(self._buffer)
        head, _, self._buffer = self._buffer.partition(b"\r\n\r\n")
        return head

    def _all(self) -> bytes:
        data, self._buffer = self._buffer, b""
        return data

    def _body(self, message: Request | Response, unsaid: int | None) -> bytes:
        """A body; where its length is ``unsaid`` there is none (None), or it ends with the connection (-1)."""
        if "chunked" in (message.field("Transfer-Encoding") or "").lower():
            return self._chunks()
        length = message.field("Content-Length")
        if length is None or not length.isdigit():
            if unsaid is None or length is not None:
                return b""
            while self.more():
                pass
            return self._all()
        return self._take(int(length))

    def _take(self, size: int) -> bytes:
        if len(self._buffer) < size:
            parts, got = [self._all()], 0
            got = len(parts[0])
            while got < size:
                if not self.more():
                    raise IncompleteMessageError(b"".join(parts))
                parts.append(self._all())
                got += len(parts[-1])
            self._buffer = b"".join(parts)
        taken, self._buffer = self._buffer[:size], self._buffer[size:]
        return taken

    def _chunks(self) -> bytes:
        parts: list[bytes] = []
        while True:
            while b"\r\n" not in self._buffer:
                if not self.more():
                    raise IncompleteMessageError(b"".join(parts))
            line, _, self._buffer = self._buffer.partition(b"\r\n")
            size = int(line.partition(b";")[0] or b"0", 16)
            chunk = self._take(size + 2)[:size] if size else b""
            if not size:
                self._take(2)
                return b"".join(parts)
            parts.append(chunk)


def _fields(lines: list[bytes]) -> list[tuple[str, str]]:
    found = []
    for line in lines:
        name, colon, value = line.decode("latin-1").partition(":")
        if colon and name and name == name.strip():
            found.append((name, value.strip(" \t")))
    return found


class Upstream:
    """One connection to the robot, opened again when it was closed."""

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._stream: Stream | None = None

    def exchange(self, request: Request) -> Response:
        """Send a request and wait for its answer.

        Raises:
            TornError, OSError: there is none.
        """
        used = self._stream is not None
        try:
            return self._once(request)
        except (IncompleteMessageError, OSError):
            self.close()
            if not used:
                raise
        # The robot closed a connection that was kept: that answered no request.
        return self._once(request)

    def _once(self, request: Request) -> Response:
        if self._stream is None:
            self._stream = Stream(socket.create_connection(self._address, timeout=_WAIT_S))
            self._stream.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._send(self._stream.sock, request.wire())
        response = self._stream.response(request.method)
        closes = "close" in (response.field("Connection") or "").lower() or "close" in (
            request.field("Connection") or ""
        )
        if closes or response.version == "HTTP/1.0" or request.raw is not None or request.version == "HTTP/1.0":
            self.close()
        return response

    def _send(self, sock: socket.socket, data: bytes) -> None:
        """Send until all is sent, or the robot answers before that, or it closes."""
        view = memoryview(data)
        while view:
            readable, writable, _ = select.select([sock], [sock], [], _WAIT_S)
            if readable and len(data) > 65536:  # noqa: PLR2004 - an answer in the middle of a large body
                return
            if not writable:
                raise TimeoutError("the robot takes no more")
            try:
                view = view[sock.send(view[:262_144]) :]
            except (BrokenPipeError, ConnectionResetError):
                return

    def close(self) -> None:
        """Close the connection."""
        if self._stream is not None:
            self._stream.sock.close()
            self._stream = None
