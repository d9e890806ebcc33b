"""WSGI on wsgiref, a thread for each request."""

import threading
from collections.abc import Callable
from socketserver import ThreadingMixIn
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server


class _Handler(WSGIRequestHandler):
    timeout = 20

    def get_environ(self) -> dict[str, Any]:
        """Add the target as it was sent, because WSGI's PATH_INFO has lost its escapes."""
        return {**super().get_environ(), "TARGET": self.path}

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - http.server's own name
        """Log nothing."""


class _Server(ThreadingMixIn, WSGIServer):
    daemon_threads = True
    request_queue_size = 128

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a connection that the client has broken."""


def start(application: Any, port: int) -> tuple[str, Callable[[], None]]:
    """Serve a WSGI application on loopback. Return its URL and a function that stops the server."""
    server = make_server("127.0.0.1", port, application, server_class=_Server, handler_class=_Handler)
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True).start()

    def stop() -> None:
        server.shutdown()
        server.server_close()

    return f"http://127.0.0.1:{server.server_port}", stop
