"""One HTTP connection: parses requests and enforces limits; the base class writes the responses in order.

The class is an ``asyncio.Protocol`` on httptools' parser. A resource gets a request only when its body is complete.
These limits keep clients from exhausting the robot:

- Sizes: of the request target, the head, the body, the data dropped after a refusal, and all data that is kept for
  clients: incomplete requests, waiting requests, and responses that a client does not read.
- Times: ``due`` is the deadline for the client's next step, such as sending a request or reading responses. Only while
  the robot works on a response is there no deadline.
- Waiting requests: when too many wait on a connection, or while the client does not read, nothing more is read.

``answering`` contains the base class. Inheritance is used because calls to a separate object, several for each request,
would cost time.
"""

import asyncio
from typing import Final, cast

from httptools import HttpParserCallbackError, HttpParserError, HttpRequestParser

from reference_robot.webservices.http.answering import FIELD_BYTES, AnsweringConnection
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
)
from reference_robot.webservices.representation.problems import Problem, not_yet

_DRAINED: Final = 16 * BODY_LIMIT  # bytes of a refused body that are dropped before the connection is closed
_UNREAD: Final = 16 * 1024  # bytes of unread responses at which a client counts as not reading
_CONTINUE: Final = b"HTTP/1.1 100 Continue\r\n\r\n"


class HttpConnection(AnsweringConnection):
    """A connection to one port that parses requests and answers them."""

    def __init__(self, port: Port) -> None:
        super().__init__(port)
        self._admit = port.interface.admit
        self._parser = HttpRequestParser(self)
        self._is_proxied = False  # the peer is a trusted proxy
        # The request that is being received
        self._in_head = True
        self._head_size = 0
        self._target = b""
        self._fields: list[Field] = []
        self._request: Request | None = None
        self._content: bytes | bytearray = b""
        self._is_refused = False  # the error response is sent, and the rest of the body is dropped
        self._dropped = 0
        self._arriving = 0  # bytes kept for this request

    # Callbacks of the transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Register the connection and start the deadline for its first request; refuse one connection too many."""
        self._transport = cast("asyncio.Transport", transport)
        self._transport.set_write_buffer_limits(_UNREAD)
        self._is_proxied = self._port.proxies.include(transport.get_extra_info("peername"))
        self.due = self._now() + self._port.patience
        if not self._port.add(self):
            self._refuse(not_yet("too many connections"))

    def data_received(self, data: bytes) -> None:
        """Feed received bytes to the parser; answer invalid requests with an error."""
        if self._leaving:
            return
        if self._in_head:
            if not self._has_begun:
                data = readable(data)
            self._head_size += len(data)
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

    # Callbacks of the parser; an exception stops it

    def on_message_begin(self) -> None:
        """Start the deadline for receiving the request that begins."""
        self._has_begun = True
        if not self._stalled:
            self.due = self._now() + self._port.patience

    def on_url(self, url: bytes) -> None:
        """Store a part of the request target; raise the Problem 414 if the target is too long."""
        self._target += url
        if len(self._target) > TARGET_LIMIT:
            raise Problem(414, f"the request target exceeds {TARGET_LIMIT} bytes")

    def on_header(self, name: bytes, value: bytes) -> None:
        """Store a header field; trailer fields are ignored."""
        if self._in_head:
            self._fields.append((name.lower(), value.rstrip()))

    def on_headers_complete(self) -> None:
        """Refuse a request with an invalid head; otherwise send 100 Continue if the client waits for that status."""
        fields = self._fields
        if self._head_size > HEAD_LIMIT and sum(len(name) + len(value) for name, value in fields) > HEAD_LIMIT:
            raise head_too_large()
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
            if b"content-length" in headers:  # digits only: the parser has checked that
                require_bounded(int(headers[b"content-length"]))
        except Problem as problem:
            self._refuse_one(request, problem)
            return
        if b"expect" in headers and headers[b"expect"].lower() == b"100-continue" and not self._is_busy():
            self._transport.write(_CONTINUE)

    def on_body(self, body: bytes) -> None:
        """Store a part of the body, or drop it if the request has been refused."""
        request = self._request
        if request is None or self._is_refused:
            self._dropped += len(body)
            if self._dropped > _DRAINED:
                raise Problem(413, f"the body exceeds {BODY_LIMIT} bytes")
            return
        if not self._content:
            self._content = body  # usually the whole body
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
        """Answer or queue the complete request, and prepare for the next one."""
        request, refused = self._request, self._is_refused
        self._has_begun = self._is_refused = False
        self._in_head = True
        self._head_size = 0
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

    # The end of the connection

    def _refuse_one(self, request: Request, problem: Problem) -> None:
        """Answer a request with an error before its body is complete; the rest of the body will be dropped."""
        self._is_refused = True
        self._content = b""
        self._queue(request, described(problem, request.headers.get(b"accept")))

    def _refuse(self, problem: Problem) -> None:
        """Answer bytes that are not a valid request with an error, and read nothing more."""
        if self._leaving:
            return
        if self._is_refused:  # the error response has been sent
            self._leave()
            return
        self._has_begun = True
        self._queue(Request("", b"/", {}, keep_alive=False), described(problem, None))
        self._leaving = True

    def expire(self) -> None:
        """End the connection because ``due`` has passed; answer 408 if a request is incomplete (RFC 9110 15.5.9)."""
        if self._transport.is_closing() or self._stalled:
            self._reset()
        elif self._has_begun and not self._leaving:
            self._refuse(Problem(408, "the request took too long to arrive"))
        else:
            self._close()

    def _hold_arriving(self) -> None:
        """Count the memory of the incomplete request; refuse the request if its head is too large or memory is full."""
        if self._in_head:
            if not self._head_size:  # the head began in the middle of a segment
                self._head_size = len(self._target) + sum(len(name) + len(value) for name, value in self._fields)
            if self._head_size > HEAD_LIMIT:
                self._refuse(head_too_large())
                return
        weight = self._head_size + FIELD_BYTES * len(self._fields) + len(self._content)
        self._hold(weight - self._arriving)
        self._arriving = weight
        if self._in_head and self._port.is_full():
            self._refuse(full())
