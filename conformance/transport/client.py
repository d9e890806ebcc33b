"""The HTTP client of the suite. Every request has a deadline, is recorded, and is reported to listeners."""

import itertools
import math
import ssl
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol
from urllib.parse import urlsplit

import h11

from conformance.commandline.secret_file import IN_URL, names_user
from conformance.transport.connections import (
    ClientCertificate,
    ClosedError,
    Connections,
    Deadline,
    HttpConnection,
    NoConnectionError,
    explain,
    tls_context,
)
from conformance.transport.credentials import Credential, Credentials, bearer
from conformance.transport.exchange import (
    OF_GATEWAY,
    SAFE_METHODS,
    Exchange,
    Listener,
    NoAnswer,
    NoAnswerError,
    NotPermittedError,
    Request,
    Response,
    Sending,
    Unanswered,
    sendable,
)
from conformance.transport.pace import HANGS, Hangs, Overload, Pace, time_to_arrive
from conformance.transport.passage import Heard, Passage, Recorder
from conformance.transport.reach import Trust

Headers = tuple[tuple[str, str], ...]
# Called with method and URL; returns an empty text if the request may be sent, else why not.
Permit = Callable[[str, str], str]
_CHALLENGE = 401
# Times that a request is sent in all if it met the end of a kept connection.
_ATTEMPTS = 2
# Last requests that are kept.
_RECENT: Final = 60
_NOTHING_THERE: Final = 404
_CRASHED: Final = "the server closed the connection without a response, and accepts no other connection"


class BeforeSending(Protocol):
    """A function that a connection calls before each message."""

    def __call__(self, *requests: tuple[str, str]) -> None:
        """Prepare for a message with these requests: method and URL of each."""


