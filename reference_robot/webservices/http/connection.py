"""One HTTP connection: parses requests and enforces limits; the base class writes the responses in order.

The class is an ``asyncio.Protocol`` on httptools' parser. A resource gets a request only when its body is complete.
These limits keep clients from exhausting the robot:

- Sizes: of the request target, the head, the body, the data dropped after a refusal, and all data that is kept for
  clients: incomplete requests, waiting requests, and responses that a client does not read.
- Times: ``allowed`` is the time for the client's next step, such as sending a request or reading responses. Only while
  the robot works on a response is there no limit. Who has shown no valid token gets less time.
- Waiting requests: when too many wait on a connection, or while the client does not read, nothing more is read.

``answering`` and ``pacing`` contain the base classes. Inheritance is used because calls to a separate object, several
for each request, would cost time.
"""

import asyncio
from typing import Final, cast

from httptools import HttpParserCallbackError, HttpParserError, HttpParserUpgrade, HttpRequestParser

from reference_robot.webservices.http.answering import (
    DRAINED,
    FIELD_BYTES,
    FRAMING_FIELDS,
    FRAMING_LIMIT,
    FRAMING_PER_BYTE,
    HEAD_LIMIT,
    TARGET_LIMIT,
    PacedConnection,
    fields_by_name,
    framing_too_large,
    full,
    head_too_large,
    no_request,
    readable,
    require_bounded,
    require_head,
    require_old_version,
)
from reference_robot.webservices.http.crowd import Client
from reference_robot.webservices.http.hosts import take_forwarded
from reference_robot.webservices.http.interface import problem_response
from reference_robot.webservices.http.messages import BODY_LIMIT, Field, Request
from reference_robot.webservices.http.port import Port
from reference_robot.webservices.representation.problems import Problem, not_yet

_UNREAD: Final = 16 * 1024  # bytes of unread responses at which a client counts as not reading
_CONTINUE: Final = b"HTTP/1.1 100 Continue\r\n\r\n"


