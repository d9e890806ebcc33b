"""Persistent HTTP/1.1 connections to a robot.

They send target, headers and their order exactly as given. h11 parses responses strictly, so it also checks their
framing. Why no common HTTP client is used: docs/design.md.
"""

from __future__ import annotations

import math
import select
import socket
import ssl
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import h11

from conformance.commandline.device_options import advice
from conformance.commandline.secrecy import SECRETS
from conformance.commandline.secret_file import read_secret
from conformance.transport.exchange import IDEMPOTENT_METHODS, Response
from conformance.transport.pace import time_for, time_to_arrive

# Octets of a response, and of its header section, that are read: no contract needs more.
_MAX_ANSWER: Final = 32 * 1024 * 1024
_MAX_HEAD: Final = 100 * 1024
# Octets on the wire for one response, with the sizes and extensions of its chunks; interim responses.
_MAX_WIRE: Final = 2 * _MAX_ANSWER
_MAX_INTERIM: Final = 100
# Octets that are written to the network, and read from it, at once.
_PIECE: Final = 256 * 1024
_READ: Final = 64 * 1024
# Idle connections that are kept, and for how long, s: servers close them after five at the earliest.
_KEPT: Final = 2
_EXPIRY_S: Final = 3.0
_SWITCHING_PROTOCOLS: Final = 101
# Media types of bodies that never end; octets and seconds of one that are read, and octets of any other body.
_STREAMS: Final = ("text/event-stream", "multipart/x-mixed-replace", "video/", "audio/")
_STREAM: Final = 64 * 1024
_STREAM_S: Final = 1.0
_DOWNLOAD: Final = 4 * 1024 * 1024
# Time in which a nearby server that does not read resets the connection, ms.
_RESET_MS: Final = 50
_QUICKACK: Final = getattr(socket, "TCP_QUICKACK", None)  # Linux alone has it


class NoConnectionError(OSError):
    """Raised when no connection can be opened; the message explains why."""


class ClosedError(Exception):
    """Raised when the server closes the connection before the response is complete."""


