"""A small HTTP server that answers what a function says, or a handler."""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


class Handler(BaseHTTPRequestHandler):
    """Keeps its connections, and says nothing of what it does; a subclass has the method `answer`."""

    protocol_version = "HTTP/1.1"
    wbufsize = -1  # an answer in one piece, or each waits 40 ms for an acknowledgement

    def content(self) -> bytes:
        return self.rfile.read(int(self.headers.get("Content-Length") or 0))

    def send(self, status: int, content: bytes = b"", media_type: str = "application/json") -> None:
        self.send_response(status)
        self.send_header("Content-Type", media_type)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def _do(self) -> None:
        self.answer()

    do_GET = do_HEAD = do_PUT = do_POST = do_DELETE = do_OPTIONS = _do  # noqa: N815 - http.server's names

    def log_message(self, *_: object) -> None:
        return


@contextmanager
def server_of(handler: type[BaseHTTPRequestHandler], **attributes: Any) -> Iterator[Any]:
    """Serve on loopback; yields the server, with its base URL as `url` and these attributes."""
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        vars(server).update(attributes, url=f"http://127.0.0.1:{server.server_port}")
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        yield server
        server.shutdown()


@contextmanager
def serving(
    answer: Callable[[str, str, bytes], tuple[int, object]], media_type: str = "application/json"
) -> Iterator[str]:
    """Serve what a function of method, path and content says: a status and bytes or JSON, None for none.

    Yields the base URL.
    """

    class Answering(Handler):
        def answer(self) -> None:
            status, value = answer(self.command, self.path, self.content())
            content = value if isinstance(value, bytes) else b"" if value is None else json.dumps(value).encode()
            self.send(status, content, media_type)

    with server_of(Answering) as server:
        yield server.url
