"""A kept connection that the server closes is no crash, unless a new one is refused or closed too."""

import socket
import threading

import pytest

from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswer, NoAnswerError

_ANSWER = b"HTTP/1.1 500 Oops\r\nContent-Length: 0\r\n\r\n"


def _read(connection: socket.socket) -> bytes:
    octets = b""
    while b"\r\n\r\n" not in octets and (piece := connection.recv(4096)):
        octets += piece
    return octets


def _answers_one(connection: socket.socket) -> None:
    """Answer one request, read another one, and close without a word."""
    _read(connection)
    connection.sendall(_ANSWER)
    _read(connection)
    connection.close()


def _answers_one_of_a_kind(connection: socket.socket) -> None:
    """Answer one request, and none with `poison` in it, on any connection."""
    while octets := _read(connection):
        if b"poison" in octets:
            connection.close()
            return
        connection.sendall(_ANSWER)


@pytest.mark.parametrize("method", ["POST", "PATCH", "PUT", "GET"])
def test_a_server_that_closes_after_an_answer_is_asked_again(listening, method):
    connection = Connection(timeout_s=60, resends=True)
    client = HttpClient(listening(_answers_one), connection)
    assert [client.send(method, "/").response.status for _ in range(3)] == [500] * 3
    assert connection.resent == 1


def test_what_may_act_twice_is_not_sent_again_unless_the_run_allows_it(listening):
    client = HttpClient(listening(_answers_one), Connection(timeout_s=60))
    client.send("POST", "/")
    with pytest.raises(NoAnswerError):
        client.send("POST", "/")


def test_a_request_that_a_new_connection_does_not_answer_either_is_told_twice(listening):
    client = HttpClient(listening(_answers_one_of_a_kind), Connection(timeout_s=60, resends=True))
    client.send("POST", "/")
    with pytest.raises(NoAnswerError, match="2 of 2 times") as closed:
        client.send("POST", "/poison")
    assert closed.value.kind is NoAnswer.CLOSED


def test_a_server_that_is_gone_after_a_request_has_closed_its_connection():
    def serve() -> None:
        connection, _ = server.accept()
        with connection:
            _read(connection)
            connection.sendall(_ANSWER)
            _read(connection)
            server.close()

    server = socket.create_server(("127.0.0.1", 0))
    client = HttpClient(f"http://127.0.0.1:{server.getsockname()[1]}", Connection(timeout_s=60))
    thread = threading.Thread(target=serve)
    thread.start()
    client.send("GET", "/")
    with pytest.raises(NoAnswerError, match="accepts no other connection") as gone:
        client.send("GET", "/last")
    thread.join()
    assert gone.value.kind is NoAnswer.CLOSED
    assert [one.kind for one in client.connection.recent] == [None, NoAnswer.CLOSED]