@dataclass
class Connection:
    """The settings and counters that all HTTP clients of one run share.

    Attributes:
        timeout_s: deadline of one request with its response, s.
        ca_file: certificate authorities to trust instead of the system's, or None.
        token: bearer token, or None; it is one of the credentials.
        credentials: what every request carries.
        log_in: logs in, and returns the credential that this gives, the last of all; None if the run has no login.
        certificate: client certificate for TLS, or None.
        trust: the servers to which the credentials may go; None means to each that a client is made for.
        overload: how long the run yet waits for a device that puts requests off.
        is_patient: whether each request that the device puts off is sent again.
        request_rate: maximum requests per second, or None.
        listeners: are called with every response and every failed request.
        sent: number of requests sent.
        resent: number of requests sent again because the server had closed the kept connection (RFC 9112 9.3.1).
        acted_at: when a request with an unsafe method was last sent or answered, s of the monotonic clock.
        pace: how fast the robot responds.
        hangs: which endpoints did not respond, and how long the run waits for them.
        endpoint_of: returns what hangs if a request does: method and path without values.
        endless: whether a body that does not end is a response, of which only the beginning is read.
        resends: whether any request is sent again that met the end of a kept connection, also one that may act twice.
        recent: the last requests, in the order in which they were answered or given up.
        is_away: returns whether a gateway sent a response in the place of a device that is away.
        before_sending: is called before each message, after the wait for ``request_rate``.
        permit: is called with method and absolute URL before each request; returns an empty text if the request may be
            sent, else why not. By default everything may be sent.
        recorder: records each attempt to send a request, by whatever client, thread or socket.
        heard: whether its responses are judged by the rules for every response.
        number: returns the number of a new connection.
    """

    timeout_s: float = 10.0
    ca_file: Path | None = None
    token: str | None = None
    request_rate: float | None = None
    listeners: list[Listener] = field(default_factory=list)
    sent: int = 0
    resent: int = 0
    acted_at: float = -math.inf
    pace: Pace = field(default_factory=Pace)
    hangs: Hangs = field(default_factory=Hangs)
    endpoint_of: Callable[[Request], str] = lambda request: request.endpoint
    endless: bool = False
    resends: bool = False
    recent: deque[Sending] = field(default_factory=lambda: deque(maxlen=_RECENT))
    is_away: Callable[[Exchange], bool] = lambda _exchange: False
    before_sending: BeforeSending = lambda *_requests: None
    permit: Permit = lambda _method, _url: ""
    credentials: Credentials = field(default_factory=Credentials)
    log_in: Callable[[], Credential] | None = None
    certificate: ClientCertificate | None = None
    trust: Trust | None = None
    overload: Overload = field(default_factory=Overload)
    is_patient: bool = True
    recorder: Recorder = field(default_factory=Recorder)
    heard: Heard = Heard.ALWAYS
    number: Callable[[], int] = field(default_factory=lambda: itertools.count(1).__next__)
    _next_slot: float = 0.0

    def __post_init__(self) -> None:
        if self.token and bearer(self.token) not in self.credentials.items:
            self.credentials = Credentials((*self.credentials.items, bearer(self.token)))

    def tls(self, *, authorized: bool = True) -> ssl.SSLContext:
        """The TLS context that trusts ``ca_file``, or the system's authorities, with the client certificate if any."""
        return tls_context(self.ca_file, self.certificate if authorized else None)

    def may_authorize(self, url: str) -> bool:
        """Return whether the credentials may go to the server of a URL."""
        return self.trust is None or self.trust.trusts(url)

    def unheard(self, **changes: Any) -> "Connection":
        """Return a copy without listeners, which sends nothing again, with some settings changed."""
        return replace(self, **{"listeners": [], "heard": Heard.NEVER, "is_patient": False, **changes})

    def take_slot(self, *requests: tuple[str, str]) -> None:
        """Count one message, after waiting until ``request_rate`` allows it. Everything that sends calls this before.

        Args:
            requests: method and URL of each request in the message; raw bytes may hold several, or none.

        Raises:
            NotPermittedError: one of the requests may not be sent in this run.
        """
        for method, url in requests:
            if reason := self.permit(method, url):
                raise NotPermittedError(reason)
        self.sent += 1
        if self.request_rate:
            now = time.monotonic()
            if self._next_slot > now:
                time.sleep(self._next_slot - now)
            self._next_slot = max(now, self._next_slot) + 1 / self.request_rate
        for method, _ in requests:
            self.note(method)
        self.before_sending(*requests)

    def log_in_again(self) -> None:
        """Get new credentials from the login, if there is one; raise the login's errors."""
        if self.log_in is not None:
            self.credentials = Credentials((*self.credentials.items[:-1], self.log_in()))

    def note(self, method: str) -> None:
        """Update ``acted_at`` if the method is unsafe: called when a request is sent, answered or given up."""
        if method not in SAFE_METHODS:
            self.acted_at = time.monotonic()


