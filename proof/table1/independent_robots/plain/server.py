"""An HTTP/1.0 server on http.server, with one thread and one connection for each request."""

import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from email.message import Message
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Protocol

MAX_BODY = 256 * 1024
MAX_TARGET = 8000
MAX_UNREAD = 16 * 1024 * 1024  # bytes of a refused request that are read before closing
_LINGER_S = 2.0  # how long a refused request is read, s


@dataclass
class Answer:
    """A response: a status, a body with its media type, further header fields."""

    status: int
    body: bytes = b""
    media_type: str = ""
    fields: dict[str, str] = field(default_factory=dict)


class Application(Protocol):
    """An object that responds to requests."""

    def answer(self, method: str, target: str, headers: Message, body: bytes) -> Answer:
        """Return the response to a request."""


def origin_form(target: str) -> str:
    """Return a request target without scheme and authority (RFC 9112 3.2.2)."""
    scheme, separator, rest = target.partition("://")
    return f"/{rest.partition('/')[2]}" if separator and scheme.lower() in {"http", "https"} else target


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.0"
    timeout = 20
    application: Application

    def __getattr__(self, name: str) -> Any:
        # http.server looks for do_METHOD; this application handles every method itself.
        if name.startswith("do_"):
            return self._do
        raise AttributeError(name)

    def _do(self) -> None:
        refusal = self._refusal()
        if refusal:
            self.close_connection = True
            self.send_error(*refusal)
            return
        length = int(self.headers.get("Content-Length") or 0)
        body = self.rfile.read(length)
        if len(body) < length:
            return  # the client has left in the middle of its request: do nothing
        answer = self.application.answer(self.command, origin_form(self.path), self.headers, body)
        self._send(answer)

    def _refusal(self) -> tuple[int, str] | None:
        """Return status and reason for rejecting the request's head (RFC 9112 3.2, 6.1, 6.3), or None."""
        hosts = self.headers.get_all("Host") or []
        lengths = set(self.headers.get_all("Content-Length") or [])
        if len(hosts) > 1 or (not hosts and self.request_version != "HTTP/1.0"):
            return 400, f"Host is there {len(hosts)} times"
        if len(lengths) > 1 or any(not (text.isascii() and text.isdigit()) for text in lengths):
            return 400, "Content-Length is not one number"
        if "Transfer-Encoding" in self.headers:
            return (400, "Content-Length beside Transfer-Encoding") if lengths else (411, "send Content-Length")
        if len(self.path) > MAX_TARGET:
            return 414, f"a target of {len(self.path)} octets"
        if lengths and int(lengths.pop()) > MAX_BODY:
            return 413, f"more than {MAX_BODY} octets"
        return None

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Send the response to a request that http.server, or the check of the head, rejects."""
        self.request_version = "HTTP/1.0"  # a line that could not be read counts as HTTP/0.9, which has no status
        document = {"status": int(code), "detail": message or explain or "refused"}
        if not hasattr(self, "headers"):
            self.command = "GET"
        self._send(Answer(int(code), json.dumps(document).encode(), "application/problem+json"))

    def _send(self, answer: Answer) -> None:
        self.send_response(answer.status)
        for name, value in answer.fields.items():
            self.send_header(name, value)
        if answer.media_type:
            self.send_header("Content-Type", answer.media_type)
        if answer.status != 204:  # noqa: PLR2004 - 204 has no body and no length (RFC 9110 8.6)
            self.send_header("Content-Length", str(len(answer.body)))
        self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(answer.body)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - http.server's own name
        """Log nothing."""


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 128

    def shutdown_request(self, request: Any) -> None:
        """Close in stages: a connection closed with unread bytes is reset, and the response is lost (RFC 9112 9.6)."""
        with contextlib.suppress(OSError):
            request.shutdown(socket.SHUT_WR)
            request.settimeout(_LINGER_S)
            until, unread = time.monotonic() + _LINGER_S, MAX_UNREAD
            while unread > 0 and time.monotonic() < until and (octets := request.recv(65536)):
                unread -= len(octets)
        self.close_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a connection that the client has broken."""


def start(application: Application, port: int) -> tuple[str, Callable[[], None]]:
    """Serve an application on loopback. Return its URL and a function that stops the server."""
    handler = type("Handler", (_Handler,), {"application": application})
    server = _Server(("127.0.0.1", port), handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)
    thread.start()

    def stop() -> None:
        server.shutdown()
        server.server_close()

    return f"http://127.0.0.1:{server.server_port}", stop
