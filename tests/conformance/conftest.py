"""Tiny servers that behave badly on purpose."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import pytest
from toy_server import serving


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
        served: list[tuple[socket.socket, threading.Thread]] = []

        def accept() -> None:
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                thread = threading.Thread(target=_quietly, args=(handle, connection), daemon=True)
                served.append((connection, thread))
                thread.start()

        def stop() -> None:
            server.shutdown(socket.SHUT_RDWR)
            server.close()
            for connection, thread in served:
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)
                # A thread that is about to read would read what the next test's socket of the same number gets.
                thread.join(0.5)
                if not thread.is_alive():
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

    with serving(lambda *_: (404, b"<html>nothing here</html>"), "text/html") as url:
        yield url


@pytest.fixture
def closed_port() -> str:
    """The base URL of a port at which nobody listens."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"http://127.0.0.1:{server.getsockname()[1]}"
