"""WSGI on wsgiref, a thread for each request."""

import threading
from collections.abc import Callable
from socketserver import ThreadingMixIn
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer, make_server


class _Handler(WSGIRequestHandler):
    timeout = 20

    def get_environ(self) -> dict[str, Any]:
        """Keep the target as it was sent, since WSGI's PATH_INFO loses what was escaped."""
        return {**super().get_environ(), "TARGET": self.path}

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - http.server's own name
        """Say nothing."""


class _Server(ThreadingMixIn, WSGIServer):
    daemon_threads = True
    request_queue_size = 128

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A connection that broke is the client's affair."""


def start(application: Any, port: int) -> tuple[str, Callable[[], None]]:
    """Serve a WSGI application on loopback. Returns its URL and what stops it."""
    server = make_server("127.0.0.1", port, application, server_class=_Server, handler_class=_Handler)
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True).start()

    def stop() -> None:
        server.shutdown()
        server.server_close()

    return f"http://127.0.0.1:{server.server_port}", stop
