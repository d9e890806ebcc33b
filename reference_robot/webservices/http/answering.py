"""The response half of an HTTP connection: writes responses in the order of the requests, and closes the connection.

A response that is available at once is written before the parser returns. Otherwise a task waits for the response, and
further requests from the client wait in a queue. When the queue is full, or while the client does not read its
responses, nothing more is read from the connection.

Connections take turns, so that a client with many requests at once does not keep the robot from others. The parser does
not stop between the requests of one segment, and a segment may hold more than a thousand. So only the first request is
parsed at once. The rest waits in the port's queue, and reading pauses meanwhile.
"""

import asyncio
import contextlib
import re
import socket
import struct
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Coroutine
from functools import partial
from time import perf_counter
from typing import Any, Final

from reference_robot.webservices.http.crowd import NEVER
from reference_robot.webservices.http.interface import problem_response
from reference_robot.webservices.http.messages import BODY_LIMIT, Field, Request, Response
from reference_robot.webservices.http.port import Port
from reference_robot.webservices.representation.problems import Problem, not_yet

TARGET_LIMIT: Final = 8000  # bytes (RFC 9110 4.1 requires at least that)
HEAD_LIMIT: Final = 64 * 1024  # bytes: request line and fields (RFC 6585 5)
FRAMING_LIMIT: Final = 64 * 1024  # bytes of chunk sizes, chunk extensions and trailers, besides those for each byte:
FRAMING_PER_BYTE: Final = 8  # a chunk of one byte takes six
_FIELD_MARKS: Final = 4  # bytes of a field line besides name and value: colon, space and line end
_VERSIONS: Final = frozenset({"1.1", "1.0"})
FRAMING_FIELDS: Final = (b"content-length", b"transfer-encoding")
# Fields that may occur only once in a request (RFC 9110 5.3; 9112 3.2 for Host).
_SINGLE: Final = frozenset({b"host", b"content-type", b"content-length", b"authorization"})
_SERVED: Final = (b"GET ", b"PUT ", b"POST ", b"DELETE ", b"HEAD ", b"OPTIONS ")
_METHOD: Final = re.compile(rb"[!#$%&'*+.^_`|~0-9A-Za-z-]++(?= [^ \r\n]+ HTTP/1\.[01]\r?\n)")


def readable(data: bytes) -> bytes:
    """Return the first bytes of a request, changed so that the HTTP parser accepts them.

    A method that no resource offers is replaced by TRACE. The parser would reject unknown methods; so they get the same
    405 or 404 as any unsupported method (RFC 9110 15.5.6).
    """
    if not data.startswith(_SERVED):
        method = _METHOD.match(data)
        if method is not None:
            return b"TRACE" + data[method.end() :]
    return data


def fields_by_name(fields: list[Field]) -> dict[bytes, bytes]:
    """Return field values by lower-case name, with repeated fields joined by a comma.

    Raises:
        Problem: 400 for a repeated field that may occur only once.
    """
    headers: dict[bytes, bytes] = {}
    for name, value in fields:
        if name not in headers:
            headers[name] = value
        elif name in _SINGLE:
            raise Problem(400, f"the field {name.decode('latin-1')} occurs more than once (RFC 9110 5.3)")
        else:
            headers[name] += b", " + value
    return headers


def require_head(version: str, fields: list[Field]) -> None:
    """Raise the Problem for a head that is too long, or that leaves in doubt where the request ends.

    Raises:
        Problem: 431 for fields that are too long, 505 for a version other than HTTP/1 (RFC 9110 15.6.6), 400 for a
            transfer coding in HTTP/1.0, and 501 for a transfer coding other than ``chunked`` (RFC 9112 6.1).
    """
    if sum(len(name) + len(value) + _FIELD_MARKS for name, value in fields) > HEAD_LIMIT:
        raise head_too_large()
    if version not in _VERSIONS:
        raise Problem(505, f"HTTP/{version} is not supported, only HTTP/1.1 and HTTP/1.0")
    codings = b",".join(value for name, value in fields if name == b"transfer-encoding")
    if codings and version == "1.0":
        raise Problem(400, "HTTP/1.0 has no Transfer-Encoding (RFC 9112 6.1)")
    if codings and codings.lower() != b"chunked":
        raise Problem(501, f"Transfer-Encoding {codings.decode('latin-1')[:80]!a} is not supported, only chunked")


