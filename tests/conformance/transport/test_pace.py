"""What late answers take of a wait is given back, and no more."""

import socket
import time

import pytest

from conformance.observe.clock import Patience
from conformance.transport import raw
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswerError
from conformance.transport.pace import Pace

_OK = b"HTTP/1.1 204 No Content\r\n\r\n"


@pytest.mark.parametrize(
    ("usual_s", "took_s", "octets", "late"),
    [
        (0.001, 0.09, 0, False),
        (0.001, 0.3, 0, True),
        (0.2, 0.45, 0, False),
        (0.2, 0.6, 0, True),
        (0.06, 10.0, 10 * 1024 * 1024, False),
    ],
)
def test_late_is_later_than_usual_and_than_the_octets_take(usual_s, took_s, octets, late):
    pace = Pace(usual_s)
    assert pace.is_late(took_s, octets) is late
    pace.took(took_s, octets)
    assert pace.lateness_s == (pytest.approx(took_s - usual_s) if late else 0.0)


def test_a_wait_is_longer_by_what_came_late(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    pace = Pace()
    pace.took(9.0, 0)
    patience = Patience(pace, 1.0)
    now[0] = 101.5
    assert patience.over
    pace.took(2.0, 0)
    assert not patience.over
    now[0] = 103.1
    assert patience.over
    pace.took(100.0, 0)
    now[0] = 107.0
    assert patience.over


def _client(url, timeout_s):
    return HttpClient(url, Connection(timeout_s=timeout_s))


def test_a_long_request_has_longer_and_its_client_knows_what_was_late(listening):
    def slowly(sock: socket.socket) -> None:
        left = 200_000
        while left > 0:
            left -= len(sock.recv(65536))
        time.sleep(0.4)
        sock.sendall(_OK)

    client = _client(listening(slowly), 0.2)
    exchange = client.send("PUT", "/", body=b"x" * 200_000)
    assert (exchange.response.status, client.connection.pace.lateness_s) == (204, 0.0)
    began = time.monotonic()
    with pytest.raises(NoAnswerError, match=r"within 0\.2 s"):
        client.send("GET", "/")
    # A busy machine wakes the client later than at the deadline, and that is late as well.
    assert 0.19 < client.connection.pace.lateness_s < time.monotonic() - began


def test_a_long_answer_has_longer(listening):
    def drip(sock: socket.socket) -> None:
        sock.recv(65536)
        sock.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 800000\r\n\r\n")
        for _ in range(4):
            sock.sendall(b"x" * 200_000)
            time.sleep(0.3)

    url = listening(drip)
    assert len(_client(url, 0.5).send("GET", "/").response.body) == 800_000
    client = _client(url, 0.5)
    assert raw.talk(client, raw.head(client, "GET", "/"), answers=1).octets.endswith(b"x" * 200_000)
