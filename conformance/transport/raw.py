"""HTTP/1.1 over a plain socket: requests that no client library sends, and responses checked byte by byte.

Every wait has a deadline. The error for a response with broken framing names the violated clause of RFC 9112.
"""

import contextlib
import itertools
import re
import select
import socket
import struct
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from typing import Final, Self

import h11

from conformance.transport.client import Headers, HttpClient
from conformance.transport.connections import open_link
from conformance.transport.exchange import (
    SAFE_METHODS,
    Attempt,
    Exchange,
    Listener,
    NoAnswer,
    NoAnswerError,
    Request,
    Response,
    Sending,
    Unanswered,
    sendable,
)
from conformance.transport.pace import time_for
from conformance.transport.passage import Passage

# Faults of a header section that a recipient may tolerate but a server must not send (RFC 9112 2.2, 5.2).
_FORGIVEN = re.compile(rb"(?<!\r)\n|\r(?!\n)|\n[ \t]")
# A request line anywhere in a text, with whitespace that servers may tolerate (RFC 9112 3), or without a version.
_REQUEST_LINE = re.compile(
    rb"([!#$%&'*+.^_`|~0-9A-Za-z-]+)[ \t\v\f\r]+([^ \t\v\f\r\n]+)[ \t\v\f\r]+HTTP/|(?:\A|[\r\n])[ \t\v\f]*"
    rb"((?:PUT|POST|DELETE|PATCH)(?=[ \t\v\f])|[A-Za-z-]+(?=[ \t\v\f]+(?:/|https?:)))[ \t\v\f]+([^ \t\v\f\r\n]+)"
)
_MOST = 4 * 1024 * 1024
_MOST_INTERIM = 100
_SHORT = 64 * 1024
_TO_CONNECT_S = 0.05  # shortest wait for a connection, s
# Kinds of missing responses.
_SILENCES = {
    NoAnswer.CLOSED: "the server closed the connection without a response",
    NoAnswer.TIMEOUT: "no response within the deadline",
}


class FramingError(Exception):
    """Raised when bytes are not a correctly framed response; the message names the fault and the clause."""


@dataclass(frozen=True)
class RawAnswer:
    """Everything received over one connection.

    Attributes:
        octets: the bytes.
        closed: whether the robot closed the connection; otherwise the deadline passed.
        sent_all: whether the whole request was sent.
        elapsed_ms: time from the first byte sent to the end, ms.
        early: whether bytes were received during a pause of sending.
    """

    octets: bytes
    closed: bool
    sent_all: bool
    elapsed_ms: float
    early: bool = False


def head(client: HttpClient, method: str, path: str, *fields: str, host: bool = True) -> bytes:
    """Return the head of a request: request line, Host, the run's credentials if any, and the given headers.

    Args:
        client: supplies authority, path prefix and credentials.
        method: HTTP method.
        path: request target below the base URL.
        fields: whole header lines, without line ends.
        host: whether to send Host.
    """
    credentials = client.connection.credentials
    target = client.prefix + credentials.target(sendable(path))
    lines = [f"{method} {target} HTTP/1.1"]
    if host:
        lines.append(f"Host: {client.authority}")
    lines += [f"{name}: {value}" for name, value in credentials.fields(method, target)]
    return ("\r\n".join([*lines, *fields]) + "\r\n\r\n").encode("latin-1")


def chunked(body: bytes, size: int, extension: bytes = b"", trailers: bytes = b"") -> bytes:
    """Return a body in chunks of ``size`` bytes, each with an extension, and with trailer lines (RFC 9112 7.1)."""
    pieces = (body[start : start + size] for start in range(0, len(body), size))
    chunks = b"".join(b"%x%b\r\n%b\r\n" % (len(piece), extension, piece) for piece in pieces)
    return chunks + b"0%b\r\n%b\r\n" % (extension, trailers)


def refuses_chunks(attempt: Attempt) -> bool:
    """Return whether a server demanded a Content-Length by 411, which RFC 9112 6.3 allows."""
    return isinstance(attempt, Exchange) and attempt.response.status == HTTPStatus.LENGTH_REQUIRED