def framing_too_large() -> Problem:
    """Return the Problem 431 for chunk extensions and trailers that are too long (RFC 6585 5)."""
    return Problem(431, f"chunk sizes, chunk extensions and trailers exceed {FRAMING_LIMIT} bytes")


def head_too_large() -> Problem:
    """Return the Problem 431 for a head that is too long (RFC 6585 5)."""
    return Problem(431, f"the head of the request exceeds {HEAD_LIMIT} bytes")


def require_old_version(version: str) -> None:
    """Raise the Problem 400 for a missing Host field, unless the version is HTTP/1.0, which has no Host field."""
    if version != "1.0":
        raise Problem(400, "the request has no Host field (RFC 9112 3.2)")


def require_bounded(size: int) -> None:
    """Raise the Problem 413 if the body's size exceeds the limit (RFC 9110 15.5.14)."""
    if size > BODY_LIMIT:
        raise Problem(413, f"the body of {size} bytes exceeds the limit of {BODY_LIMIT} bytes")


def no_request(error: BaseException) -> Problem:
    """Return the Problem 400 for bytes that the parser rejects (RFC 9112 2.2)."""
    return Problem(400, f"the request is not valid HTTP: {error}")


def full() -> Problem:
    """Return the Problem 503 for a request that would exceed the memory kept for clients (RFC 9110 15.6.4)."""
    return not_yet("the memory for requests of clients is full")


FIELD_BYTES: Final = 200  # bytes of memory per field besides its text: two Python objects and their references

_LINGER: Final = 2.0  # seconds for which data from a refused client is read and dropped
_PIPELINED: Final = 16  # waiting requests at which reading from the connection pauses
_NO_LINGER: Final = struct.pack("ii", 1, 0)  # SO_LINGER: closing resets the connection
DRAINED: Final = 16 * BODY_LIMIT  # bytes that are dropped after a refusal, before the connection is closed
_HEAD_END: Final = b"\r\n\r\n"
_AT_ONCE: Final = 4  # postponed requests of one client that are parsed in its turn