class HttpClient:
    """A client that sends requests to one base URL.

    Args:
        base_url: URL of the interface; its path is prepended to the path of every request.
        connection: deadline, token, rate limit and listeners.
        hangs: what did not respond before; None means to any client of the connection.
    """

    def __init__(self, base_url: str, connection: Connection, hangs: Hangs | None = None) -> None:
        if names_user(base_url):
            raise ValueError(IN_URL)
        self.base_url = base_url.rstrip("/")
        self.connection = connection
        parts = urlsplit(self.base_url)
        self.scheme = parts.scheme
        self.host = parts.hostname or ""
        self.port = parts.port or (443 if parts.scheme == "https" else 80)
        self.prefix = parts.path
        self.authority = parts.netloc.rsplit("@", 1)[-1]
        self._hangs = hangs
        self._recorded = 0
        self._authorized = connection.may_authorize(self.base_url)
        self.tls = connection.tls(authorized=self._authorized) if parts.scheme == "https" else None
        self._connections = Connections(
            self.host.encode("idna").decode("ascii"), self.port, self.tls, connection.number
        )

    def twin(self, connection: Connection) -> "HttpClient":
        """Return another client of the same server."""
        return HttpClient(self.base_url, connection)

    def close(self) -> None:
        """Close all open connections."""
        self._connections.close()

    @property
    def hangs(self) -> Hangs:
        """Return the endpoints that did not respond before."""
        return self.connection.hangs if self._hangs is None else self._hangs

    def url(self, path: str) -> str:
        """Return the URL of a path below the base URL, as requests have it."""
        return f"{self.scheme}://{self.authority}{self.prefix}{path}"

    def refusal(self, method: str, path: str) -> str:
        """Return why this run may not send a request, or an empty text. Checks ask before they send."""
        return self.connection.permit(method, self.url(path))

    def send(
        self,
        method: str,
        path: str,
        *,
        headers: Iterable[tuple[str, str]] = (),
        body: bytes = b"",
        fresh: bool = False,
        authorized: bool = True,
        timeout_s: float | None = None,
    ) -> Exchange:
        """Send a request and return it with the complete response; if the device puts it off, to the last try.

        Args:
            method: any token.
            path: request target below the base URL, sent as given; what may not stand in one is percent-encoded.
            headers: headers after Host. ``Accept: */*`` is added by default; ("Accept", "") leaves it out.
            body: request body; Content-Length is added for it, and for every PUT, POST and PATCH.
            fresh: use a new connection and close it afterwards, so that the request is never sent twice.
            authorized: whether to send the credentials, if there are any and the server may have them.
            timeout_s: deadline instead of the run's, s; large bodies extend it.

        Raises:
            NoAnswerError: no HTTP response was received.
            NotPermittedError: the request may not be sent in this run, or HTTP has no way to write it.
        """
        path, headers = sendable(path), tuple(headers)
        for tries in itertools.count(1):
            exchange = self._send(method, path, headers, body, timeout_s, fresh=fresh, authorized=authorized)
            endpoint = partial(self.connection.endpoint_of, exchange.request)
            if not self.connection.is_patient or not self.connection.overload.waits(exchange.response, endpoint, tries):
                return exchange
        raise AssertionError("unreachable: it counts without an end")

    def _send(
        self,
        method: str,
        path: str,
        headers: Headers,
        body: bytes,
        timeout_s: float | None,
        *,
        fresh: bool,
        authorized: bool,
    ) -> Exchange:
        fields = self._fields(method, headers, body, close=fresh)
        shown = tuple((name, value) for name, value in fields if name != "Connection")
        sent, target, query = list(fields), path, ""
        credentials = self.connection.credentials
        authorized = authorized and self._authorized and bool(credentials)
        if authorized:
            target, query = credentials.target(path), credentials.target(path, shown=True)[len(path) :]
            sent = credentials.add_to(fields, method, self.prefix + target)
            shown = tuple(credentials.add_to(shown, shown=True))
        request = Request(method, self.url(path), shown, body, query=query)
        if (drafts := _drafts.get()) is not None:
            return self._draft(method, target, tuple(pair for pair in sent if pair[0] != "Connection"), request, drafts)
        self.put_off(request)
        whole = timeout_s or self.connection.timeout_s
        deadline, started = self.hangs.within_s(whole), time.monotonic()
        try:
            response = self._exchange(request, target, sent, deadline, fresh=fresh)
            if authorized and response.status == _CHALLENGE and credentials.learn(response.headers):
                self.connection.recorder.withdraw(self._recorded)
                sent = credentials.add_to(fields, method, self.prefix + target)
                response = self._exchange(request, target, sent, deadline, fresh=fresh)
            self.connection.note(method)
        except _SilenceError as none:
            self.connection.note(method)
            if none.kind is NoAnswer.TIMEOUT:
                self.connection.pace.took(time.monotonic() - started, len(body))
                endpoint = self.connection.endpoint_of(request)
                if deadline < whole:
                    self.hangs.hurried.add(endpoint)
                    none.kind = NoAnswer.HURRIED
                else:
                    self.hangs.note_hang(endpoint, whole)
            raise self._report_no_response(request, str(none), none.kind) from none
        self.hangs.note_answer(response.elapsed_ms / 1000)
        self.connection.pace.took(response.elapsed_ms / 1000, len(body) + len(response.octets))
        exchange = Exchange(request, response)
        number = self._recorded
        if self.connection.is_away(exchange):
            self.connection.recorder.withdraw(number)
            problem = f"a gateway responded {response.status} in the device's place"
            raise self._report_no_response(request, problem, OF_GATEWAY[response.status])
        self.connection.recent.append(Sending(request, None))
        for listener in self.connection.listeners:
            listener.on_response(exchange)
        return exchange

    def _draft(self, method: str, target: str, fields: Headers, request: Request, drafts: list["Draft"]) -> Exchange:
        """Keep a request that is not sent; return it with the response of a device that has no such resource.

        Raises:
            NotPermittedError: it may not be sent in this run.
        """
        if reason := self.connection.permit(method, request.url):
            raise NotPermittedError(reason)
        head = [
            f"{method} {self.prefix + target or '/'} HTTP/1.1",
            *map(": ".join, fields),
            "Connection: close",
            "",
            "",
        ]
        octets = "\r\n".join(head).encode("utf-8", "surrogateescape") + request.body
        drafts.append(Draft(self, method, octets))
        return Exchange(request, Response(_NOTHING_THERE, (), b"", 0.0))

    def _report_no_response(self, request: Request, problem: str, kind: NoAnswer) -> NoAnswerError:
        """Report a request without a response; return the exception to be raised."""
        unanswered = Unanswered(request, problem, kind)
        self.connection.recent.append(Sending(request, kind))
        for listener in self.connection.listeners:
            listener.on_no_response(unanswered)
        return NoAnswerError(unanswered)

    def put_off(self, request: Request) -> None:
        """Raise NoAnswerError if a request is not sent, because its endpoint did not respond before."""
        if not self.hangs:
            return
        endpoint = self.connection.endpoint_of(request)
        hung = endpoint.replace(f"{self.scheme}://{self.authority}", "", 1)
        problem = f"the request was not sent, because {hung} did not respond"
        if endpoint in self.hangs.hurried:
            raise NoAnswerError(Unanswered(request, f"{problem} in the time that was left", NoAnswer.HURRIED))
        if self.hangs.is_put_off(endpoint):
            raise NoAnswerError(Unanswered(request, f"{problem} {HANGS} times", NoAnswer.CIRCUIT_OPEN))

    def _fields(self, method: str, headers: Headers, body: bytes, *, close: bool) -> Headers:
        names = {name.lower() for name, _ in headers}
        fields: list[tuple[str, str]] = [] if "host" in names else [("Host", self.authority)]
        fields += headers
        if "accept" not in names:
            fields.append(("Accept", "*/*"))
        needs_length = body or method in {"PUT", "POST", "PATCH"}
        if needs_length and not names & {"content-length", "transfer-encoding"}:
            fields.append(("Content-Length", str(len(body))))
        if close:
            fields.append(("Connection", "close"))
        # An empty Accept given by the caller means: send none at all.
        return tuple(pair for pair in fields if pair != ("Accept", ""))

    def _exchange(
        self, shown: Request, path: str, fields: list[tuple[str, str]], seconds: float, *, fresh: bool
    ) -> Response:
        method, body = shown.method, shown.body
        target = (self.prefix + path).encode("utf-8", "surrogateescape") or b"/"
        headers = [(name.encode("latin-1"), value.encode("utf-8")) for name, value in fields]
        try:
            request = h11.Request(method=method, target=target, headers=headers)
        except h11.LocalProtocolError as error:
            raise NotPermittedError(f"{method} {path[:200]} cannot be sent: {error}") from error
        before = ""
        for attempt in range(1, _ATTEMPTS + 1):
            self.connection.take_slot((method, self.url(path)))
            deadline = Deadline(seconds, len(body))
            keep = not fresh and attempt == 1
            connection = self._connections.take() if keep else self._connections.new()
            try:
                response = connection.exchange(request, body, deadline, endless=self.connection.endless)
            except Exception as error:
                none = _no_answer(error, seconds + time_to_arrive(len(body)))
                self._record(shown, connection, attempt, seconds, none)
                if attempt > 1 and none.kind is NoAnswer.REFUSED:
                    raise _SilenceError(_CRASHED, NoAnswer.CLOSED) from error
                if none.kind is not NoAnswer.CLOSED:
                    raise none from error
                if attempt == 1 and connection.ended_before(method, anything=self.connection.resends):
                    # The server may have closed it at any time (RFC 9112 9.3.1).
                    self.connection.resent += 1
                    before = f"; the request before it on the first connection was answered {connection.last_status}"
                    continue
                if attempt > 1:
                    none = _SilenceError(f"{none}, {attempt} of {attempt} times{before}", none.kind)
                raise none from error
            else:
                self._record(shown, connection, attempt, seconds, response)
                return response
            finally:
                self._connections.give_back(connection, keep=keep)
        raise AssertionError("unreachable: the last attempt returns or raises")

    def _record(
        self, shown: Request, on: HttpConnection, attempt: int, within_s: float, came: "Response | _SilenceError"
    ) -> None:
        ended_s = came.received_s if isinstance(came, Response) else time.monotonic()
        what = (came,) if isinstance(came, Response) else (None, str(came), came.kind)
        passage = Passage(shown, on.number, on.place, attempt, on.sent_s, on.first_s, ended_s, within_s, *what)
        self._recorded = self.connection.recorder.record(replace(passage, heard=self.connection.heard))


