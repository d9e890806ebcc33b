"""The two connections of a proxy, from a client and to the device, and the parsers of their messages."""

import re
import select
import socket
import time
from typing import Any

import h11

from proof.mutation.messages import Request, Response

_MOST_HEAD = 1024 * 1024
_REQUEST_LINE = re.compile(rb"[!-~]+ \S+ HTTP/\d\.\d")
# The framing of a response depends on HEAD or not (RFC 9112 6.3), and on nothing else in the request.
_ASKED = {method: h11.Request(method=method, target="/", headers=[("Host", "robot")]) for method in ("GET", "HEAD")}


class RequestParser:
    """A parser of one request.

    Attributes:
        rest: the bytes that followed the request.
    """

    def __init__(self, side: str) -> None:
        self.rest = b""
        self._side = side
        self._pieces: list[bytes] = []
        self._request: Request | None = None
        self._body: list[bytes] = []
        self._http = h11.Connection(h11.SERVER, max_incomplete_event_size=_MOST_HEAD)

    @property
    def octets(self) -> bytes:
        """All bytes received so far."""
        return b"".join(self._pieces)

    @property
    def waits_for_continue(self) -> bool:
        """Whether the client waits for 100 (Continue) before it sends the body (RFC 9110 10.1.1)."""
        return self._http.they_are_waiting_for_100_continue

    def feed(self, data: bytes) -> Request | None:
        """Parse more bytes; return the request once it is complete or known not to be HTTP, otherwise None."""
        if not self._pieces:
            # Empty lines before a request do not belong to it (RFC 9112 2.2).
            data = data.lstrip(b"\r\n")
        if data:
            self._pieces.append(data)
        try:
            self._http.receive_data(data)
            while (event := self._http.next_event()) is not h11.NEED_DATA:
                if isinstance(event, h11.EndOfMessage) and self._request is not None:
                    self._request.body = b"".join(self._body)
                    self._request.came = tuple(self._pieces)
                    self.rest = self._http.trailing_data[0]
                    return self._request
                self._take(event)
        except h11.RemoteProtocolError:
            return Request(self._side, raw=self.octets)
        if self._request is None:
            line, ended, _ = self.octets.partition(b"\r\n")
            # Most servers answer a line that is no request at once, so nothing more needs to come.
            if ended and not _REQUEST_LINE.fullmatch(line):
                return Request(self._side, raw=self.octets)
        return None

    def _take(self, event: Any) -> None:
        if isinstance(event, h11.Request):
            version = f"HTTP/{event.http_version.decode()}"
            self._request = Request(self._side, event.method.decode(), event.target.decode(), version, _fields(event))
            if self.waits_for_continue:
                self._request.drop("Expect")
        elif isinstance(event, h11.Data):
            self._body.append(bytes(event.data))


class ResponseParser:
    """A parser of one response, which skips informational (1xx) responses before it.

    Args:
        method: the request's method; empty if the request was not HTTP.
    """

    def __init__(self, method: str) -> None:
        self._method = method
        self._response: Response | None = None
        self._body: list[bytes] = []
        self._http = h11.Connection(h11.CLIENT, max_incomplete_event_size=_MOST_HEAD)
        self._http.send(_ASKED["HEAD" if method == "HEAD" else "GET"])
        self._http.send(h11.EndOfMessage())

    def feed(self, data: bytes) -> Response | None:
        """Parse more bytes (empty: the connection ended); return the response once it is complete, otherwise None.

        Raises:
            h11.RemoteProtocolError: the bytes are not HTTP, or end too early.
        """
        self._http.receive_data(data)
        while (event := self._http.next_event()) is not h11.NEED_DATA:
            if isinstance(event, h11.EndOfMessage) and self._response is not None:
                self._response.body = b"".join(self._body)
                return self._response
            if isinstance(event, h11.Response):
                reason = event.reason.decode("latin-1")
                version = f"HTTP/{event.http_version.decode()}"
                self._response = Response(event.status_code, _fields(event), b"", version, reason, method=self._method)
            elif isinstance(event, h11.Data):
                self._body.append(bytes(event.data))
            elif isinstance(event, h11.ConnectionClosed):
                raise h11.RemoteProtocolError("the connection ended before a response")
        return None