class AnsweringConnection(asyncio.Protocol, ABC):
    """A connection to one port that writes responses; a subclass parses the requests.

    Attributes:
        since: The time of the client's last step, by ``time.perf_counter``.
        allowed: Seconds that its next step may take; infinity while the robot works on a response.
        answered: The time of its last response; minus infinity before the first.
        is_known: Whether a request of the client has passed the access check.
    """

    __slots__ = (
        "_ended",
        "_has_begun",
        "_held",
        "_leaving",
        "_port",
        "_reading",
        "_respond",
        "_stalled",
        "_task",
        "_transport",
        "_unread",
        "_waiting",
        "allowed",
        "answered",
        "is_known",
        "since",
    )

    def __init__(self, port: Port) -> None:
        self._port = port
        self._respond = port.interface.respond
        self._transport: asyncio.Transport
        self.since = perf_counter()
        self.allowed = NEVER
        self.answered = -NEVER
        self.is_known = False
        self._has_begun = False  # a request is being received
        # The requests that have been received, and the end of the connection
        self._waiting: deque[tuple[Request, Response | None, int]] = deque()
        self._task: asyncio.Task[Response] | None = None
        self._held = 0  # bytes of waiting and incomplete requests and unread responses
        self._unread = 0  # bytes of unread responses among them
        self._reading = True
        self._stalled = False  # the client does not read its responses
        self._ended = False  # the client has closed its side
        self._leaving = False  # nothing more is read from the client

    @abstractmethod
    def expire(self) -> None:
        """End the connection because the client's time has passed."""

    # Callbacks of the transport

    def connection_lost(self, _error: Exception | None) -> None:
        """Discard the waiting requests; the request in progress is still completed."""
        self._port.remove(self)
        self._hold(-self._held)
        self._leaving = True
        self._waiting.clear()

    def eof_received(self) -> bool:
        """Return whether the connection stays open for pending responses; under TLS it closes in both directions."""
        self._ended = True
        return self._transport.can_write_eof() and (self._task is not None or bool(self._waiting))

    def pause_writing(self) -> None:
        """Stop writing and reading, because the client does not read its responses."""
        self._stalled = True
        self._pause_reading()
        self._allow(self._port.patience)
        self._unread = self._transport.get_write_buffer_size()
        self._hold(self._unread)
        if self._port.is_full_for(self._held):
            self._reset()

    def resume_writing(self) -> None:
        """Continue with the waiting requests, because the client reads again."""
        self._stalled = False
        self._hold(-self._unread)
        self._unread = 0
        self._advance()

    def _allow(self, seconds: float) -> None:
        """Give the client this time for its next step, from now on."""
        self.since = perf_counter()
        self.allowed = seconds

    def _allow_next(self) -> None:
        """Give the client time to begin its next request."""
        self.since = perf_counter()
        self.allowed = self._port.keep_alive if self.is_known else self._port.unknown_keep_alive

    # Responses, in the order of the requests

    def _is_busy(self) -> bool:
        return self._task is not None or self._stalled or bool(self._waiting)

    def _queue(self, request: Request, response: Response | None) -> None:
        """Answer a request now or put it into the queue; ``response`` is set for a request that is refused."""
        if self._leaving:
            return  # the previous request was the last of the connection
        # Not _is_busy(): this is the usual case, and a call costs time.
        if self._task is None and not self._stalled and not self._waiting:
            self._serve(request, response)
            return
        weight = _weight(request)
        self._hold(weight)
        if response is None and self._port.is_full_for(self._held):
            response = problem_response(full(), request.headers.get(b"accept"))
        self._waiting.append((request, response, weight))
        if not self._stalled:
            self.allowed = NEVER
        if len(self._waiting) >= _PIPELINED:
            self._pause_reading()

    def _serve(self, request: Request, response: Response | None) -> None:
        outcome = response or self._respond(request)
        if isinstance(outcome, Response):
            self._write(request, outcome)
        else:
            self._await(request, outcome)

    def _await(self, request: Request, outcome: Coroutine[Any, Any, Response]) -> None:
        if not self._has_begun:
            self.allowed = NEVER
        weight = _weight(request)
        self._hold(weight)
        self._task = self._port.loop.create_task(outcome)
        self._task.add_done_callback(partial(self._finish, request, weight))

    def _finish(self, request: Request, weight: int, task: asyncio.Task[Response]) -> None:
        self._task = None
        if task.cancelled() or self._transport.is_closing():
            return
        self._hold(-weight)
        self._write(request, task.result())
        self._advance()

    def _advance(self) -> None:
        while self._waiting and self._task is None and not self._stalled:
            request, response, weight = self._waiting.popleft()
            self._hold(-weight)
            self._serve(request, response)
        if self._is_busy():
            return
        if self._ended:
            self._leave()
        elif not self._reading and not self._leaving:
            self._reading = True
            self._transport.resume_reading()
            if self._has_begun:
                self._allow(self._port.patience)
            else:
                self._allow_next()

    def _write(self, request: Request, response: Response) -> None:
        """Write a complete response.

        The header ``Server-Timing: app;dur=MS`` (W3C Server Timing) is the time in milliseconds from the complete
        request head to the response. A load test uses it to separate the robot's share of the latency from the
        network's.
        """
        keep_alive = request.keep_alive and not self._port.is_stopping
        now = perf_counter()
        self._transport.write(
            b"%b%bserver-timing: app;dur=%.3f\r\n%b\r\n%b"
            % (
                response.head,
                self._port.date,
                (now - request.began) * 1000,
                b"" if keep_alive else b"connection: close\r\n",
                b"" if request.method == "HEAD" else response.body,
            )
        )
        self.answered = now
        self._port.note_answer(request.began, now)
        if not keep_alive:
            self._leave()
        elif not self._has_begun and not self._stalled:
            self._allow_next()

    # The end of the connection

    def _leave(self) -> None:
        """Close the connection after all writes; a client that is still sending gets time to read its response.

        Closing at once with unread bytes would reset the connection, and the response would be lost (RFC 9112 9.6).
        """
        lingers = self._has_begun and not self._ended
        self._leaving = True
        self._waiting.clear()
        if lingers:
            if self._transport.can_write_eof():  # not under TLS: there the client closes, or the time passes
                self._transport.write_eof()
            self._allow(_LINGER)
        else:
            self._close()

    def _close(self) -> None:
        self._leaving = True
        self._transport.close()
        self._allow(self._port.patience)

    def stop(self) -> None:
        """Close the connection if no response is pending; otherwise the pending response will be the last."""
        if not self._is_busy():
            self._close()

    def abort(self) -> None:
        """Drop the connection and cancel the request in progress."""
        if self._task is not None:
            self._task.cancel()
        self._transport.abort()

    def give_way(self) -> None:
        """Close the connection at once, because another client gets its place."""
        self._leaving = True
        self._transport.abort()

    def _reset(self) -> None:
        """Reset the connection, so that the kernel frees its send buffer at once although the client does not read."""
        with contextlib.suppress(OSError):  # the socket may be closed already
            self._transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _NO_LINGER)
        self._transport.abort()

    def _pause_reading(self) -> None:
        if self._reading and not self._leaving:
            self._reading = False
            self.allowed = NEVER
            self._transport.pause_reading()

    def _hold(self, size: int) -> None:
        self._held += size
        self._port.held.size += size


