"""A reverse proxy that turns a robot into a mutant by changing its messages, over REST and SOAP on two ports."""

import contextlib
import re
import socket
import ssl
import threading
import traceback
from dataclasses import dataclass, replace
from typing import Final
from urllib.parse import urlsplit

from proof.mutation.messages import Change, Forward, HangUpError, IncompleteRequest, Request, Response, unchanged
from proof.mutation.wire import ClientConnection, IncompleteMessageError, RobotConnection
from proof.selftest.robots import Robot

_ORIGIN: Final = re.compile(r"^https?://[^/?]*(?=[/?])", re.IGNORECASE)
_IDLE_S = 60.0


@dataclass(frozen=True)
class Addresses:
    """The addresses of a robot and of the proxy in front of it, as origins by interface ("rest", "soap").

    Attributes:
        robot: the robot's origins, such as ``http://127.0.0.1:8080``.
        proxy: the proxy's origins, which clients use.
        prefix: path before every REST path at the proxy, such as "/r2d2/api", or empty.
    """

    robot: dict[str, str]
    proxy: dict[str, str]
    prefix: str = ""

    def public(self, side: str) -> str:
        """Return the base URL of an interface at the proxy, as clients use it."""
        return self.proxy[side] + (self.prefix if side == "rest" else "")

    def inward(self, request: Request) -> Request | None:
        """Return a client's request with the robot's own address in it, or None for a path that is not the robot's."""
        if request.side != "rest" or not self.prefix or request.raw is not None:
            return request
        # A target in absolute form (RFC 9112 3.2.2) reaches the robot in origin form.
        target = _ORIGIN.sub("", request.target)
        if not target.startswith(self.prefix):
            return None
        return request.copy(target=target.removeprefix(self.prefix) or "/")

    def outward(self, response: Response) -> Response:
        """Replace the robot's address with the proxy's in a response, in place, and return the response."""
        for side, robot in self.robot.items():
            here = self.public(side)
            # A robot may use the Host header, which names the proxy, and cannot know that the proxy uses TLS.
            asked = self.proxy[side]
            for there in (robot, asked.replace("https:", "http:")) if asked.startswith("https:") else (robot,):
                response.body = response.body.replace(there.encode(), here.encode())
                response.fields = [(name, value.replace(there, here)) for name, value in response.fields]
        location = response.field("Location")
        if self.prefix and location is not None and location.startswith("/"):
            response.put("Location", self.prefix + location)
        return response


