"""Parsers of HTTP messages from bytes, without a socket. h11 parses; bytes that it rejects are kept as received."""

import re
from typing import Any

import h11

from proof.mutation.messages import Request, Response

_MOST_HEAD = 1024 * 1024
_REQUEST_LINE = re.compile(rb"[!-~]+ \S+ HTTP/\d\.\d")
# The framing of a response depends on HEAD or not (RFC 9112 6.3), and on nothing else in the request.
_ASKED = {method: h11.Request(method=method, target="/", headers=[("Host", "robot")]) for method in ("GET", "HEAD")}


class RequestParser:
    """A parser of one request.

    Attributes:
        rest: the bytes that followed the request.
    """

    def __init__(self, side: str) -> None:
        self.rest = b""
        self._side = side
        self._pieces: list[bytes] = []
        self._request: Request | None = None
        self._body: list[bytes] = []
        self._http = h11.Connection(h11.SERVER, max_incomplete_event_size=_MOST_HEAD)

    @property
    def octets(self) -> bytes:
        """All bytes received so far."""
        return b"".join(self._pieces)

    @property
    def waits_for_continue(self) -> bool:
        """Whether the client waits for 100 (Continue) before it sends the body (RFC 9110 10.1.1)."""
        return self._http.they_are_waiting_for_100_continue

    def feed(self, data: bytes) -> Request | None:
        """Parse more bytes; return the request once it is complete or known not to be HTTP, otherwise None."""
        if not self._pieces:
            # Empty lines before a request do not belong to it (RFC 9112 2.2).
            data = data.lstrip(b"\r\n")
        if data:
            self._pieces.append(data)
        try:
            self._http.receive_data(data)
            while (event := self._http.next_event()) is not h11.NEED_DATA:
                if isinstance(event, h11.EndOfMessage) and self._request is not None:
                    self._request.body = b"".join(self._body)
                    self._request.came = tuple(self._pieces)
                    self.rest = self._http.trailing_data[0]
                    return self._request
                self._take(event)
        except h11.RemoteProtocolError:
            return Request(self._side, raw=self.octets)
        if self._request is None:
            line, ended, _ = self.octets.partition(b"\r\n")
            # Most servers answer a line that is no request at once, so nothing more needs to come.
            if ended and not _REQUEST_LINE.fullmatch(line):
                return Request(self._side, raw=self.octets)
        return None

    def _take(self, event: Any) -> None:
        if isinstance(event, h11.Request):
            version = f"HTTP/{event.http_version.decode()}"
            self._request = Request(self._side, event.method.decode(), event.target.decode(), version, _fields(event))
            if self.waits_for_continue:
                self._request.drop("Expect")
        elif isinstance(event, h11.Data):
            self._body.append(bytes(event.data))


class ResponseParser:
    """A parser of one response, which skips informational (1xx) responses before it.

    Args:
        method: the request's method; empty if the request was not HTTP.
    """

    def __init__(self, method: str) -> None:
        self._method = method
        self._response: Response | None = None
        self._body: list[bytes] = []
        self._http = h11.Connection(h11.CLIENT, max_incomplete_event_size=_MOST_HEAD)
        self._http.send(_ASKED["HEAD" if method == "HEAD" else "GET"])
        self._http.send(h11.EndOfMessage())

    def feed(self, data: bytes) -> Response | None:
        """Parse more bytes (empty: the connection ended); return the response once it is complete, otherwise None.

        Raises:
            h11.RemoteProtocolError: the bytes are not HTTP, or end too early.
        """
        self._http.receive_data(data)
        while (event := self._http.next_event()) is not h11.NEED_DATA:
            if isinstance(event, h11.EndOfMessage) and self._response is not None:
                self._response.body = b"".join(self._body)
                return self._response
            if isinstance(event, h11.Response):
                reason = event.reason.decode("latin-1")
                version = f"HTTP/{event.http_version.decode()}"
                self._response = Response(event.status_code, _fields(event), b"", version, reason, method=self._method)
            elif isinstance(event, h11.Data):
                self._body.append(bytes(event.data))
            elif isinstance(event, h11.ConnectionClosed):
                raise h11.RemoteProtocolError("the connection ended before a response")
        return None


def _fields(event: h11.Request | h11.Response) -> list[tuple[str, str]]:
    """Return the headers of an h11 event with the case of their names as received."""
    return [(name.decode(), value.decode("latin-1")) for name, value in event.headers.raw_items()]
