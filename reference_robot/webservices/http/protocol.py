"""What a connection may do before any resource sees its request.

uvicorn on httptools parses and times nothing here by itself: the length of a request's head, how long a client takes
to send it, a method that nobody registered. This protocol bounds the first two and answers all three as the contract
says.
"""

import contextlib
import re
from asyncio import Transport
from typing import Any, Final

from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol, RequestResponseCycle

from reference_robot.webservices.http.messages import BODY_LIMIT
from reference_robot.webservices.representation.problems import PROBLEM_JSON, Problem

TARGET_LIMIT: Final = 8000  # octets (RFC 9110 4.1 asks for at least that)
HEAD_LIMIT: Final = 64 * 1024  # octets: request line and fields (RFC 6585 5)
_LINGER: Final = 2.0  # seconds in which what a refused client still sends is read and dropped
_DRAINED: Final = 16 * BODY_LIMIT  # octets of content beyond the limit that are dropped before the line is cut

_FINAL_HEADS: Final = tuple(b"HTTP/1.1 %d" % kind for kind in (2, 3, 4, 5))
_SERVED: Final = (b"GET ", b"PUT ", b"POST ", b"DELETE ", b"HEAD ", b"OPTIONS ")
_UPGRADE: Final = re.compile(rb"(?i)(?<=\r\n)Upgrade(?=:)")
_METHOD: Final = re.compile(rb"[!#$%&'*+.^_`|~0-9A-Za-z-]++(?= [^ \r\n]+ HTTP/1\.[01]\r?\n)")


class _OneWriteTransport:
    """A transport on which the head of an answer waits for its content, so that both leave in one write.

    uvicorn writes them apart, which costs a second system call and often a second packet for each answer.
    """

    def __init__(self, transport: Transport) -> None:
        self._write, self._close = transport.write, transport.close
        self._head = b""
        # The rest is the transport's own.
        self.abort, self.is_closing, self.get_extra_info = (
            transport.abort,
            transport.is_closing,
            transport.get_extra_info,
        )
        self.pause_reading, self.resume_reading = transport.pause_reading, transport.resume_reading
        self.can_write_eof, self.write_eof = transport.can_write_eof, transport.write_eof

    def write(self, data: bytes) -> None:
        """Write, unless it is the head of a final answer."""
        if self._head:
            data, self._head = self._head + data, b""
        elif data.startswith(_FINAL_HEADS):
            self._head = data
            return
        self._write(data)

    def flush(self) -> None:
        """Write a head that still waits: its answer has no content."""
        if self._head:
            self._write(self._head)
            self._head = b""

    def close(self) -> None:
        """Close once everything is written."""
        self.flush()
        self._close()


