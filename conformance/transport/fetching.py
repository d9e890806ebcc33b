"""Fetch files that are not judged: descriptions, and the schemas and files they refer to.

One httpx client, which takes its transport from here: a redirect is a request like any other, and goes to no server
that the user did not name. Credentials are added in the transport, so that none follows a redirect elsewhere. Proxies
in the environment are not used: the suite reaches the device as its requests do.
"""

import os
import ssl
import threading
import time
from collections.abc import Iterable, Sequence
from functools import cached_property
from queue import Empty, SimpleQueue
from typing import Final

import click
import httpx
from click.globals import push_context

from conformance.commandline.device_options import advice
from conformance.transport.client import Connection
from conformance.transport.codings import content_of
from conformance.transport.connections import explain
from conformance.transport.credentials import Credentials
from conformance.transport.exchange import Request, Response
from conformance.transport.passage import Heard, Passage
from conformance.transport.reach import ElsewhereError, Trust, UnreachableError

_REDIRECTS: Final = 4
_MOST_OCTETS: Final = 32 * 1024 * 1024  # longest document, bytes
_MOST_IN_ALL: Final = 256 * 1024 * 1024  # bytes of all documents that a description refers to
_MOST_SECONDS: Final = 300.0  # time for all documents, s
_PIECE: Final = 1024 * 1024
_ACCEPT: Final = "application/json, application/yaml, */*"


class Fetcher:
    """Fetches documents from the servers that the user named.

    Args:
        connection: deadline, credentials and TLS.
        trust: the servers that get the credentials.
        public: further URLs that the user named; their servers get no credentials.
    """

    def __init__(self, connection: Connection, trust: Trust, public: Iterable[str] = ()) -> None:
        self._connection, self._trust = connection, trust
        self._guard = _Guard(connection, trust, Trust.of(*public))
        self._silent: dict[str, str] = {}
        self._octets, self._began = 0, time.monotonic()

    def __call__(self, url: str) -> bytes:
        """Return the content of a URL.

        Raises:
            UnreachableError: its server does not respond.
            ElsewhereError: it is on a server that the user did not name, or redirects there.
            ValueError: there is no such content, or it is too large.
        """
        try:
            server = httpx.URL(self._guard.place(url)[0]).netloc.decode("ascii")
        except (ElsewhereError, httpx.InvalidURL) as error:
            raise ElsewhereError(str(error)) from error
        if server in self._silent:
            raise UnreachableError(f"{url}: {self._silent[server]}")
        if time.monotonic() - self._began > _MOST_SECONDS:
            raise ValueError(f"fetching took more than {_MOST_SECONDS:g} s in all")
        seconds = self._connection.timeout_s
        # httpx limits the time of each read but not of all, and a server may send single bytes without end.
        done: SimpleQueue[bytes | Exception] = SimpleQueue()
        running = click.get_current_context(silent=True)
        threading.Thread(target=lambda: done.put(self._outcome(url, running)), daemon=True).start()
        try:
            found = done.get(timeout=seconds)
        except Empty:
            found = httpx.ReadTimeout("")
        if isinstance(found, bytes):
            return found
        if isinstance(found, httpx.TooManyRedirects):
            raise ValueError(f"more than {_REDIRECTS} redirects") from found  # noqa: TRY004 - of what was fetched
        if isinstance(found, httpx.TransportError):
            self._silent[server] = _error_text(found, seconds)
            raise UnreachableError(f"{url}: {self._silent[server]}") from found
        raise found

    def _outcome(self, url: str, running: click.Context | None) -> bytes | Exception:
        if running is not None:
            push_context(running)  # an error may name an option of that command
        try:
            return self._content(url)
        except Exception as error:  # noqa: BLE001 - the caller's thread raises it
            return error

    def _content(self, url: str) -> bytes:
        client = httpx.Client(
            transport=self._guard,
            trust_env=False,
            follow_redirects=True,
            max_redirects=_REDIRECTS,
            timeout=self._connection.timeout_s,
            headers={"Accept": _ACCEPT, "Accept-Encoding": "identity", "User-Agent": "roaas"},
        )
        began = time.monotonic()
        try:
            with client.stream("GET", self._guard.place(url)[0]) as response:
                if response.status_code != httpx.codes.OK:
                    self._record(began, [*response.history, response])
                    said = self._hint(url, response.status_code)
                    raise ValueError(f"the server responded {response.status_code}{said}")
                octets = _decode(response)
        except httpx.TransportError as error:
            self._record(began, [], Request("GET", url), _error_text(error, self._connection.timeout_s))
            raise
        self._record(began, [*response.history, response], octets=octets)
        self._octets += len(octets)
        if self._octets > _MOST_IN_ALL:
            raise ValueError(f"the documents have more than {_MOST_IN_ALL:,} bytes in all")
        return octets

    def _record(
        self,
        began: float,
        came: Sequence[httpx.Response],
        request: Request | None = None,
        problem: str = "",
        octets: bytes = b"",
    ) -> None:
        """Record the responses on the way to a document, with its unpacked content, or why there was none."""
        ended = time.monotonic()
        link = 0, 0, 1, began, 0.0, ended, self._connection.timeout_s
        for one in came:
            sent = Request(one.request.method, str(one.request.url), tuple(one.request.headers.multi_items()))
            fields = tuple(pair for pair in one.headers.multi_items() if pair[0] != "content-encoding")
            response = Response(one.status_code, fields, octets if one is came[-1] else b"", 1000 * (ended - began))
            self._connection.recorder.record(Passage(sent, *link, response, heard=Heard.NEVER))
        if request is not None:
            self._connection.recorder.record(Passage(request, *link, None, problem, heard=Heard.NEVER))

    def _hint(self, url: str, status: int) -> str:
        """Return a hint for a status: a proxy cannot reach the device, or the option for the demanded credentials."""
        if status in {httpx.codes.BAD_GATEWAY, httpx.codes.SERVICE_UNAVAILABLE, httpx.codes.GATEWAY_TIMEOUT}:
            return ": a proxy answers, and the device behind it does not"
        if status not in {httpx.codes.UNAUTHORIZED, httpx.codes.FORBIDDEN}:
            return ""
        reason = self._trust.refusal(url)
        if reason and self._connection.credentials:
            return f"; it got no credentials: {reason}"
        how = advice(
            ", as by --token-file or --basic-file?", ", as by --token-file?", "? Save it to a file, and name that"
        )
        return f"; are credentials missing{how}"


