"""HTTP/1.1 connections to a robot, which are used again while they are idle.

They send what they are given: target, fields and their order. h11 parses the answers, strictly, which makes it the
judge of framing as well. What clients that do more cost instead: docs/design.md.
"""

from __future__ import annotations

import select
import socket
import ssl
import time
from typing import TYPE_CHECKING, Final

import h11

from conformance.transport.exchange import IDEMPOTENT_METHODS, Response

if TYPE_CHECKING:
    from pathlib import Path

    from conformance.transport.deadline import Deadline

# An answer longer than this is no answer to any request of the contract, octets; nor is a longer header section.
_MAX_ANSWER: Final = 32 * 1024 * 1024
_MAX_HEAD: Final = 100 * 1024
# Octets that are handed to the network, and taken from it, at once.
_PIECE: Final = 256 * 1024
_READ: Final = 64 * 1024
# Idle connections that are kept, and for how long, s: servers close them after five at the earliest.
_KEPT: Final = 2
_EXPIRY_S: Final = 3.0
_SWITCHING_PROTOCOLS: Final = 101
# A reset follows the data that nobody reads within this time on a network nearby, ms.
_RESET_MS: Final = 50
_QUICKACK: Final = getattr(socket, "TCP_QUICKACK", None)  # Linux alone has it


class NoConnectionError(OSError):
    """No connection can be had; the message says why."""


class ClosedError(Exception):
    """The server closed the connection before any answer was whole enough to be one."""


def tls_context(ca_file: Path | None) -> ssl.SSLContext:
    """A context that trusts the system's authorities, or only those in ``ca_file``.

    Raises:
        OSError: the file cannot be read, or (ssl.SSLError) holds no certificate.
    """
    context = ssl.create_default_context(cafile=str(ca_file) if ca_file else None)
    context.set_alpn_protocols(["http/1.1"])
    return context


def open_link(host: str, port: int, tls: ssl.SSLContext | None, within_s: float) -> socket.socket:
    """A socket to a server, with TLS where there is a context for it.

    Raises:
        TimeoutError: it takes longer than it may.
        NoConnectionError: there is none.
    """
    try:
        link = socket.create_connection((host, port), within_s)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return link if tls is None else tls.wrap_socket(link, server_hostname=host)
    except TimeoutError:
        raise
    except OSError as error:
        raise NoConnectionError(str(error)) from error


