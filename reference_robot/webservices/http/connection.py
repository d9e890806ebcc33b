"""One connection: octets in, requests answered in their order, octets out.

An ``asyncio.Protocol`` on httptools' parser. The content is complete before a resource sees its request. What keeps
strangers from using the robot up:

- sizes: of the target, of the head, of the content, of what is read and dropped after a refusal; and of all that
  clients make the robot keep: half a request, one that waits, an answer that nobody reads;
- times: ``due`` is when the client must have moved on, whatever it is about: sending a request, reading answers, asking
  for something. There is no state of a connection without it but one: the robot works on an answer;
- turns: so many requests may wait on a connection; then no more is read from it, nor while the client does not read.

Answers and turns are in ``answering``. A base class and not an object of its own: a call through one would be made
several times for each request.
"""

import asyncio
from typing import Final, cast

from httptools import HttpParserCallbackError, HttpParserError, HttpRequestParser

from reference_robot.webservices.http.answering import FIELD_OCTETS, AnsweringConnection
from reference_robot.webservices.http.interface import described
from reference_robot.webservices.http.messages import BODY_LIMIT, Field, Request
from reference_robot.webservices.http.port import Port
from reference_robot.webservices.http.proxies import take_forwarded
from reference_robot.webservices.http.reading import (
    HEAD_LIMIT,
    TARGET_LIMIT,
    fields_by_name,
    full,
    head_too_large,
    no_request,
    readable,
    require_bounded,
    require_old_version,
    require_short_head,
)
from reference_robot.webservices.representation.problems import Problem, not_yet

_DRAINED: Final = 16 * BODY_LIMIT  # octets of refused content that are dropped before the line is cut
_UNREAD: Final = 16 * 1024  # octets of answers that wait for the client before it counts as one that does not read
_CONTINUE: Final = b"HTTP/1.1 100 Continue\r\n\r\n"


class HttpConnection(AnsweringConnection):
    """A connection to one port, and the half of it that makes requests of octets."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._admit = port.interface.admit
        self._parser = HttpRequestParser(self)
        self._is_proxied = False  # by a proxy that is trusted
        # The request that arrives
        self._in_head = True
        self._head_octets = 0
        self._target = b""
        self._fields: list[Field] = []
        self._request: Request | None = None
        self._content: bytes | bytearray = b""
        self._is_refused = False  # it has its answer, and its content is dropped
        self._dropped = 0
        self._arriving = 0  # octets that are held for it

    # The transport's side

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Start the clock: a client that connects must also ask."""
        self._transport = cast("asyncio.Transport", transport)
        self._transport.set_write_buffer_limits(_UNREAD)
        self._is_proxied = self._port.proxies.include(transport.get_extra_info("peername"))
        self.due = self._now() + self._port.patience
        if not self._port.add(self):
            self._refuse(not_yet("too many connections"))

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
        if not self._content:
            self._content = body  # all of it, as a rule
        else:
            if isinstance(self._content, bytes):
                self._content = bytearray(self._content)
            self._content += body
        try:
            require_bounded(len(self._content))
            if self._port.is_full():
                raise full()
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
            self._content = b""
        self._queue(request, None)

    # The ends

    def _refuse_one(self, request: Request, problem: Problem) -> None:
        """Refuse a request whose content is still to come."""
        self._is_refused = True
        self._content = b""
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

    def expire(self) -> None:
        """End what is overdue; a client that is still sending is told so by a 408 (RFC 9110 15.5.9)."""
        if self._transport.is_closing() or self._stalled:
            self._reset()
        elif self._has_begun and not self._leaving:
            self._refuse(Problem(408, "the request took too long to arrive"))
        else:
            self._close()

    def _hold_arriving(self) -> None:
        """Count what there is of a request that is not complete."""
        if self._in_head:
            if not self._head_octets:  # it began in the middle of a segment
                self._head_octets = len(self._target) + sum(len(name) + len(value) for name, value in self._fields)
            if self._head_octets > HEAD_LIMIT:
                self._refuse(head_too_large())
                return
        weight = self._head_octets + FIELD_OCTETS * len(self._fields) + len(self._content)
        self._hold(weight - self._arriving)
        self._arriving = weight
        if self._in_head and self._port.is_full():
            self._refuse(full())