class Proxy:
    """A reverse proxy in front of a robot.

    Args:
        rest: the robot's REST base URL.
        soap: URL of one of the robot's SOAP services; empty if there is none.
        host: address to listen on.
        tls: context to serve TLS with, or None.
        prefix: path before every REST path, such as "/r2d2/api".

    Attributes:
        change: the change applied to every exchange; may be replaced at any time.
        incomplete_request: the response to a request that the client never completes.
        serial: whether the proxy reads a request only after it has sent the response to the one before.
        backwards: whether the proxy sends the responses to two pipelined requests in the wrong order.
        forgetful: whether the proxy responds only to the first of several pipelined requests.
        requests: number of requests received.
        broken: unexpected exception of a change: the mutant has a defect, not the robot.
    """

    def __init__(
        self, rest: str, soap: str = "", *, host: str = "127.0.0.1", tls: ssl.SSLContext | None = None, prefix: str = ""
    ) -> None:
        self.change: Change = unchanged
        self.incomplete_request: IncompleteRequest | None = None
        self.serial = False
        self.backwards = False
        self.forgetful = False
        self.requests = 0
        self.broken: list[str] = []
        self._tls = tls
        robot = {side: urlsplit(url) for side, url in (("rest", rest), ("soap", soap)) if url}
        self._robot = {side: (url.hostname or "127.0.0.1", url.port or 80) for side, url in robot.items()}
        self._listeners = {side: _listen(host) for side in robot}
        scheme, name = "https" if tls else "http", f"[{host}]" if ":" in host else host
        self._addresses = Addresses(
            {side: f"{url.scheme}://{url.netloc}" for side, url in robot.items()},
            {side: f"{scheme}://{name}:{sock.getsockname()[1]}" for side, sock in self._listeners.items()},
            prefix,
        )
        self._closed = False
        self._reading = threading.Lock()
        self._open: set[socket.socket] = set()
        for side, listener in self._listeners.items():
            threading.Thread(target=self._accept, args=(side, listener), daemon=True).start()

    @property
    def rest(self) -> str:
        """Return the REST base URL at the proxy."""
        return self._addresses.public("rest")

    def wsdl(self, url: str) -> str:
        """Return the proxy's URL of one of the robot's WSDLs; empty where the given URL is empty."""
        where = urlsplit(url)
        return f"{self._addresses.public('soap')}{where.path}?{where.query}" if url else ""

    def before(self, robot: Robot) -> Robot:
        """Return the robot with the proxy's addresses, as its clients reach it."""
        publishers, subscribers = self.wsdl(robot.publishers), self.wsdl(robot.subscribers)
        base = urlsplit(robot.rest).path.rstrip("/")
        return replace(robot, rest=self.rest + base, publishers=publishers, subscribers=subscribers)

    @property
    def listens(self) -> dict[str, tuple[str, int]]:
        """Return host and port of each side."""
        return {side: sock.getsockname()[:2] for side, sock in self._listeners.items()}

    def seen_at(self, **origins: str) -> None:
        """Set the origins by which clients reach the proxy where they are not the addresses it listens on."""
        self._addresses = replace(self._addresses, proxy=origins)

    def close(self) -> None:
        """Stop listening and close every connection."""
        self._closed = True
        for sock in [*self._listeners.values(), *self._open]:
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
        """Serve one connection until it closes."""
        robot = RobotConnection(*self._robot[side])
        owner = threading.get_ident()

        def forward(request: Request) -> Response:
            if request.side == side and threading.get_ident() == owner:
                return self._forward(request, robot)
            # A connection of its own, for the other interface or another thread: its bytes must not mix with this
            # connection's.
            with contextlib.closing(RobotConnection(*self._robot[request.side])) as another:
                return self._forward(request, another)

        try:
            sock.settimeout(_IDLE_S)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if self._tls is not None:
                sock = self._tls.wrap_socket(sock, server_side=True)
            beside, nth = bool(self._open), 0
            self._open.add(sock)
            client = ClientConnection(sock, side)
            while (request := self._next(side, client, forward)) is not None:
                together = [request]
                if self.backwards and client.has_more and (second := self._next(side, client, forward)) is not None:
                    together.insert(0, second)
                while self.forgetful and client.has_more and self._next(side, client, forward) is not None:
                    pass
                last = False
                for item in together:
                    self.requests += 1
                    nth += 1
                    item.nth, item.beside = nth, beside
                    response = self._change(item, forward)
                    last = last or item.is_last or response.is_last
                    client.respond(response, last=last and item is together[-1])
                if last:
                    break
        except (OSError, IncompleteMessageError, HangUpError):
            # The connection is broken, so no response can be sent.
            pass
        finally:
            robot.close()
            self._open.discard(sock)
            sock.close()

    def _next(self, side: str, client: ClientConnection, forward: Forward) -> Request | None:
        try:
            if not self.serial or side != "rest":
                return client.request()
            if not client.wait():
                return None
            with self._reading:
                return client.request()
        except IncompleteMessageError as incomplete:
            if self.incomplete_request is not None:
                self.incomplete_request(side, incomplete.octets, forward)
            return None

    def _change(self, request: Request, forward: Forward) -> Response:
        try:
            return self.change(request, forward)
        except (OSError, IncompleteMessageError, HangUpError):
            raise
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            self.broken.append(f"{type(error).__name__}: {error} ({where.filename.rsplit('/', 1)[-1]}:{where.lineno})")
            raise HangUpError from error

    def _forward(self, request: Request, robot: RobotConnection) -> Response:
        inward = self._addresses.inward(request)
        if inward is None:
            problem = [("Content-Type", "application/problem+json")]
            return Response(404, problem, b'{"status":404,"detail":"nothing is here"}', method=request.method)
        return self._addresses.outward(robot.exchange(inward))


def _listen(host: str) -> socket.socket:
    sock = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    sock.bind((host, 0))
    sock.listen(128)
    return sock