class HttpConnection:
    """One connection, which is opened by the first exchange on it.

    Attributes:
        is_open: whether it has been opened, and not closed since.
        is_idle: whether an exchange has ended on it that another one can follow.
        last_status: of the last response on it; 0 before the first.
    """

    def __init__(self, host: str, port: int, tls: ssl.SSLContext | None) -> None:
        self._server = host, port, tls
        self._link: socket.socket | None = None
        self._state = h11.Connection(h11.CLIENT, max_incomplete_event_size=_MAX_HEAD)
        self._idle_since = 0.0
        self._begun = False
        self._was_reset = False
        self.is_idle = False
        self.last_status = 0

    @property
    def is_open(self) -> bool:
        """See the class."""
        return self._link is not None

    def exchange(self, request: h11.Request, content: bytes, deadline: Deadline) -> Response:
        """Send a request, and read its whole answer.

        Raises:
            TimeoutError: the deadline passed.
            NoConnectionError: there is no connection.
            ClosedError: the server ended it without an answer.
            h11.RemoteProtocolError: what came is no HTTP, or too much.
            OSError: the connection broke.
        """
        started, self.is_idle, self._begun = time.perf_counter(), False, False
        if self._link is None:
            self._link = open_link(*self._server, deadline.to_send_s())
        self._send(self._link, request, content, deadline)
        head = self._head(self._link, deadline)
        body = self._body(self._link, deadline)
        response = Response(
            head.status_code,
            tuple((name.decode("latin-1"), value.decode("latin-1")) for name, value in head.headers.raw_items()),
            body,
            (time.perf_counter() - started) * 1000,
            f"HTTP/{head.http_version.decode('latin-1')}",
            time.monotonic(),
        )
        if self._state.our_state is h11.DONE and self._state.their_state is h11.DONE:
            self._state.start_next_cycle()
            self.is_idle, self._idle_since = True, time.monotonic()
        self.last_status = response.status
        return response

    def ended_before(self, method: str) -> bool:
        """Return whether the server ended the kept connection before a request on it, so that it may be sent again.

        A request that is not idempotent counts only where the network says that nobody has read it (RFC 9110 9.2.2).
        """
        kept = self.last_status > 0 and not self._begun
        return kept and (method in IDEMPOTENT_METHODS or self._was_reset)

    def _send(self, link: socket.socket, request: h11.Request, content: bytes, deadline: Deadline) -> None:
        """Head and content leave as one segment where they are short: a robot is woken once."""
        state = self._state
        octets = state.send(request) or b""
        if content:
            octets += state.send(h11.Data(data=content)) or b""
        octets += state.send(h11.EndOfMessage()) or b""
        sent = 0
        try:
            while sent < len(octets):
                link.settimeout(deadline.to_send_s())
                sent += link.send(octets[sent : sent + _PIECE])
        except TimeoutError:
            raise
        except OSError:
            return  # a server that does not take a whole request may have answered it all the same
        deadline.sent()

    def _head(self, link: socket.socket, deadline: Deadline) -> h11.Response | h11.InformationalResponse:
        """The answer's head; interim answers come before the real one (RFC 9110 15.2)."""
        while True:
            event = self._event(link, deadline)
            if isinstance(event, h11.Response):
                return event
            if isinstance(event, h11.InformationalResponse) and event.status_code == _SWITCHING_PROTOCOLS:
                return event

    def _body(self, link: socket.socket, deadline: Deadline) -> bytes:
        pieces: list[bytes] = []
        size = 0
        while isinstance(event := self._event(link, deadline), h11.Data):
            size += len(event.data)
            if size > _MAX_ANSWER:
                raise h11.RemoteProtocolError(f"an answer of more than {_MAX_ANSWER} octets")
            pieces.append(bytes(event.data))
        return b"".join(pieces)

    def _event(self, link: socket.socket, deadline: Deadline) -> h11.Event | type[h11.NEED_DATA | h11.PAUSED]:
        while (event := self._state.next_event()) is h11.NEED_DATA:
            link.settimeout(deadline.left_s())
            if self._begun and _QUICKACK is not None:
                # Many a server keeps the rest back until its first piece is acknowledged: a kernel takes 40 ms.
                link.setsockopt(socket.IPPROTO_TCP, _QUICKACK, 1)
            try:
                octets = link.recv(_READ)
            except ConnectionError:
                self._was_reset = not self._begun
                raise
            self._begun = self._begun or bool(octets)
            if not octets and self._state.their_state is h11.SEND_RESPONSE:
                self._was_reset = not self._begun and _is_reset(link)
                raise ClosedError
            deadline.came(len(octets))
            self._state.receive_data(octets)
        return event

    @property
    def has_expired(self) -> bool:
        """Whether an idle one has been idle for too long, or something has come on it since: its end, mostly."""
        late = time.monotonic() > self._idle_since + _EXPIRY_S
        return late or self._link is None or _is_readable(self._link)

    def close(self) -> None:
        """Close it, if it is open."""
        self.is_idle = False
        if self._link is not None:
            self._link.close()
            self._link = None


def _is_reset(link: socket.socket) -> bool:
    """Return whether a peer that has closed a connection also reset it, as it does on data that nobody reads."""
    if not hasattr(select, "poll"):  # Windows
        return False
    poll = select.poll()
    poll.register(link, 0)  # errors are reported without being asked for
    return any(event & select.POLLERR for _, event in poll.poll(_RESET_MS))


def _is_readable(link: socket.socket) -> bool:
    if not hasattr(select, "poll"):  # Windows, where select takes any socket
        return bool(select.select([link], [], [], 0)[0])
    poll = select.poll()
    poll.register(link, select.POLLIN)
    return bool(poll.poll(0))


class Connections:
    """The connections of one client to its server: one that is idle is used again, else another one is opened."""

    def __init__(self, host: str, port: int, tls: ssl.SSLContext | None) -> None:
        self._server = host, port, tls
        self._idle: list[HttpConnection] = []

    def new(self) -> HttpConnection:
        """One of its own."""
        return HttpConnection(*self._server)

    def take(self) -> HttpConnection:
        """An idle one that the server has not closed, else a new one; nobody else gets it meanwhile."""
        while self._idle:
            connection = self._idle.pop()
            if not connection.has_expired:
                return connection
            connection.close()
        return self.new()

    def give_back(self, connection: HttpConnection, *, keep: bool = True) -> None:
        """The exchange is over: keep its connection, where another one can follow on it."""
        if keep and connection.is_idle and len(self._idle) < _KEPT:
            self._idle.append(connection)
        else:
            connection.close()

    def close(self) -> None:
        """Close those that are idle."""
        while self._idle:
            self._idle.pop().close()