def talk(
    client: HttpClient,
    octets: bytes,
    *,
    timeout_s: float | None = None,
    answers: int = 0,
    cuts: Sequence[int] = (),
    pause_s: float = 0.0,
) -> RawAnswer:
    """Send bytes over a new connection, and read until the robot closes it or the deadline passes.

    While an overloaded device puts one of the requests off, they are sent again, unless it may have acted before.

    Args:
        client: the interface to send to.
        octets: the bytes.
        timeout_s: deadline for everything, s; by default the run's. Large sizes extend it.
        answers: stop after this number of complete responses to GET; 0 means read until the connection ends.
        cuts: positions at which sending pauses.
        pause_s: length of a pause, s; it ends early when bytes are received.

    Raises:
        NoAnswerError: the connection cannot be opened, or the endpoint did not respond before.
        NotPermittedError: one of the requests in the bytes may not be sent in this run.
    """
    endpoint = partial(client.connection.endpoint_of, shown_request(client, octets))
    for tries in itertools.count(1):
        came = _talk(client, octets, timeout_s, answers, cuts, pause_s)
        overload = client.connection.overload
        if not any(overload.waits(response, endpoint, tries) for response in _responses(octets, came)):
            return came
    raise AssertionError("unreachable: it counts without an end")


def _responses(octets: bytes, came: RawAnswer) -> Iterator[Response]:
    """Yield the responses to the requests up to the first one that may have changed something."""
    left = came.octets
    for method, _ in requests_in(octets) or [("GET", "")]:
        try:
            response, left = parse(left, method, closed=came.closed)
        except FramingError:
            return
        yield response
        if method not in SAFE_METHODS:
            return


def _talk(
    client: HttpClient, octets: bytes, timeout_s: float | None, answers: int, cuts: Sequence[int], pause_s: float
) -> RawAnswer:
    within_s = (timeout_s or client.connection.timeout_s) + time_for(len(octets))
    deadline = time.monotonic() + within_s
    request = shown_request(client, octets)
    client.put_off(request)
    client.connection.take_slot(*((method, _url(client, target)) for method, target in requests_in(octets)))
    started, sent_s, first_s = time.perf_counter(), time.monotonic(), 0.0
    number = client.connection.number()

    def record(response: bytes | None, problem: str = "", kind: NoAnswer | None = None, *, whole: bool = True) -> None:
        ended_s = time.monotonic()
        client.connection.recorder.record(
            Passage(request, number, 1, 1, sent_s, first_s, ended_s, within_s, response, problem, kind, whole)
        )

    client.close()  # a server that serves one connection at a time accepts the new one only then
    try:
        left = max(_TO_CONNECT_S, deadline - time.monotonic())
        link = open_link(client.host, client.port, client.tls, left)
    except OSError as error:
        client.connection.recent.append(Sending(request, NoAnswer.REFUSED))
        record(None, f"no connection: {error}", NoAnswer.REFUSED, whole=False)
        raise NoAnswerError(Unanswered(request, f"no connection: {error}", NoAnswer.REFUSED)) from error
    received = bytearray()
    closed = False
    with link:
        sent_all, early = _send(link, octets, deadline, cuts, pause_s)
        while len(received) < _MOST:
            try:
                _set_timeout(link, deadline)
                piece = link.recv(65536)
            except TimeoutError:
                break
            except OSError:
                closed = True
                break
            if not piece:
                closed = True
                break
            first_s = first_s or time.monotonic()
            received += piece
            deadline += time_for(len(piece))
            # A long response is examined only when no more bytes wait, because each look takes time.
            short = len(received) < _SHORT or not select.select([link], [], [], 0)[0]
            if answers and short and answers_in(bytes(received), answers) == answers:
                break
    client.connection.note(request.method)
    tell(client.connection.listeners, octets)
    silence = NoAnswer.CLOSED if closed else NoAnswer.TIMEOUT
    record(bytes(received), "" if received else _SILENCES[silence], None if received else silence, whole=sent_all)
    client.connection.recent.append(Sending(request, None if received else silence))
    return RawAnswer(bytes(received), closed, sent_all, (time.perf_counter() - started) * 1000, early)


def _send(
    link: socket.socket, octets: bytes, deadline: float, cuts: Sequence[int], pause_s: float
) -> tuple[bool, bool]:
    """Send bytes with pauses; return whether all were sent, and whether bytes were received during a pause."""
    early = False
    try:
        for begin, end in itertools.pairwise((0, *cuts, len(octets))):
            if begin:
                early |= bool(select.select([link], [], [], pause_s)[0])
            _set_timeout(link, deadline)
            link.sendall(octets[begin:end])
    except OSError:
        # Too slow, or the robot closed the connection; bytes that it sent before can still be read.
        return False, early
    return True, early


def _set_timeout(link: socket.socket, deadline: float) -> None:
    left = deadline - time.monotonic()
    if left <= 0:
        raise TimeoutError
    link.settimeout(left)


def answers_in(octets: bytes, most: int) -> int:
    """Return how many complete responses to GET the bytes from an open connection hold, at most ``most``."""
    for count in range(most):
        try:
            _, octets = parse(octets, "GET", closed=False)
        except FramingError:
            return count
    return most


