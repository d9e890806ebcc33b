"""Requests that are never completed: sent in part over a raw socket, then left open or broken off."""

import contextlib
import socket
import struct
import time
from typing import Final, Self

from conformance.transport.client import Headers, HttpClient
from conformance.transport.exchange import NoAnswer, NoAnswerError, Request, Sending, Unanswered, sendable
from conformance.transport.passage import Passage

# l_onoff 1, l_linger 0: close() sends RST instead of FIN.
_RESET: Final = struct.pack("ii", 1, 0)


class PartialRequest:
    """A request of which only a part has been sent. The constructor sends that part.

    Args:
        client: the interface to send it to.
        method, path: as for HttpClient.send().
        sent: the part of the body to send.
        promised: Content-Length, or None for a chunked body without its last chunk.
        head_only: number of bytes of the head to send, without a body; None: the whole head and ``sent``.
        headers: further fields; Content-Type is application/json where they have none.

    Raises:
        NoAnswerError: the connection cannot be opened.
        NotPermittedError: the request may not be sent in this run.
    """

    def __init__(
        self,
        client: HttpClient,
        method: str,
        path: str,
        *,
        sent: bytes = b"",
        promised: int | None = None,
        head_only: int | None = None,
        headers: Headers = (),
    ) -> None:
        credentials = client.connection.credentials
        target = client.prefix + credentials.target(sendable(path))
        head = [f"{method} {target} HTTP/1.1", f"Host: {client.authority}"]
        if (sent or promised) and not any(name.lower() == "content-type" for name, _ in headers):
            head.append("Content-Type: application/json")
        head += [f"{name}: {value}" for name, value in headers]
        head.append("Transfer-Encoding: chunked" if promised is None and sent else f"Content-Length: {promised or 0}")
        shown = credentials.hidden("\r\n".join(head))
        head += [f"{name}: {value}" for name, value in credentials.fields(method, target)]
        body = f"{len(sent):x}\r\n".encode() + sent + b"\r\n" if promised is None and sent else sent
        octets = "\r\n".join(head).encode() + b"\r\n\r\n" + body
        if head_only is not None:
            octets = octets[:head_only]
        self.request = Request(method, client.url(path), (), b"", f"{shown}\r\n\r\n".encode()[: len(octets)] + body)
        client.connection.take_slot((method, self.request.url))
        self._connection, self._number, self._sent_s = client.connection, client.connection.number(), time.monotonic()
        try:
            self._socket = socket.create_connection((client.host, client.port), client.connection.timeout_s)
            if client.scheme == "https":
                self._socket = client.connection.tls().wrap_socket(self._socket, server_hostname=client.host)
            self._socket.sendall(octets)
            client.connection.recent.append(Sending(self.request, None))
        except OSError as error:
            unanswered = Unanswered(self.request, f"no connection: {error}", NoAnswer.REFUSED)
            self._record(unanswered.problem, NoAnswer.REFUSED)
            raise NoAnswerError(unanswered) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.vanish()

    def vanish(self, *, reset: bool = True) -> None:
        """Break the connection off, by a TCP reset or by a normal close, as when a client's process is killed."""
        with contextlib.suppress(OSError):
            if reset:
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
        with contextlib.suppress(OSError):
            self._socket.close()
        if self._sent_s:
            self._record("the suite reset the connection" if reset else "the suite closed the connection")
            self._sent_s = 0.0

    def _record(self, problem: str, kind: NoAnswer | None = None) -> None:
        now = time.monotonic()
        self._connection.recorder.record(
            Passage(self.request, self._number, 1, 1, self._sent_s, 0.0, now, 0.0, None, problem, kind, whole=False)
        )
