"""One connection: octets in, requests answered in their order, octets out.

An ``asyncio.Protocol`` on httptools' parser. What a resource answers at once is written before the parser returns; for
what has to wait there is a task, and what the client sends meanwhile waits its turn. The content is complete before a
resource sees its request. What keeps strangers from using the robot up:

- sizes: of the target, of the head, of the content, of what is read and dropped after a refusal; and of all that
  clients make the robot keep: half a request, one that waits, an answer that nobody reads;
- times: ``due`` is when the client must have moved on, whatever it is about: sending a request, reading answers, asking
  for something. There is no state of a connection without it but one: the robot works on an answer;
- turns: so many requests may wait on a connection; then no more is read from it, nor while the client does not read.

Over 300 lines because a connection is one state: what arrives, what waits its turn and the clock hang together.
"""

import asyncio
import contextlib
import math
import socket
import struct
from collections import deque
from collections.abc import Coroutine
from functools import partial
from time import perf_counter
from typing import Any, Final, cast

from httptools import HttpParserCallbackError, HttpParserError, HttpRequestParser

from reference_robot.webservices.http.interface import described
from reference_robot.webservices.http.messages import BODY_LIMIT, Field, Request, Response
from reference_robot.webservices.http.port import Port
from reference_robot.webservices.http.proxies import take_forwarded
from reference_robot.webservices.http.reading import (
    HEAD_LIMIT,
    TARGET_LIMIT,
    fields_by_name,
    head_too_large,
    no_request,
    readable,
    require_bounded,
    require_old_version,
    require_short_head,
)
from reference_robot.webservices.representation.problems import Problem, not_yet

_LINGER: Final = 2.0  # seconds in which what a refused client still sends is read and dropped
_DRAINED: Final = 16 * BODY_LIMIT  # octets of refused content that are dropped before the line is cut
_PIPELINED: Final = 16  # requests that may wait on a connection before no more is read from it
_UNREAD: Final = 16 * 1024  # octets of answers that wait for the client before it counts as one that does not read
_FIELD: Final = 200  # octets that a field takes besides its own: two objects, and where they are
_CONTINUE: Final = b"HTTP/1.1 100 Continue\r\n\r\n"
_NEVER: Final = math.inf
_NO_LINGER: Final = struct.pack("ii", 1, 0)  # SO_LINGER: closing resets the connection


