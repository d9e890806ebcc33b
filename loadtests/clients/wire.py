"""The wire client: one lean HTTP/1.1 client for both interfaces.

REST and SOAP take the same path: a request built beforehand is sent in one call, and llhttp (httptools) parses the
response as it arrives. Locust's FastHttpUser (geventhttpclient) took 190 us a request where this client takes 50, and
it retries GET and PUT when a connection drops; both would be reported as the robot's. The gain comes from a read
watcher that lives as long as the connection: no EAGAIN probe and no epoll_ctl for each request. When the robot closes
an idle connection, the watcher notices, so that the next request opens a new one instead of failing. A request is never
sent twice.
"""

import ssl
import time
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

import gevent
import gevent.socket
import httptools
from gevent.hub import Waiter, get_hub

from conformance.transport.codings import content_of
from conformance.transport.credentials import Credentials, UsernameToken
from loadtests.clients.endpoint import Endpoint
from loadtests.clients.failures import CallError, Declared, Reply, connect_error, require_good

_READ = 1  # libev's EV_READ
_CHUNK = 65_536
_IDLE_NS = 500_000_000  # servers close idle connections after seconds: look before sending into one
_FINAL = int(HTTPStatus.OK)  # RFC 9110 section 15.2: what is below is interim
_CHALLENGE = int(HTTPStatus.UNAUTHORIZED)
_MAX_ANSWER = 16 * 1024 * 1024  # an endless response must not fill the generator's memory
_MAX_INTERIM = 100

now_ns = time.monotonic_ns  # CLOCK_MONOTONIC, the clock of timerfd


@dataclass(frozen=True, slots=True)
class Request:
    """A request as bytes, and its good responses: bytes that bodies must contain, or declared responses."""

    octets: bytes
    expects: bytes | Declared | Reply = b""


@dataclass(slots=True)
class Answer:
    """A response, and when it arrived.

    Attributes:
        body: without its content coding.
        received_ns: when the last byte was read.
        octets: size of headers and body.
    """

    status: int
    headers: dict[bytes, bytes]
    body: bytes
    received_ns: int
    octets: int

    def require_good(self, expects: bytes | Declared | Reply) -> None:
        """Accept a 2xx response whose body contains `expects`, or a response that is declared.

        Raises:
            CallError: any other response.
        """
        found = self.headers.get(b"location")
        location = found.decode("latin-1") if found else None
        if isinstance(expects, bytes):
            require_good(self.status, location, self.body, expects)
        else:
            expects.require(self.status, location, self.headers.get(b"content-type"), self.body)


