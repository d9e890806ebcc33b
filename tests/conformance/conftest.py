"""Tiny servers that behave badly on purpose."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest


@pytest.fixture
def listening():
    """Serve each connection with a function of its socket; gives the base URL."""
    with _serving() as serve:
        yield serve


@contextmanager
def _serving() -> Iterator[Callable[[Callable[[socket.socket], None]], str]]:
    stops: list[Callable[[], None]] = []

    def serve(handle: Callable[[socket.socket], None]) -> str:
        server = socket.create_server(("127.0.0.1", 0))
        open_sockets: list[socket.socket] = []

        def accept() -> None:
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                open_sockets.append(connection)
                threading.Thread(target=_quietly, args=(handle, connection), daemon=True).start()

        def stop() -> None:
            server.shutdown(socket.SHUT_RDWR)
            server.close()
            for connection in open_sockets:
                connection.close()

        threading.Thread(target=accept, daemon=True).start()
        stops.append(stop)
        return f"http://127.0.0.1:{server.getsockname()[1]}"

    yield serve
    for stop in stops:
        stop()


def _quietly(handle: Callable[[socket.socket], None], connection: socket.socket) -> None:
    try:
        handle(connection)
    except OSError:
        return


@pytest.fixture
def web_server():
    """A plain web server that knows none of the contract: answers everything 404."""

    class _NotFound(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        wbufsize = -1  # an answer in one piece, or each waits 40 ms for an acknowledgement

        def _answer(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length") or 0))
            body = b"<html>nothing here</html>"
            self.send_response(404)
            self.send_header("Content-Type", "text/html")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(body)

        do_GET = do_HEAD = do_PUT = do_POST = do_DELETE = do_OPTIONS = _answer  # noqa: N815 - http.server's names

        def log_message(self, *_: object) -> None:
            return

    server = ThreadingHTTPServer(("127.0.0.1", 0), _NotFound)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
    thread.join()


@pytest.fixture
def closed_port() -> str:
    """The base URL of a port at which nobody listens."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"http://127.0.0.1:{server.getsockname()[1]}"