class HttpConnection(asyncio.Protocol):
    """A connection to one port.

    Attributes:
        due: When the client must have moved on, by the event loop's clock; infinity while it is the robot's turn.
    """

    def __init__(self, port: Port) -> None:
        self._port = port
        self._admit = port.interface.admit
        self._respond = port.interface.respond
        self._now = port.loop.time
        self._transport: asyncio.Transport
        self._parser = HttpRequestParser(self)
        self.due = _NEVER
        # The request that arrives
        self._has_begun = False
        self._in_head = True
        self._head_octets = 0
        self._target = b""
        self._fields: list[Field] = []
        self._request: Request | None = None
        self._content = bytearray()
        self._is_refused = False  # it has its answer, and its content is dropped
        self._dropped = 0
        # Those that have arrived, and how they end
        self._waiting: deque[tuple[Request, Response | None, int]] = deque()
        self._task: asyncio.Task[Response] | None = None
        self._held = 0  # octets of content, of what waits, and of what is not read
        self._arriving = 0  # of them, those of the request that arrives, but for its content
        self._unread = 0  # of them, those of answers
        self._is_proxied = False  # by a proxy that is trusted
        self._reading = True
        self._stalled = False  # the client does not read
        self._ended = False  # the client sends no more
        self._leaving = False  # nor is anything more read from it

    # The transport's side

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Start the clock: a client that connects must also ask."""
        self._transport = cast("asyncio.Transport", transport)
        self._transport.set_write_buffer_limits(_UNREAD)
        self._is_proxied = self._port.proxies.include(transport.get_extra_info("peername"))
        self.due = self._now() + self._port.patience
        if not self._port.add(self):
            self._refuse(not_yet("too many connections"))

    def connection_lost(self, _error: Exception | None) -> None:
        """Forget what waits; what the robot works on is finished all the same."""
        self._port.remove(self)
        self._hold(-self._held)
        self._leaving = True
        self._waiting.clear()

    def eof_received(self) -> bool:
        """Keep the connection for the answers that are still to come; under TLS, both sides end at once."""
        self._ended = True
        return self._transport.can_write_eof() and (self._task is not None or bool(self._waiting))

    def pause_writing(self) -> None:
        """Answer no more: the client does not read."""
        self._stalled = True
        self._pause_reading()
        self.due = self._now() + self._port.patience
        self._unread = self._transport.get_write_buffer_size()
        self._hold(self._unread)
        if self._port.is_full():
            self._reset()

    def resume_writing(self) -> None:
        """Answer what has waited."""
        self._stalled = False
        self._hold(-self._unread)
        self._unread = 0
        self._advance()

    def data_received(self, data: bytes) -> None:
        """Take octets."""
        if self._leaving:
            return
        if self._in_head:
            if not self._has_begun:
                data = readable(data)
            self._head_octets += len(data)
        try:
            self._parser.feed_data(data)
        except HttpParserCallbackError as error:
            problem = error.__context__
            self._refuse(problem if isinstance(problem, Problem) else no_request(problem or error))
        except HttpParserError as error:
            self._refuse(no_request(error))
        else:
            if self._has_begun:
                self._hold_arriving()

    # The parser's side: an exception is the way out of its callbacks

    def on_message_begin(self) -> None:
        """Start the clock for a request."""
        self._has_begun = True
        if not self._stalled:
            self.due = self._now() + self._port.patience

    def on_url(self, url: bytes) -> None:
        """Bound the request target."""
        self._target += url
        if len(self._target) > TARGET_LIMIT:
            raise Problem(414, f"the request target exceeds {TARGET_LIMIT} octets")

    def on_header(self, name: bytes, value: bytes) -> None:
        """Keep a field, unless it is a trailer."""
        if self._in_head:
            self._fields.append((name.lower(), value.rstrip()))

    def on_headers_complete(self) -> None:
        """Refuse what can be refused by its head; else ask for the content if the client waits for that."""
        fields = self._fields
        if self._head_octets > HEAD_LIMIT:
            require_short_head(fields)
        self._in_head = False
        headers, parser = dict(fields), self._parser
        request = Request(parser.get_method().decode(), self._target, headers, keep_alive=parser.should_keep_alive())
        self._request = request
        if self._is_proxied:
            take_forwarded(request)
        try:
            if len(headers) != len(fields):
                request.headers = headers = fields_by_name(fields)
            if b"host" not in headers:
                require_old_version(parser.get_http_version())
            self._admit(request)
            if b"content-length" in headers:  # digits only: the parser has seen to that
                require_bounded(int(headers[b"content-length"]))
        except Problem as problem:
            self._refuse_one(request, problem)
            return
        if b"expect" in headers and headers[b"expect"].lower() == b"100-continue" and not self._is_busy():
            self._transport.write(_CONTINUE)

    def on_body(self, body: bytes) -> None:
        """Keep content, or drop what nobody wants."""
        request = self._request
        if request is None or self._is_refused:
            self._dropped += len(body)
            if self._dropped > _DRAINED:
                raise Problem(413, f"the content exceeds {BODY_LIMIT} octets")
            return
        self._content += body
        self._hold(len(body))
        try:
            require_bounded(len(self._content))
            if self._port.is_full():
                raise _full()
        except Problem as problem:
            self._refuse_one(request, problem)

    def on_message_complete(self) -> None:
        """Hand the request over, and be ready for the next."""
        request, refused = self._request, self._is_refused
        self._has_begun = self._is_refused = False
        self._in_head = True
        self._head_octets = 0
        self._target = b""
        self._fields = []
        self._request = None
        if self._arriving:
            self._hold(-self._arriving)
            self._arriving = 0
        if request is None or refused:
            self._dropped = 0
            if not self._is_busy():
                self.due = self._now() + self._port.keep_alive
            return
        if self._content:
            request.body = bytes(self._content)
            self._content.clear()
        self._queue(request, None)

    # Answers, in the order of the requests

    def _is_busy(self) -> bool:
        return self._task is not None or self._stalled or bool(self._waiting)

    def _queue(self, request: Request, response: Response | None) -> None:
        """Answer a request, or let it wait its turn; ``response`` is set where it has been refused already."""
        if self._leaving:
            return  # it follows one that was to be the last
        if not self._is_busy():
            self._serve(request, response)
            return
        weight = _weight(request)
        self._hold(weight)
        if response is None and self._port.is_full():
            response = described(_full(), request.headers.get(b"accept"))
        self._waiting.append((request, response, weight))
        if not self._stalled:
            self.due = _NEVER
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
            self.due = _NEVER
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
            self.due = self._now() + (self._port.patience if self._has_begun else self._port.keep_alive)

    def _write(self, request: Request, response: Response) -> None:
        """Write an answer whole.

        ``Server-Timing: app;dur=MS`` is the time from the complete head of the request to the answer, in milliseconds
        (W3C Server Timing), by which a load test tells the robot's part from the network's.
        """
        if request.body:
            self._hold(-len(request.body))
        keep_alive = request.keep_alive and not self._port.is_stopping
        took = (perf_counter() - request.began) * 1000
        self._transport.write(
            b"%b%bserver-timing: app;dur=%.3f\r\n%b\r\n%b"
            % (
                response.head,
                self._port.date,
                took,
                b"" if keep_alive else b"connection: close\r\n",
                b"" if request.method == "HEAD" else response.body,
            )
        )
        if not keep_alive:
            self._leave()
        elif not self._has_begun and not self._stalled:
            self.due = self._now() + self._port.keep_alive

    # The ends

    def _refuse_one(self, request: Request, problem: Problem) -> None:
        """Refuse a request whose content is still to come."""
        self._is_refused = True
        self._hold(-len(self._content))
        self._content.clear()
        self._queue(request, described(problem, request.headers.get(b"accept")))

    def _refuse(self, problem: Problem) -> None:
        """Refuse what is no request, or too long a one, and read no more."""
        if self._leaving:
            return
        if self._is_refused:  # it has its answer
            self._leave()
            return
        self._has_begun = True
        self._queue(Request("", b"/", {}, keep_alive=False), described(problem, None))
        self._leaving = True

    def _leave(self) -> None:
        """Close once everything is written; whoever is still sending gets the time to read the answer.

        Closing at once with octets unread would reset the connection, and the answer with it (RFC 9112 9.6).
        """
        lingers = self._has_begun and not self._ended
        self._leaving = True
        self._waiting.clear()
        if lingers:
            if self._transport.can_write_eof():  # TLS cannot: there the client goes, or its time is up
                self._transport.write_eof()
            self.due = self._now() + _LINGER
        else:
            self._close()

    def _close(self) -> None:
        self._leaving = True
        self._transport.close()
        self.due = self._now() + self._port.patience

    def expire(self) -> None:
        """End what is overdue; a client that is still sending is told so by a 408 (RFC 9110 15.5.9)."""
        if self._transport.is_closing() or self._stalled:
            self._reset()
        elif self._has_begun and not self._leaving:
            self._refuse(Problem(408, "the request took too long to arrive"))
        else:
            self._close()

    def stop(self) -> None:
        """Close, unless an answer is under way: that is the connection's last."""
        if not self._is_busy():
            self._close()

    def abort(self) -> None:
        """Drop the connection, and what the robot works on for it."""
        if self._task is not None:
            self._task.cancel()
        self._transport.abort()

    def _reset(self) -> None:
        """Drop the connection, and with it what the kernel would keep for minutes for a client that does not read."""
        with contextlib.suppress(OSError):  # it may be closed, but for the word of it
            self._transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _NO_LINGER)
        self._transport.abort()

    def _pause_reading(self) -> None:
        if self._reading and not self._leaving:
            self._reading = False
            self.due = _NEVER
            self._transport.pause_reading()

    def _hold_arriving(self) -> None:
        """Count what there is of a request that is not complete; its content counts by itself."""
        if self._in_head:
            if not self._head_octets:  # it began in the middle of a segment
                self._head_octets = len(self._target) + sum(len(name) + len(value) for name, value in self._fields)
            if self._head_octets > HEAD_LIMIT:
                self._refuse(head_too_large())
                return
        weight = self._head_octets + _FIELD * len(self._fields)
        self._hold(weight - self._arriving)
        self._arriving = weight
        if self._in_head and self._port.is_full():
            self._refuse(_full())

    def _hold(self, octets: int) -> None:
        self._held += octets
        self._port.held.octets += octets


def _weight(request: Request) -> int:
    """Return what the head of a request takes, in octets."""
    fields = request.headers.items()
    return len(request.path) + len(request.query) + sum(_FIELD + len(name) + len(value) for name, value in fields)


def _full() -> Problem:
    return not_yet("clients make the robot keep as much as it can")
