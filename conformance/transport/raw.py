"""HTTP by hand over a socket: for requests that no client would send, and answers read octet by octet.

Every wait ends at one deadline. What is wrong with an answer's framing is told with the clause of RFC 9112.
"""

import itertools
import re
import select
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass

from conformance.transport.client import HttpClient
from conformance.transport.connections import open_link
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, NoAnswerError, Request, Response, Unanswered
from conformance.transport.pace import time_for

_STATUS_LINE = re.compile(rb"HTTP/1\.([01]) (\d{3})(?: [^\r\n]*)?")
_FIELD = re.compile(rb"([!#$%&'*+.^_`|~0-9A-Za-z-]+):[ \t]*([^\r\n]*?)[ \t]*")
_CHUNK = re.compile(rb"([0-9A-Fa-f]{1,15})[ \t]*(?:;[^\r\n]*)?")
_MOST = 4 * 1024 * 1024
_BODILESS = frozenset({204, 304})
# The least that a connection is waited for, s.
_TO_CONNECT_S = 0.05


class FramingError(Exception):
    """Octets that are no well-framed answer; the message says what is wrong, and by which clause."""


@dataclass(frozen=True)
class RawAnswer:
    """What came over one connection.

    Attributes:
        octets: all of it.
        closed: whether the robot closed the connection (else the deadline passed).
        sent_all: whether the whole request went out.
        elapsed_ms: from the first octet sent to the end.
        early: whether something came in a pause of sending.
    """

    octets: bytes
    closed: bool
    sent_all: bool
    elapsed_ms: float
    early: bool = False


def head(client: HttpClient, method: str, path: str, *fields: str, host: bool = True) -> bytes:
    """A request's head with everything that the robot asks for, and nothing that the caller did not want.

    Args:
        client: whose robot, prefix and token.
        method: as on the wire.
        path: below the base URL.
        fields: whole lines, without line ends.
        host: whether to send Host.
    """
    lines = [f"{method} {client.prefix}{path} HTTP/1.1"]
    if host:
        lines.append(f"Host: {client.authority}")
    if client.connection.token:
        lines.append(f"Authorization: Bearer {client.connection.token}")
    return ("\r\n".join([*lines, *fields]) + "\r\n\r\n").encode("latin-1")


def chunked(body: bytes, size: int, extension: bytes = b"", trailers: bytes = b"") -> bytes:
    """A body in chunks of so many octets, each with an extension, and whole trailer lines behind (RFC 9112 7.1)."""
    pieces = (body[start : start + size] for start in range(0, len(body), size))
    chunks = b"".join(b"%x%b\r\n%b\r\n" % (len(piece), extension, piece) for piece in pieces)
    return chunks + b"0%b\r\n%b\r\n" % (extension, trailers)


def talk(
    client: HttpClient,
    octets: bytes,
    *,
    timeout_s: float | None = None,
    answers: int = 0,
    cuts: Sequence[int] = (),
    pause_s: float = 0.0,
) -> RawAnswer:
    """Send octets over a connection of their own, and read until the robot closes it or the deadline passes.

    Args:
        client: which robot.
        octets: what to send.
        timeout_s: deadline for all of it, and more for each octet; by default the run's.
        answers: stop when so many whole answers to GET have come; 0: only at the end.
        cuts: places before which sending pauses.
        pause_s: for so long, or until something comes.

    Raises:
        NoAnswerError: there is no connection.
    """
    deadline = time.monotonic() + (timeout_s or client.connection.timeout_s) + time_for(len(octets))
    request = shown(client, octets)
    client.connection.take_slot(request.method)
    started = time.perf_counter()
    try:
        left = max(_TO_CONNECT_S, deadline - time.monotonic())
        link = open_link(client.host, client.port, client.tls, left)
    except OSError as error:
        raise NoAnswerError(Unanswered(request, f"no connection: {error}", NoAnswer.REFUSED)) from error
    received = bytearray()
    closed = False
    with link:
        sent_all, early = _sent(link, octets, deadline, cuts, pause_s)
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
            received += piece
            deadline += time_for(len(piece))
            if answers and answers_in(bytes(received), answers) == answers:
                break
    client.connection.note(request.method)
    return RawAnswer(bytes(received), closed, sent_all, (time.perf_counter() - started) * 1000, early)


def _sent(
    link: socket.socket, octets: bytes, deadline: float, cuts: Sequence[int], pause_s: float
) -> tuple[bool, bool]:
    """Send octets, with pauses before the cuts: whether all of them went out, and whether something came in a pause."""
    early = False
    try:
        for begin, end in itertools.pairwise((0, *cuts, len(octets))):
            if begin:
                early |= bool(select.select([link], [], [], pause_s)[0])
            _set_timeout(link, deadline)
            link.sendall(octets[begin:end])
    except OSError:
        # Too slow, or the robot has closed it; what it said before can still be read.
        return False, early
    return True, early


def _set_timeout(link: socket.socket, deadline: float) -> None:
    left = deadline - time.monotonic()
    if left <= 0:
        raise TimeoutError
    link.settimeout(left)


def answers_in(octets: bytes, most: int) -> int:
    """How many whole answers to GET, up to so many, a connection that is still open has brought."""
    for count in range(most):
        try:
            _, octets = parse(octets, "GET", closed=False)
        except FramingError:
            return count
    return most


