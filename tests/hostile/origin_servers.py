"""Two servers: the device that a user named, and elsewhere, which records what reaches it."""

import gzip
import http.server
import json
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

SECRET = "correct-horse-battery"  # noqa: S105 - of these tests
Answer = Callable[[http.server.BaseHTTPRequestHandler], None]
XSD = '<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema" targetNamespace="urn:else"/>'


@dataclass
class Server:
    """One of the two.

    Attributes:
        url: scheme, host and port.
        answers: how each path is answered; any other gets 200 with `{}`.
        seen: method, target and headers of each request.
    """

    url: str = ""
    answers: dict[str, Answer] = field(default_factory=dict)
    seen: list[tuple[str, dict[str, str]]] = field(default_factory=list)

    @property
    def with_secret(self) -> list[str]:
        """The requests that carried a credential."""
        return [line for line, headers in self.seen if SECRET in f"{line} {headers}"]


def document(text: Any, media_type: str = "application/json", status: int = 200, **headers: str) -> Answer:
    """Return an answer with a document; anything but text and bytes as JSON."""
    content = text.encode() if isinstance(text, str) else text if isinstance(text, bytes) else json.dumps(text).encode()

    def answer(handler: http.server.BaseHTTPRequestHandler) -> None:
        handler.send_response(status)
        handler.send_header("Content-Type", media_type)
        for name, value in headers.items():
            handler.send_header(name.replace("_", "-"), value)
        handler.send_header("Content-Length", str(len(content)))
        handler.end_headers()
        handler.wfile.write(content)

    return answer


def redirect(where: str, status: int = 302) -> Answer:
    """Return an answer that redirects."""
    return document(b"", status=status, Location=where)


def packed(content: bytes) -> Answer:
    """Return an answer with content packed by gzip."""
    return document(gzip.compress(content, 1), Content_Encoding="gzip")


@contextmanager
def serving(answers: Mapping[str, Answer] | None = None) -> Iterator[Server]:
    """Serve in threads."""
    server = Server(answers=dict(answers or {}))

    class Handler(http.server.BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def answer(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length") or 0))
            server.seen.append((f"{self.command} {self.path}", dict(self.headers)))
            server.answers.get(self.path.partition("?")[0], document({}))(self)

        def log_message(self, *_: Any) -> None:
            pass

    for method in ("GET", "POST", "PUT", "DELETE", "HEAD", "OPTIONS"):
        setattr(Handler, f"do_{method}", Handler.answer)
    listening = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    listening.daemon_threads = True
    server.url = f"http://127.0.0.1:{listening.server_port}"
    threading.Thread(target=listening.serve_forever, args=(0.01,), daemon=True).start()
    yield server
    listening.shutdown()
    listening.server_close()