def open_link(host: str, port: int, tls: ssl.SSLContext | None, within_s: float) -> socket.socket:
    """Return a socket connected to a server, with TLS if a context is given.

    Raises:
        TimeoutError: connecting takes longer than ``within_s``.
        NoConnectionError: the connection is refused or fails.
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
    """One connection, opened by the first request on it.

    Args:
        host, port, tls: the server.
        number: the connection's number in the run.

    Attributes:
        number: as above.
        place: how many requests were sent on it.
        sent_s: when the last request was begun, s on the monotonic clock.
        first_s: when the first octet after it came; 0 if none has come.
        is_open: whether it is open.
        is_idle: whether the last response is complete and another request may follow.
        last_status: status of the last response; 0 before the first.
    """

    def __init__(self, host: str, port: int, tls: ssl.SSLContext | None, number: int = 0) -> None:
        self._server = host, port, tls
        self.number, self.place, self.sent_s, self.first_s = number, 0, 0.0, 0.0
        self._link: socket.socket | None = None
        self._state = h11.Connection(h11.CLIENT, max_incomplete_event_size=_MAX_HEAD)
        self._idle_since = 0.0
        self._begun = False
        self._octets = 0
        self._was_reset = False
        self.is_idle = False
        self.last_status = 0

    @property
    def is_open(self) -> bool:
        """Whether the connection is open."""
        return self._link is not None

    def exchange(self, request: h11.Request, content: bytes, deadline: Deadline, *, endless: bool = False) -> Response:
        """Send a request and return the complete response; with ``endless``, only the beginning of an endless body.

        Raises:
            TimeoutError: the deadline passed.
            NoConnectionError: the connection cannot be opened.
            ClosedError: the server closed it without a response.
            h11.RemoteProtocolError: the response is not HTTP, or too large.
            OSError: the connection broke.
        """
        started, self.is_idle, self._begun, self._octets = time.perf_counter(), False, False, 0
        self.place, self.sent_s, self.first_s = self.place + 1, time.monotonic(), 0.0
        if self._link is None:
            self._link = open_link(*self._server, deadline.to_send_s())
        self._send(self._link, request, content, deadline)
        head = self._head(self._link, deadline)
        body, cut = self._begin(self._link, head, deadline) if endless else (self._body(self._link, deadline), "")
        response = Response(
            head.status_code,
            tuple((name.decode("latin-1"), value.decode("latin-1")) for name, value in head.headers.raw_items()),
            body,
            (time.perf_counter() - started) * 1000,
            f"HTTP/{head.http_version.decode('latin-1')}",
            time.monotonic(),
            cut,
        )
        # Bytes after the response would be taken for the response to the next request.
        ends = self._state.our_state is h11.DONE and self._state.their_state is h11.DONE
        if ends and not self._state.trailing_data[0]:
            self._state.start_next_cycle()
            self.is_idle, self._idle_since = True, time.monotonic()
        self.last_status = response.status
        return response

    def ended_before(self, method: str, *, anything: bool = False) -> bool:
        """Return whether the server closed the kept connection before this request, which may then be sent again.

        For a method that is not idempotent, the network must show that no server read the request (RFC 9110 9.2.2),
        unless ``anything`` may be sent again.
        """
        kept = self.last_status > 0 and not self._begun
        return kept and (anything or method in IDEMPOTENT_METHODS or self._was_reset)

    def _send(self, link: socket.socket, request: h11.Request, content: bytes, deadline: Deadline) -> None:
        """Send head and body, in one segment if they are short."""
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
        deadline.note_sent()

    def _head(self, link: socket.socket, deadline: Deadline) -> h11.Response | h11.InformationalResponse:
        """Return the head of the final response or the next interim response (RFC 9110 15.2)."""
        for _ in range(_MAX_INTERIM + 1):
            event = self._event(link, deadline)
            if isinstance(event, h11.Response):
                return event
            if isinstance(event, h11.InformationalResponse) and event.status_code == _SWITCHING_PROTOCOLS:
                return event
        raise h11.RemoteProtocolError(f"more than {_MAX_INTERIM} interim responses (1xx) before a final one")

    def _body(self, link: socket.socket, deadline: Deadline) -> bytes:
        pieces: list[bytes] = []
        size = 0
        while isinstance(event := self._event(link, deadline), h11.Data):
            size += len(event.data)
            if size > _MAX_ANSWER:
                raise h11.RemoteProtocolError(f"a response of more than {_MAX_ANSWER} bytes")
            pieces.append(bytes(event.data))
        return b"".join(pieces)

    def _begin(
        self, link: socket.socket, head: h11.Response | h11.InformationalResponse, deadline: Deadline
    ) -> tuple[bytes, str]:
        """Return a body, or the beginning of one that does not end, and why it was not read to its end."""
        fields = {name.lower(): value.decode("latin-1").lower() for name, value in head.headers.raw_items()}
        kind = fields.get(b"content-type", "")
        streams = kind.startswith(_STREAMS) and b"content-length" not in fields
        finite = b"content-length" in fields or kind.startswith("application/json")
        most, until = (_STREAM, time.monotonic() + _STREAM_S) if streams else (_DOWNLOAD, math.inf)
        pieces: list[bytes] = []
        size = 0
        try:
            while isinstance(event := self._event(link, deadline, until), h11.Data):
                pieces.append(bytes(event.data))
                size += len(event.data)
                if size > most or time.monotonic() > until:
                    return b"".join(pieces), f"a body of which {size} bytes were read"
        except TimeoutError:
            if not streams and (finite or not size):
                raise
            return b"".join(pieces), f"a body that has not ended after {size} bytes"
        return b"".join(pieces), ""

    def _event(
        self, link: socket.socket, deadline: Deadline, until: float = math.inf
    ) -> h11.Event | type[h11.NEED_DATA | h11.PAUSED]:
        """Return the next event; ``until``: when to give up before the deadline, s of the monotonic clock."""
        while (event := self._state.next_event()) is h11.NEED_DATA:
            link.settimeout(min(deadline.left_s(), max(0.01, until - time.monotonic())))
            if self._begun and _QUICKACK is not None:
                # Many a server keeps the rest back until its first piece is acknowledged: a kernel takes 40 ms.
                link.setsockopt(socket.IPPROTO_TCP, _QUICKACK, 1)
            try:
                octets = link.recv(_READ)
            except ConnectionError:
                self._was_reset = not self._begun
                raise
            if octets and not self._begun:
                self._begun, self.first_s = True, time.monotonic()
            if not octets and self._state.their_state is h11.SEND_RESPONSE:
                self._was_reset = not self._begun and _is_reset(link)
                raise ClosedError
            deadline.came(len(octets))
            self._octets += len(octets)
            if self._octets > _MAX_WIRE:
                raise h11.RemoteProtocolError(f"a response of more than {_MAX_WIRE} bytes on the wire")
            self._state.receive_data(octets)
        return event

    @property
    def has_expired(self) -> bool:
        """Return whether an idle connection was idle too long, or the server has closed it or sent something."""
        late = time.monotonic() > self._idle_since + _EXPIRY_S
        return late or self._link is None or _is_readable(self._link)

    def close(self) -> None:
        """Close the connection if it is open."""
        self.is_idle = False
        if self._link is not None:
            self._link.close()
            self._link = None


def _is_reset(link: socket.socket) -> bool:
    """Return whether the server reset a connection that it had closed, as data came after the close."""
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
    """A pool of connections to one server, numbered by ``number``."""

    def __init__(self, host: str, port: int, tls: ssl.SSLContext | None, number: Callable[[], int]) -> None:
        self._server, self._number = (host, port, tls), number
        self._idle: list[HttpConnection] = []

    def new(self) -> HttpConnection:
        """Return a new connection that is not in the pool, which gives up its own.

        A server that serves one connection at a time, as Perl's HTTP::Daemon does, accepts it only then.
        """
        self.close()
        return HttpConnection(*self._server, self._number())

    def take(self) -> HttpConnection:
        """Take an idle connection out of the pool if the server has not closed it; otherwise return a new one."""
        while self._idle:
            connection = self._idle.pop()
            if not connection.has_expired:
                return connection
            connection.close()
        return self.new()

    def give_back(self, connection: HttpConnection, *, keep: bool = True) -> None:
        """Put a connection back into the pool if it can be used again and ``keep`` is true; otherwise close it."""
        if keep and connection.is_idle and len(self._idle) < _KEPT:
            self._idle.append(connection)
        else:
            connection.close()

    def close(self) -> None:
        """Close the idle connections."""
        while self._idle:
            self._idle.pop().close()


class Deadline:
    """The deadline of a request that starts now.

    Args:
        seconds: time until the last byte of the response, s; each received byte extends it slightly.
        octets: size of the request body, bytes: the deadline is extended while the server still accepts it. A server
            that accepts no byte for ``seconds`` misses the deadline.
    """

    def __init__(self, seconds: float, octets: int = 0) -> None:
        self._seconds = seconds
        self._octets = octets
        self._at = time.monotonic() + seconds + time_for(octets)

    def left_s(self) -> float:
        """Return how long to wait for the response, s.

        Raises:
            TimeoutError: the deadline has passed.
        """
        left = self._at - time.monotonic()
        if left <= 0:
            raise TimeoutError("the deadline has passed")
        return left

    def to_send_s(self) -> float:
        """Return how long the server may accept no byte of the request, s.

        Raises:
            TimeoutError: the deadline has passed.
        """
        return min(self.left_s(), self._seconds)

    def note_sent(self) -> None:
        """Note that the whole request has been handed to the network."""
        self._at = min(self._at, time.monotonic() + self._seconds + time_to_arrive(self._octets))

    def came(self, octets: int) -> None:
        """Note that a number of bytes of the response was received."""
        self._at += time_for(octets)


class CertificateError(ValueError):
    """Raised for a client certificate or a key that cannot be used; the message shows no secret."""


class ClientCertificate(NamedTuple):
    """The files of a client certificate (PEM).

    Attributes:
        file: the certificate, and its key if ``key_file`` is None.
        key_file: the key, or None.
        passphrase_file: the passphrase of an encrypted key, or None.
    """

    file: str
    key_file: str | None = None
    passphrase_file: str | None = None

    def load_into(self, context: ssl.SSLContext) -> None:
        """Load the certificate and its key into a context, without asking for a passphrase.

        Raises:
            CertificateError: a file cannot be read or holds neither, or the passphrase is missing or wrong.
        """
        key, is_encrypted = self.key_file or self.file, False
        try:
            passphrase = read_secret(self.passphrase_file) if self.passphrase_file else ""
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "it is not UTF-8"
            raise CertificateError(f"passphrase file {self.passphrase_file!r}: {reason}") from None

        SECRETS.keep(passphrase, "$ROAAS_KEY_PASSPHRASE")

        def give_passphrase() -> str:
            nonlocal is_encrypted
            is_encrypted = True
            return passphrase

        try:
            context.load_cert_chain(self.file, self.key_file, give_passphrase)
        except (OSError, ValueError) as error:
            if is_encrypted and not self.passphrase_file:
                how = advice(": name the file with its passphrase by --client-key-passphrase-file")
                raise CertificateError(f"the client key in {key} is encrypted{how}") from None
            if is_encrypted:
                raise CertificateError(
                    f"the passphrase in {self.passphrase_file} does not decrypt the client key in {key}"
                ) from None
            missing = next((name for name in (self.file, key) if not Path(name).is_file()), "")
            reason = f"{missing} cannot be read" if missing else getattr(error, "reason", None) or str(error)
            raise CertificateError(f"client certificate {self.file}, key {key}: {reason}") from None


def explain(text: str) -> str:
    """Return a TLS error's text, with the user's remedy if it is known."""
    if any(said in text for said in ("WRONG_VERSION_NUMBER", "RECORD_LAYER_FAILURE", "PACKET_LENGTH_TOO_LONG")):
        return "this port does not speak TLS; is the address http://?"
    if "self-signed certificate" in text or "unable to get local issuer" in text:
        kind = "self-signed" if "self-signed certificate (" in text else "signed by an authority that nobody here knows"
        return f"its certificate is {kind}{advice(': name it, or its authority, by --ca-file')}"
    return text


def tls_context(ca_file: Path | None, certificate: ClientCertificate | None = None) -> ssl.SSLContext:
    """Return a TLS context that trusts the authorities in ``ca_file``, or the system's if it is None.

    Args:
        ca_file: the authorities (PEM).
        certificate: the client's, or None.

    Raises:
        OSError: ``ca_file`` cannot be read, or (ssl.SSLError) holds no certificate.
        CertificateError: the client's certificate cannot be used.
    """
    context = ssl.create_default_context(cafile=str(ca_file) if ca_file else None)
    context.set_alpn_protocols(["http/1.1"])
    if certificate is not None:
        certificate.load_into(context)
    return context