class RobotHttpProtocol(HttpToolsProtocol):
    """One connection of either interface."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._one_write: _OneWriteTransport
        self._busy_since: float | None = None
        self._head_octets = 0
        self._reading_head = True
        self._body_octets = 0
        self._refusal: Problem | None = None
        self._lingering = False

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]  # as uvicorn narrows it
        """Start the clock: a client that connects must also ask."""
        self._one_write = _OneWriteTransport(transport)
        super().connection_made(self._one_write)  # type: ignore[arg-type]  # all of a transport that uvicorn uses
        self._busy_since = self.loop.time()

    def data_received(self, data: bytes) -> None:
        """Take octets, as many as a head may have."""
        if self._lingering:
            return
        if self._reading_head:
            if self._head_octets == 0:
                data = _without_upgrade(self._served_method(data))
            self._head_octets += len(data)
        super().data_received(data)
        if self._reading_head and self._head_octets > HEAD_LIMIT and not self._lingering:
            self._refusal = Problem(431, f"the head of the request exceeds {HEAD_LIMIT} octets")
            self.send_400_response("")

    def _served_method(self, data: bytes) -> bytes:
        """Return the data with a method that no resource offers replaced by TRACE, which is one of them.

        The parser refuses methods that it does not know; so they get what every unsupported method gets: 405, or 404
        (RFC 9110 15.5.6).
        """
        if data.startswith(_SERVED):
            return data
        method = _METHOD.match(data)
        return data if method is None else b"TRACE" + data[method.end() :]

    def on_message_begin(self) -> None:
        """Start the clock for a request."""
        super().on_message_begin()
        self._busy_since = self.loop.time()
        self._body_octets = 0

    def on_url(self, url: bytes) -> None:
        """Bound the request target."""
        super().on_url(url)
        if len(self.url) > TARGET_LIMIT:
            self._refuse(Problem(414, f"the request target exceeds {TARGET_LIMIT} octets"))

    def on_headers_complete(self) -> None:
        """Bound the fields."""
        if self._head_octets > HEAD_LIMIT and self._fields_octets() > HEAD_LIMIT:
            self._refuse(Problem(431, f"the head of the request exceeds {HEAD_LIMIT} octets"))
        self._reading_head = False
        super().on_headers_complete()

    def _fields_octets(self) -> int:
        """Return the size of the fields alone: the octets counted so far may hold content as well."""
        return sum(len(name) + len(value) for name, value in self.headers)

    def on_body(self, body: bytes) -> None:
        """Bound what is read of content that nobody wants."""
        self._body_octets += len(body)
        if self._body_octets > _DRAINED:
            self._refuse(Problem(413, f"the content exceeds {BODY_LIMIT} octets"))
        super().on_body(body)

    def on_message_complete(self) -> None:
        """Stop the clock: from here on, the robot is what takes its time."""
        self._busy_since = None
        self._reading_head = True
        self._head_octets = 0
        super().on_message_complete()

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: Any) -> None:
        """Answer at once what never waits, and spare it the task and its turn in the event loop.

        Not while earlier requests of the connection are pending: each would be answered within the other.
        """
        if self.pipeline or self.flow.write_paused or not app.never_waits(cycle.scope):
            super()._start_asgi_task(cycle, app)
            return
        with contextlib.suppress(StopIteration):
            cycle.run_asgi(app).send(None)

    def on_response_complete(self) -> None:
        """Let the head of an answer without content go."""
        self._one_write.flush()
        super().on_response_complete()

    def _refuse(self, problem: Problem) -> None:
        """Stop the parser, whose caller then sends the refusal: an exception is the only way out of its callback."""
        self._refusal = problem
        raise problem

    def send_400_response(self, msg: str) -> None:
        """Refuse what is no HTTP request, or too long a one, and let the client read the answer.

        Closing at once with octets unread would reset the connection, and the answer with it (RFC 9112 9.6).
        """
        problem = self._refusal or Problem(400, f"no valid HTTP request: {msg}")
        if self.cycle is not None and not self.cycle.response_complete:
            if self.cycle.response_started:
                self.transport.close()
                return
            self.cycle.disconnected = True  # whoever waits for the rest of this request need not answer it
            self.cycle.message_event.set()
        body = problem.written(PROBLEM_JSON)
        fields = [
            *self.server_state.default_headers,
            (b"content-type", PROBLEM_JSON.encode()),
            (b"content-length", b"%d" % len(body)),
            (b"connection", b"close"),
        ]
        head = b"".join(name + b": " + value + b"\r\n" for name, value in fields)
        self.transport.write(STATUS_LINE[problem.status] + head + b"\r\n")
        self.transport.write(body)
        self._lingering = True
        if self.transport.can_write_eof():
            self.transport.write_eof()
        self.loop.call_later(_LINGER, self.transport.close)

    def close_if_older(self, begun: float) -> None:
        """End the connection if its request began to arrive before that time of the loop and still does.

        Its sender is told so by a 408 (RFC 9110 15.5.9) as long as nobody works on the request yet.
        """
        if self._busy_since is None or self._busy_since > begun or self.transport.is_closing():
            return
        self._busy_since = None
        if self._head_octets and self._reading_head:
            self._refusal = Problem(408, "the request took too long to arrive")
            self.send_400_response("")
        else:
            self.transport.abort()


def _without_upgrade(data: bytes) -> bytes:
    """Return the beginning of a request with its Upgrade field under a name that says nothing.

    The robot upgrades to nothing and may ignore the field (RFC 9110 7.8), but the parser would take the content for
    another protocol's octets. Java's HttpClient asks for h2c with every first request.
    """
    if b"pgrade:" not in data:
        return data
    head, end, rest = data.partition(b"\r\n\r\n")
    return _UPGRADE.sub(b"X-Ignored-Upgrade", head) + end + rest
