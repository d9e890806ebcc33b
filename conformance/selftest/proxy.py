"""A reverse proxy that makes a robot faulty: REST and SOAP, each on a port of its own, with one change in between."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
import traceback
from typing import TYPE_CHECKING, Protocol
from urllib.parse import urlsplit

from conformance.selftest.wire import IncompleteMessageError, Request, Response, Stream, Upstream

if TYPE_CHECKING:
    import ssl
    from collections.abc import Callable

Forward = "Callable[[Request], Response]"


class HangUpError(Exception):
    """The connection is closed without an answer."""


class Change(Protocol):
    """What a proxy does to exchanges; one instance for one run, so it may remember."""

    def __call__(self, request: Request, forward: Callable[[Request], Response]) -> Response:
        """Answer a request; ``forward`` asks the robot, as often as one likes.

        Raises:
            HangUpError: nothing is answered.
        """


class IncompleteRequest(Protocol):
    """What a mutant does with a request that was never completed."""

    def __call__(self, side: str, got: bytes, forward: Callable[[Request], Response]) -> None:
        """Take what had come when the client went away."""


def unchanged(request: Request, forward: Callable[[Request], Response]) -> Response:
    """The change that changes nothing."""
    return forward(request)


class Proxy:
    """Stands in front of a robot.

    Args:
        rest: the robot's REST base URL.
        soap: URL of one of the robot's SOAP services.
        host: where to listen.
        tls: context to serve TLS with, or None.
        prefix: path before everything on the REST side, as "/r2d2/api".

    Attributes:
        change: what is done to every exchange; may be exchanged at any time.
        incomplete_request: what is done with requests that are never completed.
        serial: whether a request is read only when the one before it has come to its end.
        requests: how many requests have come.
        broken: what a change raised that it should not have: then the mutant is wrong, not the robot.
    """

    def __init__(
        self, rest: str, soap: str, *, host: str = "127.0.0.1", tls: ssl.SSLContext | None = None, prefix: str = ""
    ) -> None:
        self.change: Change = unchanged
        self.incomplete_request: IncompleteRequest | None = None
        self.serial = False
        self.requests = 0
        self.broken: list[str] = []
        self._tls, self._prefix = tls, prefix
        self._robot = {side: urlsplit(url) for side, url in (("rest", rest), ("soap", soap))}
        self._sockets = {side: _listen(host) for side in self._robot}
        self._shown = f"[{host}]" if ":" in host else host
        self._closed = False
        self._reading = threading.Lock()
        self._open: set[socket.socket] = set()
        for side, sock in self._sockets.items():
            threading.Thread(target=self._accept, args=(side, sock), daemon=True).start()

    def _origin(self, side: str) -> str:
        scheme = "https" if self._tls else "http"
        return f"{scheme}://{self._shown}:{self._sockets[side].getsockname()[1]}"

    @property
    def rest(self) -> str:
        """REST's base URL at the proxy."""
        return self._origin("rest") + self._prefix

    def wsdl(self, service: str) -> str:
        """A WSDL's URL at the proxy: ``publisher`` or ``subscriber``."""
        return f"{self._origin('soap')}/turtlesim_{service}_ws?wsdl"

    def close(self) -> None:
        """Stop listening, and end every connection."""
        self._closed = True
        for sock in [*self._sockets.values(), *self._open]:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
            sock.close()

    def _accept(self, side: str, listener: socket.socket) -> None:
        while not self._closed:
            try:
                sock, _ = listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(side, sock), daemon=True).start()

    def _serve(self, side: str, sock: socket.socket) -> None:
        robot = self._robot[side]
        upstream = Upstream(robot.hostname or "127.0.0.1", robot.port or 80)
        self._open.add(sock)
        try:
            sock.settimeout(60)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if self._tls is not None:
                sock = self._tls.wrap_socket(sock, server_side=True)
            stream = Stream(sock)
            while self._one(side, stream, upstream):
                pass
        except (OSError, IncompleteMessageError, HangUpError, ValueError):
            # Whoever broke it off, there is nobody left to tell.
            pass
        finally:
            upstream.close()
            self._open.discard(sock)
            sock.close()

    def _one(self, side: str, stream: Stream, upstream: Upstream) -> bool:
        """One exchange. Returns whether the connection goes on."""
        owner = threading.get_ident()

        def forward(request: Request) -> Response:
            if request.side == side and threading.get_ident() == owner:
                return self._forward(request, upstream)
            # The other interface, or a thread of the change's own: neither may come between this connection's octets.
            robot = self._robot[request.side]
            another = Upstream(robot.hostname or "127.0.0.1", robot.port or 80)
            try:
                return self._forward(request, another)
            finally:
                another.close()

        try:
            request = self._next(side, stream)
        except IncompleteMessageError as incomplete:
            if self.incomplete_request is not None:
                self.incomplete_request(side, incomplete.got, forward)
            raise
        if request is None:
            return False
        self.requests += 1
        response = self._changed(request, forward)
        stream.sock.sendall(response.wire())
        closes = "close" in (response.field("Connection") or "").lower() or "close" in (
            request.field("Connection") or ""
        )
        if response.raw is not None or request.raw is not None or closes or response.version == "HTTP/1.0":
            _linger(stream.sock)
            return False
        return request.version != "HTTP/1.0"

    def _changed(self, request: Request, forward: Callable[[Request], Response]) -> Response:
        try:
            return self.change(request, forward)
        except (OSError, IncompleteMessageError, HangUpError):
            raise
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            self.broken.append(f"{type(error).__name__}: {error} ({where.filename.rsplit('/', 1)[-1]}:{where.lineno})")
            raise HangUpError from error

    def _next(self, side: str, stream: Stream) -> Request | None:
        if not self.serial or side != "rest":
            return stream.request(side)
        if not stream.more():
            return None
        with self._reading:
            return stream.request(side)

    def _forward(self, request: Request, upstream: Upstream) -> Response:
        robot = self._robot[request.side]
        if request.side == "rest" and self._prefix and request.raw is None:
            if not request.target.startswith(self._prefix):
                text = b'{"status":404,"detail":"nothing is here"}'
                return Response(404, [("Content-Type", "application/problem+json")], text, method=request.method)
            request = request.copy(target=request.target.removeprefix(self._prefix) or "/")
        response = upstream.exchange(request)
        for side, url in self._robot.items():
            # Addresses in descriptions and redirects lead to the proxy, never past it.
            here, there = self._origin(side) + (self._prefix if side == "rest" else ""), f"{url.scheme}://{url.netloc}"
            response.body = response.body.replace(there.encode(), here.encode())
            response.fields = [(name, value.replace(there, here)) for name, value in response.fields]
        location = response.field("Location")
        if location is not None and location.startswith("/") and robot.scheme and self._prefix:
            response.put("Location", self._prefix + location)
        return response


def _listen(host: str) -> socket.socket:
    sock = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    sock.bind((host, 0))
    sock.listen(128)
    return sock


def _linger(sock: socket.socket) -> None:
    """Let the client read the answer before the connection is reset over what it still sends."""
    try:
        sock.shutdown(socket.SHUT_WR)
        sock.settimeout(0.2)
        until = time.monotonic() + 0.5
        while time.monotonic() < until and sock.recv(262_144):
            pass
    except OSError:
        pass