def _fields(event: h11.Request | h11.Response) -> list[tuple[str, str]]:
    """Return the headers of an h11 event with the case of their names as received."""
    return [(name.decode(), value.decode("latin-1")) for name, value in event.headers.raw_items()]


_WAIT_S = 30.0
_PIECE = 262_144
# A robot may refuse a body longer than this before the client has sent all of it.
_LARGE = 65_536
_CONTINUE = b"HTTP/1.1 100 Continue\r\n\r\n"


class IncompleteMessageError(Exception):
    """Raised when a connection ends in the middle of a message; ``octets`` are the bytes received of it."""

    def __init__(self, octets: bytes = b"") -> None:
        super().__init__(f"{len(octets)} octets, and no more")
        self.octets = octets


class ClientConnection:
    """A connection from a client, which yields its requests one by one."""

    def __init__(self, sock: socket.socket, side: str) -> None:
        self._sock, self._side = sock, side
        self._waiting = b""

    @property
    def has_more(self) -> bool:
        """Whether bytes of the next request have already been received."""
        return bool(self._waiting)

    def wait(self) -> bool:
        """Wait for bytes of the next request; return False if the connection ended."""
        self._waiting = self._waiting or _receive(self._sock)
        return bool(self._waiting)

    def request(self) -> Request | None:
        """Return the next request, or None at the end of the connection.

        Raises:
            IncompleteMessageError: the client disconnected in the middle of it.
            OSError: the connection broke.
        """
        parser = RequestParser(self._side)
        continued = False
        while self.wait():
            data, self._waiting = self._waiting, b""
            request = parser.feed(data)
            if request is not None:
                self._waiting = parser.rest
                return request
            if parser.waits_for_continue and not continued:
                continued = True
                self._sock.sendall(_CONTINUE)
        if parser.octets:
            raise IncompleteMessageError(parser.octets)
        return None

    def respond(self, response: Response, *, last: bool) -> None:
        """Send a response; after the ``last`` one, wait until the client has read it before closing."""
        self._sock.sendall(response.octets())
        if last:
            _linger(self._sock)


class RobotConnection:
    """A connection to the device, which is opened again after it was closed."""

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._sock: socket.socket | None = None

    def exchange(self, request: Request) -> Response:
        """Send a request and return its response.

        Raises:
            IncompleteMessageError: the connection ended in the middle of the response.
            OSError: the connection broke.
        """
        if self._sock is not None:
            try:
                return self._once(self._sock, request)
            except (IncompleteMessageError, OSError):
                # The robot closed a kept connection, which is no response to this request.
                self.close()
        self._sock = socket.create_connection(self._address, timeout=_WAIT_S)
        self._sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            return self._once(self._sock, request)
        except (IncompleteMessageError, OSError):
            self.close()
            raise

    def _once(self, sock: socket.socket, request: Request) -> Response:
        _send(sock, request.octets())
        parser = ResponseParser(request.method)
        response = None
        while response is None:
            try:
                response = parser.feed(_receive(sock))
            except h11.RemoteProtocolError as error:
                raise IncompleteMessageError from error
        if request.is_last or response.is_last:
            self.close()
        return response

    def close(self) -> None:
        """Close the connection."""
        if self._sock is not None:
            self._sock.close()
            self._sock = None


def _receive(sock: socket.socket) -> bytes:
    """Return the next bytes, empty at the end of the connection."""
    try:
        return sock.recv(_PIECE)
    except ConnectionResetError:
        return b""


def _send(sock: socket.socket, data: bytes) -> None:
    """Send all bytes; stop early if the device responds in the middle of a large body or closes the connection."""
    left = memoryview(data)
    try:
        if len(data) <= _LARGE:
            sock.sendall(left)
            return
        while left:
            readable, writable, _ = select.select([sock], [sock], [], _WAIT_S)
            if readable:
                return
            if not writable:
                raise TimeoutError("the robot takes no more")
            left = left[sock.send(left[:_PIECE]) :]
    except (BrokenPipeError, ConnectionResetError):
        return


def _linger(sock: socket.socket) -> None:
    """Give the client time to read the response before the connection is reset."""
    try:
        sock.shutdown(socket.SHUT_WR)
        sock.settimeout(0.2)
        until = time.monotonic() + 0.5
        while time.monotonic() < until and sock.recv(_PIECE):
            pass
    except OSError:
        pass