def shown_request(client: HttpClient, octets: bytes) -> Request:
    """Return the request as findings show it, without the credentials."""
    octets = client.connection.credentials.hidden_bytes(octets)
    line = octets.split(b"\r\n", 1)[0].decode("latin-1")
    return Request(line.split(" ", 1)[0][:40], _address(client), (), b"", raw=octets)


def requests_in(octets: bytes) -> list[tuple[str, str]]:
    """Return method and target of every line in the bytes that a server may take for a request line, bodies included.

    Servers differ in where they see one request end and the next one begin (RFC 9112 11.2).
    """
    found = (match.groups() for match in _REQUEST_LINE.finditer(octets))
    return [((one or three).decode(), (two or four).decode("latin-1")) for one, two, three, four in found]


def tell(listeners: Sequence[Listener], octets: bytes) -> None:
    """Tell that a server may find a request in the bytes that changes something."""
    acting = {method for method, _ in requests_in(octets)} - SAFE_METHODS
    for listener in listeners if acting else ():
        listener.acted_by_hand(deletes="DELETE" in acting)


def _url(client: HttpClient, target: str) -> str:
    return target if "://" in target else f"{client.scheme}://{client.authority}{target}"


def _address(client: HttpClient) -> str:
    host = f"[{client.host}]" if ":" in client.host else client.host
    return f"{client.scheme}://{host}:{client.port}{client.prefix}/"


def parse(octets: bytes, method: str, *, closed: bool, elapsed_ms: float = 0.0) -> tuple[Response, bytes]:
    """Return the first final response in a byte stream, and the bytes after it.

    h11 parses; framing that h11 tolerates and RFC 9112 forbids servers to send is rejected before and after.

    Args:
        octets: the bytes, from a status line on.
        method: method of the request.
        closed: whether the connection ended after the bytes.
        elapsed_ms: for the response.

    Raises:
        FramingError: the response is incomplete or its framing is broken.
    """
    for _ in range(_MOST_INTERIM):
        response, octets = _parse_first(octets, method, closed=closed, elapsed_ms=elapsed_ms)
        if response is not None:
            return response, octets
    raise FramingError(f"more than {_MOST_INTERIM} interim responses before a final one (RFC 9110 15.2)")


def _parse_first(octets: bytes, method: str, *, closed: bool, elapsed_ms: float) -> tuple[Response | None, bytes]:
    """Return the first response in a byte stream, None if it is interim, and the bytes after it; see parse()."""
    section, separator, _ = octets.partition(b"\r\n\r\n")
    if not separator:
        raise FramingError(f"no end of the header section in {octets[:60]!r} (RFC 9112 2.1)")
    if _FORGIVEN.search(section):
        raise FramingError(f"a bare CR or LF, or a folded field, in {section[:60]!r} (RFC 9112 2.2, 5.2)")
    reader = h11.Connection(h11.CLIENT, max_incomplete_event_size=_MOST)
    # Only HEAD changes the framing of a response (RFC 9112 6.3), so GET stands for any other method.
    reader.send(h11.Request(method="HEAD" if method == "HEAD" else "GET", target="/", headers=[("Host", "")]))
    reader.send(h11.EndOfMessage())
    reader.receive_data(octets)
    if closed:
        reader.receive_data(b"")
    try:
        first = reader.next_event()
        if isinstance(first, h11.InformationalResponse):
            # RFC 9110 15.2: interim responses come before the final one.
            return None, reader.trailing_data[0]
        if not isinstance(first, h11.Response) or first.http_version not in {b"1.0", b"1.1"}:
            raise FramingError(f"no response of HTTP/1.1 or HTTP/1.0: {section[:60]!r} (RFC 9112 2.3, 4)")
        body, rest = _content(reader)
    except h11.RemoteProtocolError as error:
        raise FramingError(f"{error} (RFC 9112 4 to 7)") from error
    chunked = any(name == b"transfer-encoding" for name, _ in first.headers)
    if chunked and method != "HEAD" and not octets[: len(octets) - len(rest)].endswith(b"\r\n\r\n"):
        raise FramingError("a chunked body whose last line does not end in CRLF (RFC 9112 7.1)")
    headers = tuple((name.decode("latin-1"), value.decode("latin-1")) for name, value in first.headers.raw_items())
    return Response(first.status_code, headers, body, elapsed_ms, f"HTTP/{first.http_version.decode()}"), rest


def _content(reader: h11.Connection) -> tuple[bytes, bytes]:
    """Return the body of a response whose head has been parsed, and the bytes after it.

    Raises:
        FramingError: the body is incomplete.
        h11.RemoteProtocolError: its framing is broken.
    """
    body = bytearray()
    while isinstance(event := reader.next_event(), h11.Data):
        body += event.data
    if not isinstance(event, h11.EndOfMessage):
        raise FramingError(f"no end of the content after {len(body)} bytes of it (RFC 9112 6.3)")
    return bytes(body), reader.trailing_data[0]