def _weight(request: Request) -> int:
    """Return the memory that a request occupies, in bytes."""
    fields = request.headers.items()
    head = sum(FIELD_BYTES + len(name) + len(value) for name, value in fields)
    return len(request.path) + len(request.query) + head + len(request.body)


class PacedConnection(AnsweringConnection):
    """A connection that takes turns with others; a subclass parses the requests."""

    __slots__ = ("_dropped", "_postponed")

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._postponed = b""
        self._dropped = 0  # bytes that came after a refusal

    @abstractmethod
    def _take(self, data: bytes) -> None:
        """Parse received bytes."""

    @abstractmethod
    def _refuse(self, problem: Problem) -> None:
        """Answer bytes that are not a valid request with an error, and read nothing more."""

    def eof_received(self) -> bool:
        """Return whether the connection stays open for pending responses."""
        return super().eof_received() or (bool(self._postponed) and self._transport.can_write_eof())

    def data_received(self, data: bytes) -> None:
        """Take received bytes; postpone those after the first request."""
        if self._leaving:
            self._dropped += len(data)
            if self._dropped > DRAINED:
                self.give_way()
            return
        if self._postponed:
            self._postpone(self._postponed + data)
        elif data.count(_HEAD_END) > 1:
            self._take_some(data, 1)
        else:
            self._take(data)

    def _take_some(self, data: bytes, most: int) -> None:
        """Feed the first requests of many; other clients get their turn before the rest.

        Reading pauses meanwhile, so that a client cannot occupy the robot with many requests in one segment.
        """
        end = 0
        for _ in range(most):
            end = data.find(_HEAD_END, end) + len(_HEAD_END)
            if end < len(_HEAD_END):
                end = len(data)
                break
        self._take(data[:end])
        if end < len(data) and not self._leaving:
            self._postpone(data[end:])
            self._port.postpone(self._take_postponed)

    def _postpone(self, data: bytes) -> None:
        self._hold(len(data) - len(self._postponed))
        self._postponed = data
        if self._port.is_full_for(len(data)):
            self._refuse(full())
        else:
            self._transport.pause_reading()

    def _take_postponed(self) -> None:
        data, self._postponed = self._postponed, b""
        if self._leaving:
            return
        self._hold(-len(data))
        self._take_some(data, _AT_ONCE)
        if self._postponed or self._leaving:
            return
        if self._reading:
            self._transport.resume_reading()
        self._advance()
