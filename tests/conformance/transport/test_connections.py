import socket
import statistics
import threading
import time
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from conformance.transport.client import Connection, HttpClient


class _Server(ThreadingHTTPServer):
    """Counts connections, and ends each after so many answers without saying so."""

    def __init__(self, answers: int) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.answers = answers
        self.body = b""
        self.opened = 0
        self.ended = threading.Semaphore(0)


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def setup(self) -> None:
        super().setup()
        self.server.opened += 1
        self.left = self.server.answers

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Length", str(len(self.server.body)))
        self.end_headers()
        self.wfile.flush()
        self.wfile.write(self.server.body)
        self.left -= 1
        self.close_connection = self.close_connection or not self.left

    def finish(self) -> None:
        super().finish()
        self.server.shutdown_request(self.request)
        self.server.ended.release()

    def log_message(self, *_: object) -> None:
        return


@contextmanager
def _asking(answers: int = 1000):
    server = _Server(answers)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    client = HttpClient(f"http://127.0.0.1:{server.server_port}", Connection())
    yield server, client
    client.close()
    server.shutdown()
    server.server_close()


def test_requests_follow_each_other_on_one_connection():
    with _asking() as (server, client):
        for _ in range(5):
            assert client.send("GET", "/").response.status == 200
        assert server.opened == 1


def test_a_connection_that_the_server_has_ended_is_not_used_again():
    with _asking(answers=2) as (server, client):
        for turn in range(6):
            assert client.send("GET", "/").response.status == 200
            if turn % 2:
                assert server.ended.acquire(timeout=5)
        assert server.opened == 3
        # None of them was sent on a closed connection and then once more.
        assert client.connection.sent == 6


@pytest.mark.parametrize("closes", ["the client", "its request"])
def test_what_is_asked_for_on_its_own_connection_leaves_none_open(closes):
    with _asking() as (server, client):
        client.send("GET", "/", fresh=closes == "its request")
        if closes == "the client":
            client.close()
        assert server.ended.acquire(timeout=5)
        assert client.send("GET", "/").response.status == 200
        assert server.opened == 2


def test_a_server_that_awaits_an_acknowledgement_in_mid_answer_gets_it_at_once():
    with _asking() as (server, client):
        server.body = b"the second segment, which Nagle's algorithm keeps back"
        times = []
        for _ in range(21):
            began = time.monotonic()
            assert client.send("GET", "/").response.body == server.body
            times.append(time.monotonic() - began)
    if hasattr(socket, "TCP_QUICKACK"):
        # A delayed acknowledgement takes 0.04 s, and on a busy machine some take as long without.
        assert statistics.quantiles(times)[0] < 0.02
