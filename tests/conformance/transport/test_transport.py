"""Every exchange ends at its deadline, and what came instead of an answer is told."""

import time

import pytest

from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswerError, Outgoing
from conformance.transport.parallel import crowd
from conformance.transport.raw import talk

_DEADLINE = 0.4


def _client(url: str, **options) -> HttpClient:
    return HttpClient(url, Connection(timeout_s=_DEADLINE, **options))


def _head(connection) -> None:
    data = b""
    while b"\r\n\r\n" not in data:
        data += connection.recv(65536)


def test_an_answer_that_drips_ends_at_the_deadline(listening):
    def drip(connection):
        _head(connection)
        connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 1000\r\n\r\n")
        for _ in range(1000):
            connection.sendall(b"x")
            time.sleep(0.02)

    client = _client(listening(drip))
    started = time.monotonic()
    with pytest.raises(NoAnswerError, match=r"no response within 0\.4 s") as error:
        client.send("GET", "/")
    assert error.value.kind == "timeout"
    assert time.monotonic() - started < 15


@pytest.mark.parametrize("reads", [False, True])
def test_much_content_gives_time_while_it_goes_out_and_none_to_who_hangs(listening, monkeypatch, reads):
    monkeypatch.setattr("conformance.transport.pace._UNDER_WAY", 0)
    content = b" " * (8 * 1024 * 1024)

    def hang(connection):
        _head(connection)
        while reads and connection.recv(1 << 20):
            pass
        time.sleep(20)

    started = time.monotonic()
    with pytest.raises(NoAnswerError) as error:
        _client(listening(hang)).send("PUT", "/", body=content)
    assert error.value.kind == "timeout"
    assert time.monotonic() - started < 15


def test_a_hanging_endpoint_costs_its_deadline_twice_at_most(listening):
    client = _client(listening(lambda connection: (_head(connection), time.sleep(5))))
    for _ in range(2):
        with pytest.raises(NoAnswerError, match="within"):
            client.send("GET", "/slow/17")
    started = time.monotonic()
    with pytest.raises(NoAnswerError, match=r"because GET /slow/\* did not respond 2 times") as error:
        client.send("GET", "/slow/18")
    assert error.value.kind == "circuit-open"
    assert time.monotonic() - started < 4


def test_an_endpoint_that_hung_a_while_ago_is_asked_again(listening, monkeypatch):
    client = _client(listening(lambda connection: (_head(connection), time.sleep(5))))
    monkeypatch.setattr("conformance.transport.pace._HANGS_WITHIN_S", 0.0)
    for _ in range(3):
        with pytest.raises(NoAnswerError, match="within") as error:
            client.send("GET", "/slow/17")
        assert error.value.kind == "timeout"


def test_what_does_not_answer_is_not_waited_for_whole_deadlines_without_an_end(listening, monkeypatch):
    monkeypatch.setattr("conformance.transport.pace._HURRIED_S", _DEADLINE / 2)
    client = _client(listening(lambda connection: (_head(connection), time.sleep(5))))
    client.connection.hangs.note_hang("GET http://other/", 61.0)
    for told in ("no response within 0.2 s", "not sent, because GET /slow/\\* did not respond in the time"):
        with pytest.raises(NoAnswerError, match=told) as error:
            client.send("GET", "/slow/17")
        assert error.value.unanswered.kind == "hurried"
    # A slow device gets more time.
    client.connection.hangs.note_answer(_DEADLINE)
    with pytest.raises(NoAnswerError, match=r"no response within 0\.4 s") as error:
        client.send("GET", "/other")
    assert error.value.unanswered.kind == "timeout"


def test_what_hung_is_sent_by_no_client_of_the_run(listening):
    client = _client(listening(lambda connection: (_head(connection), time.sleep(5))))
    for _ in range(2):
        with pytest.raises(NoAnswerError, match="within"):
            client.send("GET", "/slow")
    with pytest.raises(NoAnswerError, match="not sent"):
        talk(client, b"GET /slow HTTP/1.1\r\nHost: robot\r\n\r\n")
    ((attempt,),) = crowd(client, [[Outgoing("GET", "/slow")]], _DEADLINE)
    assert attempt.kind == "circuit-open"


@pytest.mark.parametrize(
    ("answer", "kind", "told"),
    [
        (b"", "closed", "closed the connection without a response"),
        (b"SSH-2.0-OpenSSH_9.2\r\n\r\n", "malformed", "not HTTP"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 10\r\n\r\nabc", "malformed", "not HTTP"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: ten\r\n\r\n", "malformed", "not HTTP"),
    ],
)
def test_what_is_no_answer_is_told_by_kind(listening, answer, kind, told):
    def reply(connection):
        _head(connection)
        connection.sendall(answer)
        connection.close()

    with pytest.raises(NoAnswerError, match=told) as error:
        _client(listening(reply)).send("GET", "/")
    assert error.value.kind == kind


def test_a_closed_port_is_refused(closed_port):
    with pytest.raises(NoAnswerError, match="no connection") as error:
        _client(closed_port).send("GET", "/")
    assert error.value.kind == "refused"


def test_a_rate_ceiling_is_kept(listening):
    def reply(connection):
        while connection.recv(65536):
            connection.sendall(b"HTTP/1.1 204 No Content\r\n\r\n")

    client = _client(listening(reply), request_rate=50)
    started = time.monotonic()
    for _ in range(11):
        client.send("GET", "/")
    assert time.monotonic() - started >= 10 / 50
