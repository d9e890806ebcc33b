import select
import socket
import statistics
import threading
import time
from contextlib import closing

import pytest
from toy_server import Handler, server_of

from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NoAnswer, NoAnswerError, Outgoing
from conformance.transport.parallel import send_together
from conformance.transport.raw import head, talk


class _Handler(Handler):
    """Counts connections, and ends each after so many answers without saying so."""

    def setup(self) -> None:
        super().setup()
        self.server.opened += 1
        self.left = self.server.answers

    def answer(self) -> None:
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


@pytest.fixture
def asking():
    """A server, which can be told after how many answers it ends a connection, and a client of it."""
    to_server = server_of(_Handler, answers=1000, body=b"", opened=0, ended=threading.Semaphore(0))
    with to_server as server, closing(HttpClient(server.url, Connection())) as client:
        yield server, client


def test_requests_follow_each_other_on_one_connection(asking):
    server, client = asking
    for _ in range(5):
        assert client.send("GET", "/").response.status == 200
    assert server.opened == 1


def test_a_connection_that_the_server_has_ended_is_not_used_again(asking):
    server, client = asking
    server.answers = 2
    for turn in range(6):
        assert client.send("GET", "/").response.status == 200
        if turn % 2:
            assert server.ended.acquire(timeout=60)
    # None of them was sent on a closed connection and then once more.
    assert (server.opened, client.connection.sent) == (3, 6)


def test_a_server_that_serves_one_connection_at_a_time_gets_the_next_one():
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            for _ in range(4):
                link, _ = listening.accept()
                with link:
                    while link.recv(4096):
                        link.sendall(b"HTTP/1.1 204 No Content\r\n\r\n")

        threading.Thread(target=serve, daemon=True).start()
        with closing(HttpClient(f"http://127.0.0.1:{listening.getsockname()[1]}", Connection(timeout_s=5))) as client:
            client.send("GET", "/")
            assert client.send("GET", "/", fresh=True).response.status == 204
            client.send("GET", "/")
            assert talk(client, head(client, "GET", "/"), answers=1).octets.startswith(b"HTTP/1.1 204")


@pytest.mark.parametrize("closes", ["the client", "its request"])
def test_what_is_asked_for_on_its_own_connection_leaves_none_open(asking, closes):
    server, client = asking
    client.send("GET", "/", fresh=closes == "its request")
    if closes == "the client":
        client.close()
    assert server.ended.acquire(timeout=60)
    assert client.send("GET", "/").response.status == 200
    assert server.opened == 2


def test_a_server_that_awaits_an_acknowledgement_in_mid_answer_gets_it_at_once(asking):
    server, client = asking
    server.body = b"the second segment, which Nagle's algorithm keeps back"
    times = []
    for _ in range(21):
        began = time.monotonic()
        assert client.send("GET", "/").response.body == server.body
        times.append(time.monotonic() - began)
    if hasattr(socket, "TCP_QUICKACK"):
        # A delayed acknowledgement takes 0.04 s, and on a busy machine some take as long without.
        assert statistics.quantiles(times)[0] < 0.02


class _Stale(Handler):
    """Reads a second request on a connection and closes it in place of a response; or reads none, and closes."""

    def setup(self) -> None:
        super().setup()
        self.answered = 0

    def answer(self) -> None:
        self.content()
        self.server.seen.append(self.command)
        if self.path == "/broken" or self.answered:
            self.close_connection = True
            return
        self.answered += 1
        self.send_response(204)
        self.end_headers()


@pytest.fixture
def stale():
    with server_of(_Stale, seen=[]) as server, closing(HttpClient(server.url, Connection(timeout_s=60))) as client:
        yield server, client


@pytest.mark.parametrize("method", ["GET", "HEAD", "OPTIONS", "PUT", "DELETE"])
def test_an_idempotent_request_on_a_connection_that_the_server_closed_is_sent_again_and_counted(stale, method):
    server, client = stale
    client.send("GET", "/")
    assert client.send(method, "/").response.status == 204
    assert server.seen == ["GET", method, method]
    assert (client.connection.resent, client.connection.sent) == (1, 3)


def test_where_the_run_allows_it_a_request_that_may_act_twice_is_sent_again_as_well(stale):
    server, client = stale
    client.connection.resends = True
    client.send("GET", "/")
    assert client.send("POST", "/").response.status == 204
    assert server.seen == ["GET", "POST", "POST"]


def test_a_request_that_is_not_idempotent_and_was_read_is_not_sent_again(stale):
    server, client = stale
    client.send("GET", "/")
    with pytest.raises(NoAnswerError, match=r"closed the connection without a response$"):
        client.send("POST", "/", body=b"order")
    assert (server.seen, client.connection.resent) == (["GET", "POST"], 0)


@pytest.mark.parametrize("method", ["GET", "POST"])
def test_a_connection_that_is_closed_again_is_told_with_the_response_before(stale, method):
    server, client = stale
    client.connection.resends = method == "POST"
    client.send("GET", "/")
    with pytest.raises(NoAnswerError) as none:
        client.send(method, "/broken")
    assert none.value.kind is NoAnswer.CLOSED
    assert str(none.value) == (
        "the server closed the connection without a response, 2 of 2 times; "
        "the request before it on the first connection was answered 204"
    )
    assert server.seen == ["GET", method, method]


def test_the_first_request_of_a_connection_is_sent_once(stale):
    server, client = stale
    with pytest.raises(NoAnswerError, match=r"closed the connection without a response$"):
        client.send("GET", "/broken")
    assert server.seen == ["GET"]


def test_a_request_that_nobody_can_have_read_is_sent_again_whatever_its_method():
    """The server closes with the request unread, so that the network resets the connection."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            answer = b"HTTP/1.1 204 No Content\r\n\r\n"
            first, _ = listening.accept()
            with first:
                first.recv(65536)
                first.sendall(answer)
                while not select.select([first], [], [], 5)[0]:
                    pass
            second, _ = listening.accept()
            with second:
                second.recv(65536)
                second.sendall(answer)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        client = HttpClient(f"http://127.0.0.1:{listening.getsockname()[1]}", Connection(timeout_s=2))
        client.send("GET", "/")
        assert client.send("POST", "/", body=b"order").response.status == 204
        assert client.connection.resent == 1
        client.close()
        thread.join()


def test_a_server_that_is_gone_after_a_request_has_closed_its_connection():
    def serve() -> None:
        connection, _ = server.accept()
        with connection:
            connection.recv(65536)
            connection.sendall(b"HTTP/1.1 204 No Content\r\n\r\n")
            connection.recv(65536)
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


def test_what_several_clients_send_again_is_counted(stale):
    server, client = stale
    rounds = [[(client, Outgoing("GET", "/"))] * 2] * 2
    assert [attempt.response.status for attempts in send_together(rounds) for attempt in attempts] == [204] * 4
    assert (client.connection.resent, len(server.seen)) == (2, 6)