def shown(client: HttpClient, octets: bytes) -> Request:
    """The request for a finding; the token is never shown."""
    if client.connection.token:
        octets = octets.replace(client.connection.token.encode("latin-1", "replace"), b"$ROAAS_TOKEN")
    line = octets.split(b"\r\n", 1)[0].decode("latin-1")
    return Request(line.split(" ", 1)[0][:40], _address(client), (), b"", raw=octets)


def _address(client: HttpClient) -> str:
    host = f"[{client.host}]" if ":" in client.host else client.host
    return f"{client.scheme}://{host}:{client.port}{client.prefix}/"


def parse(octets: bytes, method: str, *, closed: bool, elapsed_ms: float = 0.0) -> tuple[Response, bytes]:
    """The first answer in a stream, and what follows it.

    Args:
        octets: from the first octet of a status line on.
        method: of the request that it answers.
        closed: whether the connection ended behind the octets.
        elapsed_ms: to be put into the response.

    Raises:
        FramingError: it is not well-framed, or not whole.
    """
    front, separator, rest = octets.partition(b"\r\n\r\n")
    if not separator:
        raise FramingError(f"no end of the header section in {octets[:60]!r} (RFC 9112 2.1)")
    first, *lines = front.split(b"\r\n")
    status_line = _STATUS_LINE.fullmatch(first)
    if status_line is None:
        raise FramingError(f"the status line {first[:60]!r} (RFC 9112 4)")
    headers = tuple(_field(line) for line in lines)
    status = int(status_line[2])
    version = f"HTTP/1.{status_line[1].decode()}"
    if 100 <= status < 200:  # noqa: PLR2004 - RFC 9110 15.2: interim answers come before the real one
        return parse(rest, method, closed=closed, elapsed_ms=elapsed_ms)
    response = Response(status, headers, b"", elapsed_ms, version)
    if method == "HEAD" or status in _BODILESS:
        return response, rest
    body, rest = _body(response, rest, closed=closed)
    return Response(status, headers, body, elapsed_ms, version), rest


def _field(line: bytes) -> tuple[str, str]:
    match = _FIELD.fullmatch(line)
    if match is None:
        raise FramingError(f"the field line {line[:60]!r} (RFC 9112 5)")
    return match[1].decode("latin-1"), match[2].decode("latin-1")


def _body(response: Response, rest: bytes, *, closed: bool) -> tuple[bytes, bytes]:
    coding = (response.header("transfer-encoding") or "").lower()
    if coding:
        if not coding.endswith("chunked"):
            raise FramingError(f"Transfer-Encoding: {coding} (RFC 9112 6.1)")
        return _chunks(rest)
    lengths = {part.strip() for part in (response.header("content-length") or "").split(",")} - {""}
    if len(lengths) > 1 or any(not length.isdigit() for length in lengths):
        raise FramingError(f"Content-Length: {response.header('content-length')} (RFC 9112 6.3)")
    if lengths:
        length = int(lengths.pop())
        if len(rest) < length:
            raise FramingError(f"{len(rest)} octets of a body of Content-Length {length} (RFC 9112 6.3)")
        return rest[:length], rest[length:]
    if not closed:
        raise FramingError("neither Content-Length nor chunked, and the connection stays open (RFC 9112 6.3)")
    return rest, b""


def _chunks(rest: bytes) -> tuple[bytes, bytes]:
    body = bytearray()
    while True:
        line, separator, after = rest.partition(b"\r\n")
        size = _CHUNK.fullmatch(line)
        if not separator or size is None:
            raise FramingError(f"the chunk size {line[:40]!r} (RFC 9112 7.1)")
        length = int(size[1], 16)
        if length == 0:
            break
        if after[length : length + 2] != b"\r\n":
            raise FramingError(f"a chunk of {length} octets that does not end where it says (RFC 9112 7.1)")
        body += after[:length]
        rest = after[length + 2 :]
    while True:
        line, separator, after = after.partition(b"\r\n")
        if not separator:
            raise FramingError("a chunked body without its last line (RFC 9112 7.1)")
        if not line:
            return bytes(body), after
        _field(line)


def read_one(client: HttpClient, octets: bytes, came: RawAnswer, method: str) -> tuple[Attempt, bytes]:
    """The first answer as an exchange, and what follows it; one that cannot be read is none, for that reason.

    Args:
        client: which robot.
        octets: the request.
        came: what talk() brought.
        method: of the request.
    """
    request = shown(client, octets)
    if not came.octets:
        if came.closed:
            return Unanswered(request, "the server closed the connection without a response", NoAnswer.CLOSED), b""
        return Unanswered(request, "no response within the deadline", NoAnswer.TIMEOUT), b""
    try:
        response, rest = parse(came.octets, method, closed=came.closed, elapsed_ms=came.elapsed_ms)
    except FramingError as error:
        return Unanswered(request, str(error), NoAnswer.MALFORMED), b""
    return Exchange(request, response), rest


def rest_of(came: RawAnswer, octets: bytes) -> RawAnswer:
    """What came, from later octets on."""
    return RawAnswer(octets, came.closed, came.sent_all, came.elapsed_ms)
