"""The two connections of a proxy: from a client and to the device."""

import select
import socket
import time

import h11

from proof.mutation.messages import Request, Response
from proof.mutation.parsing import RequestParser, ResponseParser

_WAIT_S = 30.0
_PIECE = 262_144
# A body longer than this may be refused before all of it has been sent.
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
