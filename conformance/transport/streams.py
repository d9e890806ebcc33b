"""Streams of messages: server-sent events (HTML Living Standard, 9.2) and WebSocket (RFC 6455)."""

from __future__ import annotations

import http.client
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from http import HTTPStatus
from importlib import import_module
from socket import SHUT_RDWR, socket
from typing import Any, Final, Literal, NamedTuple, cast

from conformance.commandline.extras import missing_extra
from conformance.transport.client import HttpClient
from conformance.transport.connections import open_link
from conformance.transport.exchange import NoAnswer, NoAnswerError, NotPermittedError, Request, Response, Unanswered
from conformance.transport.passage import Heard, Passage

Kind = Literal["sse", "websocket"]
_KEPT: Final = 2000  # messages of a stream that are kept
_LONGEST: Final = 16 * 1024 * 1024  # longest line of an event, and longest message, bytes
_EVENTS: Final = "text/event-stream"


class Message(NamedTuple):
    """A message that came: when, s of the monotonic clock, and its octets."""

    at: float
    octets: bytes


class Stream:
    """An open stream. What comes is dated by a thread that does nothing else.

    Args:
        client: whose server it is on; it lends its credentials and its permission.
        target: path and query below the base URL.
        kind: server-sent events or WebSocket.
        timeout_s: until it is open, s.
        wanted: whether a message is one of those that are listened for.
        after: the id of the last event that its client has had; empty if there is none.

    Attributes:
        request: by which it was opened; for a WebSocket, the handshake.
        last: the last message; None if none came yet.
        last_id: the id of the last event; empty if it has none.
        ended: whether no more comes.

    Raises:
        NoAnswerError: it does not open.
        NotPermittedError: it may not be opened in this run.
    """

    def __init__(
        self,
        client: HttpClient,
        target: str,
        kind: Kind,
        timeout_s: float,
        wanted: Callable[[bytes], bool] = lambda _: True,
        after: str = "",
    ) -> None:
        shared, began = client.connection, time.monotonic()
        shared.take_slot(("GET", client.url(target)))
        fields = [("Accept", _EVENTS)] if kind == "sse" else []
        fields += [("Last-Event-ID", after)] if after else []
        credentials = shared.credentials if shared.may_authorize(client.base_url) else type(shared.credentials)()
        self.request = Request("GET", client.url(target), tuple(credentials.add_to(fields, shown=True)))
        path = client.prefix + credentials.target(target)
        headers = dict(credentials.add_to(fields, "GET", path))
        self.last, self.last_id = cast("Message | None", None), ""
        self.ended, self._wanted = False, wanted
        self._came: deque[Message] = deque(maxlen=_KEPT)
        self._news = threading.Condition()
        try:
            self._link = open_link(client.host, client.port, client.tls, timeout_s)
            url = f"{client.authority}{path}"
            self._pieces, self._send = (_events if kind == "sse" else _messages)(self._link, url, headers, timeout_s)
        except (OSError, http.client.HTTPException, EOFError, _Refused) as error:
            reason = NoAnswer.TIMEOUT if isinstance(error, TimeoutError) else NoAnswer.CLOSED
            raise NoAnswerError(Unanswered(self.request, f"the stream does not open: {error}", reason)) from error
        status = HTTPStatus.OK if kind == "sse" else HTTPStatus.SWITCHING_PROTOCOLS
        opened = Response(status, (), b"", 0.0, cut="a stream, which does not end")
        ended = time.monotonic()
        shared.recorder.record(
            Passage(self.request, shared.number(), 1, 1, began, ended, ended, timeout_s, opened, heard=Heard.NEVER)
        )
        threading.Thread(target=self._listen, name="stream", daemon=True).start()

    def send(self, text: str) -> None:
        """Send a message over a WebSocket. Never raises: the attribute `ended` shows that the stream is over."""
        with suppress(Exception):
            self._send(text)

    def take_new(self, count: int = 0, within_s: float = 0.0) -> list[Message]:
        """Return messages since the last call; wait for ``count`` of them, or until no more can come."""
        with self._news:
            self._news.wait_for(lambda: len(self._came) >= count or self.ended, within_s)
            return [self._came.popleft() for _ in range(len(self._came))]

    def close(self) -> None:
        """Close it."""
        with suppress(OSError):
            self._link.shutdown(SHUT_RDWR)
        self._link.close()

    def _listen(self) -> None:
        # Only the end of the stream matters here, not its reason.
        with suppress(Exception):
            for octets, id_ in self._pieces:
                self.last_id = id_
                if not self._wanted(octets):
                    continue
                message = Message(time.monotonic(), octets)
                with self._news:
                    self.last = message
                    self._came.append(message)
                    self._news.notify_all()
        with self._news:
            self.ended = True
            self._news.notify_all()


class _Refused(Exception):  # noqa: N818 - a response
    """Raised when a server does not open a stream."""


# Messages with the ids of their events; and what sends.
_Opened = tuple[Iterator[tuple[bytes, str]], Callable[[str], object]]


def _events(link: socket, url: str, headers: dict[str, str], timeout_s: float) -> _Opened:
    """Open a stream of server-sent events."""
    link.settimeout(timeout_s)
    connection = http.client.HTTPConnection(url.partition("/")[0])
    connection.sock = link
    connection.request("GET", "/" + url.partition("/")[2], headers=headers)
    response = connection.getresponse()
    kind = (response.headers.get("Content-Type") or "").partition(";")[0].strip().lower()
    if response.status != HTTPStatus.OK or kind != _EVENTS:
        raise _Refused(f"status {response.status}, {kind or 'without a Content-Type'}")
    link.settimeout(None)
    return _data(response), lambda _: None


def _data(response: http.client.HTTPResponse) -> Iterator[tuple[bytes, str]]:
    """Yield the data of each event, and the last id (9.2.6)."""
    data, last_id = list[bytes](), ""
    while line := response.readline(_LONGEST):
        name, _, value = line.rstrip(b"\r\n").partition(b":")
        if name == b"data":
            data.append(value.removeprefix(b" "))
        elif name == b"id":
            last_id = value.removeprefix(b" ").decode("latin-1")
        elif not name and not value and data:
            yield b"\n".join(data), last_id
            data = []


def _messages(link: socket, url: str, headers: dict[str, str], timeout_s: float) -> _Opened:
    """Open a WebSocket."""
    # Imported by name, because only streams need it, and installations without ROS lack it.
    try:
        library: Any = import_module("websockets.sync.client")
    except ModuleNotFoundError as error:
        raise NotPermittedError(str(missing_extra(error.name, "a WebSocket"))) from error
    try:
        opened = library.connect(
            f"ws://{url}", sock=link, additional_headers=headers, open_timeout=timeout_s, max_size=_LONGEST,
            proxy=None, close_timeout=1,
        )  # fmt: skip
    except import_module("websockets.exceptions").WebSocketException as error:
        raise _Refused(str(error)) from error
    return ((octets if isinstance(octets, bytes) else octets.encode(), "") for octets in opened), opened.send