class _Guard(httpx.BaseTransport):
    """Sends a request to a server that the user named, with the credentials if they are for it, and no other request.

    Args:
        connection: credentials and TLS.
        trust: the servers that get the credentials.
        public: those that get a request without them.
    """

    def __init__(self, connection: Connection, trust: Trust, public: Trust) -> None:
        self._connection, self._trust, self._public = connection, trust, public

    def place(self, url: str) -> tuple[str, Credentials]:
        """Return the URL to request, and the credentials for its server.

        Raises:
            ElsewhereError: the user named no such server.
        """
        if not self._trust.trusts(url) and self._public.trusts(url):
            return self._public.place(url), Credentials()
        return self._trust.place(url), self._connection.credentials

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """Send a request, and a second time with an answer to a challenge (RFC 7616)."""
        try:
            url, credentials = self.place(str(request.url))
        except ElsewhereError as error:
            raise ElsewhereError(f"it redirects to {request.url}: {error}") from None
        parts = httpx.URL(url)
        target = credentials.target(parts.raw_path.decode("ascii"))
        # Credentials for the server as the user named it are added below.
        given = [pair for pair in request.headers.items() if pair[0] not in {"host", "authorization", "connection"}]
        for last in (False, True):
            sent = httpx.Request(
                request.method,
                parts.copy_with(raw_path=target.encode("ascii")),
                headers=credentials.add_to([*given, ("Connection", "close")], request.method, target),
                extensions=request.extensions,
            )
            inner = self._tls if parts.scheme == "https" else self._plain
            response = inner.handle_request(sent)
            if last or response.status_code != httpx.codes.UNAUTHORIZED:
                break
            if not credentials.learn(response.headers.multi_items()):
                break
            response.close()
        return response

    @cached_property
    def _plain(self) -> httpx.HTTPTransport:
        return httpx.HTTPTransport(verify=ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT), trust_env=False)

    @cached_property
    def _tls(self) -> httpx.HTTPTransport:
        return httpx.HTTPTransport(verify=self._connection.tls(), trust_env=False)


def _decode(response: httpx.Response) -> bytes:
    """Return the content of a response without its coding.

    Raises:
        ValueError: it is longer than one document may be, or cannot be decoded.
    """
    octets = bytearray()
    for piece in response.iter_raw(_PIECE):
        octets += piece
        if len(octets) > _MOST_OCTETS:
            raise ValueError(f"it has more than {_MOST_OCTETS:,} bytes")
    content = content_of(bytes(octets), response.headers.get("content-encoding"), is_whole=True)
    if not content.is_plain:
        why = content.fault or f"content that cannot be decoded here, or that has more than {_MOST_OCTETS:,} bytes"
        raise ValueError(f"the server sent Content-Encoding {content.coding[:40]!r}, and {why}")
    return content.octets


def _error_text(error: httpx.TransportError, seconds: float) -> str:
    text = str(error) or type(error).__name__
    if isinstance(error, httpx.TimeoutException):
        return f"no response within {seconds:.3g} s"
    if isinstance(error, httpx.ConnectError):
        return f"no connection: {explain(text)}{_unused_proxy()}"
    if isinstance(error, httpx.RemoteProtocolError) and "disconnected" not in text:
        return f"a response that is not HTTP: {text}"
    return f"the server closed the connection without a response: {text}{_maybe_tls(error)}"


def _maybe_tls(error: httpx.TransportError) -> str:
    """Return that a port which closes a connection may speak TLS, if TLS was not tried."""
    try:
        return "; is the address https://?" if error.request.url.scheme == "http" else ""
    except RuntimeError:  # the error has no request
        return ""


def _unused_proxy() -> str:
    named = [name for name in ("http_proxy", "https_proxy", "all_proxy") if {name, name.upper()} & os.environ.keys()]
    return f" ({named[0]} is set: no proxy is used, as the device's own responses are judged)" if named else ""