class HttpConnection(PacedConnection):
    """A connection to one port that parses requests and answers them."""

    __slots__ = (
        "_admit",
        "_after_head",
        "_arriving",
        "_content",
        "_fields",
        "_handshake",
        "_head_size",
        "_in_head",
        "_is_proxied",
        "_is_refused",
        "_is_stopped",
        "_parser",
        "_request",
        "_target",
    )

    def __init__(self, port: Port, handshake: Client | None = None) -> None:
        """Create a connection; ``handshake`` is the TLS handshake whose place in the port it takes."""
        super().__init__(port)
        self._handshake = handshake
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
        self._after_head = 0  # bytes in the segments after the one in which the head ended
        self._arriving = 0  # bytes kept for this request
        self._is_stopped = False  # the parser stops after this head

    # Callbacks of the transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Register the connection and start the deadline for its first request; refuse one connection too many."""
        self._transport = cast("asyncio.Transport", transport)
        self._transport.set_write_buffer_limits(_UNREAD)
        peer = transport.get_extra_info("peername")
        self._is_proxied = self._port.proxies.include(peer)
        self._allow(self._port.unknown_patience)
        if self._handshake is not None:
            self._port.replace(self._handshake, self)
        elif not self._port.add(self, peer):
            if self._port.is_overrun():
                self.give_way()
            else:
                self._refuse(not_yet("too many connections"))

    def _take(self, data: bytes) -> None:
        """Feed received bytes to the parser; answer invalid requests with an error."""
        if self._in_head:
            if not self._has_begun:
                data = readable(data)
            self._head_size += len(data)
        else:
            self._after_head += len(data)
        try:
            self._parser.feed_data(data)
        except HttpParserUpgrade as stopped:
            self._ignore_upgrade(data[stopped.args[0] :])
        except HttpParserCallbackError as error:
            problem = error.__context__
            self._refuse(problem if isinstance(problem, Problem) else no_request(problem or error))
        except HttpParserError as error:
            self._refuse(no_request(error))
        else:
            if self._has_begun:
                self._hold_arriving()
                if self._after_head > FRAMING_LIMIT + FRAMING_PER_BYTE * (len(self._content) + self._dropped):
                    self._refuse(framing_too_large())

    def _ignore_upgrade(self, rest: bytes) -> None:
        """Continue after the head of a request that offers an upgrade, or of CONNECT (RFC 9110 7.8).

        The parser stops there, because data of another protocol may follow. The robot supports none. So a new parser
        gets a head that has only the framing of the request's body, and then what follows. Java's HttpClient offers h2c
        with every first request.
        """
        self._parser = HttpRequestParser(self)
        headers = self._request.headers if self._request is not None else {}
        framing = [b"%b: %b\r\n" % (name, headers[name]) for name in FRAMING_FIELDS if name in headers]
        self._parser.feed_data(b"POST / HTTP/1.1\r\nhost: a\r\n%b\r\n" % b"".join(framing))
        self._take(rest)

    # Callbacks of the parser; an exception stops it

    def on_message_begin(self) -> None:
        """Note that a request is being received; its deadline starts when its first segment does not contain all."""
        self._has_begun = True

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
        if self._is_stopped:  # this is the second head, of the framing alone
            self._is_stopped = False
            return
        fields, parser = self._fields, self._parser
        headers, keep_alive = dict(fields), parser.should_keep_alive()
        # HTTP/1.1 is kept alive without a Connection field. To ask for the version takes long.
        if (
            not keep_alive
            or b"connection" in headers
            or b"transfer-encoding" in headers
            or self._head_size > HEAD_LIMIT
        ):
            require_head(parser.get_http_version(), fields)
        self._in_head = False
        self._is_stopped = parser.should_upgrade()
        request = Request(parser.get_method().decode(), self._target, headers, keep_alive=keep_alive)
        self._request = request
        if self._is_proxied:
            take_forwarded(request)
        try:
            if len(headers) != len(fields):
                request.headers = headers = fields_by_name(fields)
            if b"host" not in headers:
                require_old_version(parser.get_http_version())
            self._admit(request)
            if not self.is_known:
                self._become_known()
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
            if self._dropped > DRAINED:
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
            if self._port.is_full_for(len(self._content)):
                raise full()
        except Problem as problem:
            self._refuse_one(request, problem)

    def on_message_complete(self) -> None:
        """Answer or queue the complete request, and prepare for the next one."""
        if self._is_stopped:
            return
        request, refused = self._request, self._is_refused
        self._has_begun = self._is_refused = False
        self._in_head = True
        self._head_size = self._after_head = 0
        self._target = b""
        self._fields = []
        self._request = None
        if self._arriving:
            self._hold(-self._arriving)
            self._arriving = 0
        if request is None or refused:
            self._dropped = 0
            if not self._is_busy():
                self._allow_next()
            return
        if self._content:
            request.body = bytes(self._content)
            self._content = b""
        self._queue(request, None)

    def _become_known(self) -> None:
        """Give the client of the first request that has passed the access check more time for its body."""
        self.is_known = True
        if not self._stalled:
            self._allow(self._port.patience)

    # The end of the connection

    def _refuse_one(self, request: Request, problem: Problem) -> None:
        """Answer a request with an error before its body is complete; the rest of the body will be dropped."""
        self._is_refused = True
        self._dropped += len(self._content)
        self._content = b""
        self._queue(request, problem_response(problem, request.headers.get(b"accept")))

    def _refuse(self, problem: Problem) -> None:
        """Answer bytes that are not a valid request with an error, and read nothing more."""
        if self._leaving:
            return
        if self._is_refused:  # the error response has been sent
            self._leave()
            return
        self._has_begun = True
        self._queue(Request("", b"/", {}, keep_alive=False), problem_response(problem, None))
        self._leaving = True

    def expire(self) -> None:
        """End the connection because the client's time has passed; answer 408 to half a request (RFC 9110 15.5.9)."""
        if self._transport.is_closing() or self._stalled:
            self._reset()
        elif self._has_begun and not self._leaving:
            self._refuse(Problem(408, "the request took too long to arrive"))
        else:
            self._close()

    def _hold_arriving(self) -> None:
        """Count the memory of the incomplete request; refuse the request if its head is too large or memory is full."""
        if not self._arriving and not self._stalled and not self._leaving:
            self._allow(self._port.patience if self.is_known else self._port.unknown_patience)
        if self._in_head:
            if not self._head_size:  # the head began in the middle of a segment
                self._head_size = len(self._target) + sum(len(name) + len(value) for name, value in self._fields)
            if self._head_size > HEAD_LIMIT:
                self._refuse(head_too_large())
                return
        weight = self._head_size + FIELD_BYTES * len(self._fields) + len(self._content)
        self._hold(weight - self._arriving)
        self._arriving = weight
        if self._in_head and self._port.is_full_for(weight):
            self._refuse(full())