class Connection:
    """A persistent connection to one endpoint, for one request at a time.

    Args:
        endpoint: the server.
        timeout_s: deadline of a whole request, including the connection.
        tls: the context for https endpoints.
        digest: what answers the challenges of digest authentication; the connections of a process share it.
        user: whose UsernameToken, a fresh one, each SOAP message carries.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        timeout_s: float,
        tls: ssl.SSLContext | None = None,
        digest: Credentials | None = None,
        user: UsernameToken | None = None,
    ) -> None:
        self.endpoint = endpoint
        self.timeout_s = timeout_s
        self.tls = tls
        self.digest = digest
        self.user = user
        self.connects = 0
        self._socket: Any = None
        self._watcher: Any = None
        self._parser: Any = None
        self._waiter: Waiter | None = None
        self._drop_after = False
        self._received = 0
        self._reset()

    def _reset(self) -> None:
        self._headers: dict[bytes, bytes] = {}
        self._body: list[bytes] = []
        self._octets = 0
        self._complete = False
        self._excess = False
        self._interim = 0
        self._framed = False

    def call(self, request: Request) -> Answer:
        """Send a request and wait for the complete response.

        Raises:
            CallError: of any kind; the request was sent at most once, with digest authentication twice.
        """
        deadline = gevent.Timeout.start_new(self.timeout_s)
        try:
            octets = request.octets if self.user is None else self.user.reveal(request.octets)
            return self._call(octets) if self.digest is None else self._answering(octets, self.digest)
        except gevent.Timeout as timer:
            connected = self._socket is not None
            self.close()
            if timer is not deadline:
                raise
            if not connected:
                raise connect_error(TimeoutError(), self.endpoint.url) from None
            raise CallError("timeout", f"no complete response within {self.timeout_s:g} s") from None
        except BaseException:
            self.close()
            raise
        finally:
            deadline.close()

    def _answering(self, octets: bytes, digest: Credentials) -> Answer:
        """Send a request with an answer to the robot's challenge, and again if it has a new challenge."""
        answer = self._call(digest.reveal(octets))
        challenge = answer.headers.get(b"www-authenticate", b"").decode("latin-1")
        if answer.status == _CHALLENGE and digest.learn([("www-authenticate", challenge)]):
            return self._call(digest.reveal(octets))
        return answer

    def _call(self, octets: bytes) -> Answer:
        if self._socket is not None and now_ns() - self._received > _IDLE_NS and self._is_closed():
            self.close()
        if self._socket is None:
            self._open()
        self._reset()
        waiter = self._waiter = Waiter()
        try:
            self._send(octets)
            failure = waiter.get()
        finally:
            self._waiter = None
        if failure is not None:
            raise failure
        status = self._parser.get_status_code()
        coding = (self._headers.get(b"content-encoding") or b"").decode("latin-1")
        body = content_of(b"".join(self._body), coding, is_whole=True).octets
        answer = Answer(status, self._headers, body, self._received, self._octets)
        if self._drop_after:
            self.close()
        return answer

    def _is_closed(self) -> bool:
        """Return whether the robot has closed an idle connection, which the busy loop has not noticed yet."""
        try:
            return not self._socket.recv(1, gevent.socket.MSG_PEEK) if self.endpoint.scheme == "http" else False
        except BlockingIOError:
            return False
        except OSError:
            return True

    def _open(self) -> None:
        where = self.endpoint.url
        try:
            plain = gevent.socket.create_connection((self.endpoint.host, self.endpoint.port), self.timeout_s)
        except OSError as error:
            raise connect_error(error, where) from None
        try:
            plain.setsockopt(gevent.socket.IPPROTO_TCP, gevent.socket.TCP_NODELAY, 1)
            if self.endpoint.scheme == "https":
                if self.tls is None:
                    raise CallError("tls", f"{where}: no TLS context")
                plain = self.tls.wrap_socket(plain, server_hostname=self.endpoint.host)
            plain.settimeout(0.0)
        except OSError as error:
            plain.close()
            raise connect_error(error, where) from None
        self._socket = plain
        self._parser = httptools.HttpResponseParser(self)
        self._drop_after = False
        self.connects += 1
        self._watcher = get_hub().loop.io(plain.fileno(), _READ)
        self._watcher.start(self._readable)

    def _send(self, octets: bytes) -> None:
        try:
            try:
                sent = self._socket.send(octets)
            except (BlockingIOError, ssl.SSLWantWriteError):
                sent = 0
            if sent < len(octets):  # the socket's buffer is full: wait for room
                self._socket.settimeout(self.timeout_s)
                self._socket.sendall(octets[sent:])
                self._socket.settimeout(0.0)
        except OSError as error:
            raise CallError("closed", f"the robot closed the connection while the request was sent: {error}") from None

    def _readable(self) -> None:
        """Read the bytes that have arrived. Runs in gevent's hub: must neither wait nor raise."""
        failure: CallError | None = None
        try:
            failure = self._take_in()
        except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            pass  # a TLS record without data
        except httptools.HttpParserCallbackError as error:
            context = error.__context__
            failure = context if isinstance(context, CallError) else CallError("malformed", str(error))
        except httptools.HttpParserError as error:
            failure = CallError("malformed", f"the response is not HTTP: {error}")
        except OSError as error:
            failure = CallError("closed", f"the robot reset the connection: {error.strerror or error}")
        waiter = self._waiter
        if failure is not None:
            self.close()
        if waiter is not None and (self._complete or failure is not None):
            self._waiter = None
            waiter.switch(failure)

    def _take_in(self) -> CallError | None:
        """Feed received bytes to the parser; return the error if the response is malformed."""
        while True:
            data = self._socket.recv(_CHUNK)
            self._received = now_ns()
            if self._waiter is None:
                return CallError("closed", "the robot closed an idle connection, or sent bytes without a request")
            if not data:
                return self._end()
            self._octets += len(data)
            if self._octets > _MAX_ANSWER:
                return CallError("malformed", f"the response is longer than {_MAX_ANSWER} bytes")
            self._parser.feed_data(data)
            if self._excess:
                return CallError("malformed", "the robot sent more after its response, which no request was sent for")
            if self._complete or self.endpoint.scheme == "http":  # TLS may hold more than the socket shows
                return None

    def _end(self) -> CallError | None:
        """Handle the robot's close: a response without a length ends here (RFC 9112 section 6.3), any other is cut."""
        if self._octets and self._headers and not self._framed and not self._complete:
            self._complete = True
            self._drop_after = True
            return None
        return CallError("closed", f"the robot closed the connection after {self._octets} bytes of a response")

    # Callbacks of llhttp.

    def on_message_begin(self) -> None:
        """Mark that another message follows a complete response: it belongs neither to it nor to the next request."""
        self._excess = self._complete

    def on_header(self, name: bytes, value: bytes) -> None:
        """Keep a header field; names are case-insensitive (RFC 9110 section 5.1)."""
        name = name.lower()
        if name == b"www-authenticate" and name in self._headers:  # several challenges make one list
            value = self._headers[name] + b", " + value
        self._headers[name] = value
        if name in {b"content-length", b"transfer-encoding"}:
            self._framed = True

    def on_body(self, body: bytes) -> None:
        """Keep a piece of the body."""
        self._body.append(body)

    def on_message_complete(self) -> None:
        """Note the end of a response; an interim response (1xx) is skipped."""
        if self._parser.get_status_code() < _FINAL:
            self._headers = {}
            self._interim += 1
            if self._interim > _MAX_INTERIM:
                raise CallError("malformed", f"more than {_MAX_INTERIM} interim responses (1xx) before a final one")
            return
        self._complete = True
        self._drop_after = not self._parser.should_keep_alive()

    def close(self) -> None:
        """Close; the next call opens a new connection."""
        if self._watcher is not None:
            self._watcher.stop()
            self._watcher.close()
            self._watcher = None
        if self._socket is not None:
            self._socket.close()
            self._socket = None