@dataclass(frozen=True)
class Draft:
    """A request that was not sent.

    Attributes:
        client: would have sent it.
        method: the method of the request.
        octets: the whole request, for a connection of its own.
    """

    client: HttpClient
    method: str
    octets: bytes


_drafts: ContextVar[list[Draft] | None] = ContextVar("drafts", default=None)


def is_drafting() -> bool:
    """Return whether requests of this thread are only kept, not sent."""
    return _drafts.get() is not None


@contextmanager
def draft_requests() -> Iterator[list[Draft]]:
    """Send nothing: yield a list that collects this thread's requests. Each gets a response 404."""
    drafts: list[Draft] = []
    token = _drafts.set(drafts)
    try:
        yield drafts
    finally:
        _drafts.reset(token)


class _SilenceError(Exception):
    """Raised when an attempt to send a request gets no response; the message explains why."""

    def __init__(self, problem: str, kind: NoAnswer) -> None:
        super().__init__(problem)
        self.kind = kind


def _no_answer(error: Exception, seconds: float) -> _SilenceError:
    """Convert a network error to the reason for a missing response; raise any other error again: it is a bug."""
    text = str(error) or type(error).__name__
    if isinstance(error, TimeoutError):
        return _SilenceError(f"no response within {seconds:.3g} s", NoAnswer.TIMEOUT)
    if isinstance(error, ClosedError):
        return _SilenceError("the server closed the connection without a response", NoAnswer.CLOSED)
    if isinstance(error, h11.RemoteProtocolError):
        return _SilenceError(f"a response that is not HTTP: {text}", NoAnswer.MALFORMED)
    if isinstance(error, NoConnectionError):
        kind = NoAnswer.TLS if "SSL" in text or "certificate" in text.lower() else NoAnswer.REFUSED
        return _SilenceError(f"no connection: {explain(text)}", kind)
    if isinstance(error, OSError):
        return _SilenceError(f"the connection broke without a response: {text}", NoAnswer.CLOSED)
    raise error
