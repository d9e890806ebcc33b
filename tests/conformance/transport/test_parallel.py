"""Requests of several clients leave at one moment, and each has its own answer."""

import threading
from contextlib import closing

import pytest
from driven_device import Kept
from toy_server import Handler, server_of

from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, NoAnswerError, Outgoing
from conformance.transport.parallel import is_busy, send_together

CLIENTS = 4


class Together(Handler):
    """Answers when CLIENTS requests are there, or never: who sends one after the other waits in vain."""

    def answer(self):
        self.server.all_here.wait()
        status = int(self.path.partition("?")[2] or 200)
        if status == 0:
            self.close_connection = True
            return
        self.send(status, self.path.encode())


@pytest.fixture
def client():
    connection = Connection(timeout_s=60.0, listeners=[Kept()])
    to_server = server_of(Together, all_here=threading.Barrier(CLIENTS, timeout=60.0))
    with to_server as server, closing(HttpClient(server.url, connection)) as client:
        yield client


def test_each_request_has_its_answer_and_all_are_there_at_once(client):
    rounds = [[(client, Outgoing("GET", f"/{turn}/{number}")) for number in range(CLIENTS)] for turn in range(3)]
    attempts = send_together(rounds)
    assert [[item.response.body.decode() for item in turn] for turn in attempts] == [
        [item.target for _, item in turn] for turn in rounds
    ]
    assert len(client.connection.listeners[0].exchanges) == client.connection.sent == 3 * CLIENTS


def test_who_is_busy_is_not_told_of(client):
    busy, closed, *fine = send_together(
        [[(client, Outgoing("GET", path)) for path in ("/?503", "/?0", "/one", "/two")]]
    )[0]
    assert is_busy(busy)
    assert is_busy(closed)
    assert not isinstance(closed, Exchange)
    assert client.connection.listeners[0].exchanges == fine


def test_a_robot_that_does_not_answer_is_an_error(client):
    client.connection.timeout_s = 0.2
    with pytest.raises(NoAnswerError):
        send_together([[(client, Outgoing("GET", "/alone"))]])


def test_a_timeout_says_how_many_clients_were_there(client):
    client.connection.timeout_s = 0.2
    with pytest.raises(NoAnswerError, match="while 2 clients had a connection each"):
        send_together([[(client, Outgoing("GET", f"/{number}")) for number in range(2)]])


class _Interrupted(list):
    """Requests of which a signal lets only the first be begun."""

    turns = 0

    def __iter__(self):
        self.turns += 1
        for number, request in enumerate(super().__iter__()):
            if self.turns > 1 and number:
                raise KeyboardInterrupt
            yield request


def test_a_signal_while_the_requests_are_begun_leaves_no_client_waiting(client):
    """One such client kept a run alive for ever, after its result was written."""
    raised = []

    def run():
        try:
            send_together([_Interrupted((client, Outgoing("GET", f"/{number}")) for number in range(CLIENTS))])
        except KeyboardInterrupt:
            raised.append(1)

    sending = threading.Thread(target=run, daemon=True)
    sending.start()
    sending.join(60)
    assert raised == [1]