def read_one(client: HttpClient, octets: bytes, came: RawAnswer, method: str) -> tuple[Attempt, bytes]:
    """Return the first response as an exchange (or why it cannot be parsed), and the bytes after it.

    Args:
        client: the interface that the request was sent to.
        octets: the request.
        came: what talk() returned.
        method: method of the request.
    """
    request = shown_request(client, octets)
    if not came.octets:
        if came.closed:
            return Unanswered(request, _SILENCES[NoAnswer.CLOSED], NoAnswer.CLOSED), b""
        return Unanswered(request, _SILENCES[NoAnswer.TIMEOUT], NoAnswer.TIMEOUT), b""
    try:
        response, rest = parse(came.octets, method, closed=came.closed, elapsed_ms=came.elapsed_ms)
    except FramingError as error:
        return Unanswered(request, str(error), NoAnswer.MALFORMED), b""
    for sent, target in requests_in(octets)[:1]:
        for listener in client.connection.listeners if sent == method else ():
            listener.by_hand(Exchange(Request(sent, _url(client, target)), response))
    return Exchange(request, response), rest


def rest_of(came: RawAnswer, octets: bytes) -> RawAnswer:
    """Return a copy of ``came`` with other bytes."""
    return RawAnswer(octets, came.closed, came.sent_all, came.elapsed_ms)


#: l_onoff 1, l_linger 0: close() sends RST instead of FIN.
RESET: Final = struct.pack("ii", 1, 0)


class PartialRequest:
    """A request of which only a part has been sent. The constructor sends that part.

    Args:
        client: the interface to send it to.
        method, path: as for HttpClient.send().
        sent: the part of the body to send.
        promised: Content-Length, or None for a chunked body without its last chunk.
        head_only: number of bytes of the head to send, without a body; None means the whole head and ``sent``.
        headers: further fields; Content-Type is application/json where they have none.

    Raises:
        NoAnswerError: the connection cannot be opened.
        NotPermittedError: the request may not be sent in this run.
    """

    def __init__(
        self,
        client: HttpClient,
        method: str,
        path: str,
        *,
        sent: bytes = b"",
        promised: int | None = None,
        head_only: int | None = None,
        headers: Headers = (),
    ) -> None:
        credentials = client.connection.credentials
        target = client.prefix + credentials.target(sendable(path))
        head = [f"{method} {target} HTTP/1.1", f"Host: {client.authority}"]
        if (sent or promised) and not any(name.lower() == "content-type" for name, _ in headers):
            head.append("Content-Type: application/json")
        head += [f"{name}: {value}" for name, value in headers]
        head.append("Transfer-Encoding: chunked" if promised is None and sent else f"Content-Length: {promised or 0}")
        shown = credentials.hide("\r\n".join(head))
        head += [f"{name}: {value}" for name, value in credentials.fields(method, target)]
        body = f"{len(sent):x}\r\n".encode() + sent + b"\r\n" if promised is None and sent else sent
        octets = "\r\n".join(head).encode() + b"\r\n\r\n" + body
        if head_only is not None:
            octets = octets[:head_only]
        self.request = Request(method, client.url(path), (), b"", f"{shown}\r\n\r\n".encode()[: len(octets)] + body)
        client.connection.take_slot((method, self.request.url))
        self._connection, self._number, self._sent_s = client.connection, client.connection.number(), time.monotonic()
        client.close()  # as in _talk()
        try:
            self._socket = socket.create_connection((client.host, client.port), client.connection.timeout_s)
            if client.scheme == "https":
                self._socket = client.connection.tls().wrap_socket(self._socket, server_hostname=client.host)
            self._socket.sendall(octets)
            client.connection.recent.append(Sending(self.request, None))
        except OSError as error:
            unanswered = Unanswered(self.request, f"no connection: {error}", NoAnswer.REFUSED)
            self._record(unanswered.problem, NoAnswer.REFUSED)
            raise NoAnswerError(unanswered) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.vanish()

    def vanish(self, *, reset: bool = True) -> None:
        """Break the connection off, by a TCP reset or by a normal close, as when a client's process is killed."""
        with contextlib.suppress(OSError):
            if reset:
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
        with contextlib.suppress(OSError):
            self._socket.close()
        if self._sent_s:
            self._record("the suite reset the connection" if reset else "the suite closed the connection")
            self._sent_s = 0.0

    def _record(self, problem: str, kind: NoAnswer | None = None) -> None:
        now = time.monotonic()
        self._connection.recorder.record(
            Passage(self.request, self._number, 1, 1, self._sent_s, 0.0, now, 0.0, None, problem, kind, whole=False)
        )
