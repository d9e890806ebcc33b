"""Without --allow-motion nothing that could act is sent, whatever a check does: seen by the robot."""

import re
import socket
import threading
from urllib.parse import urlsplit

import msgspec
import pytest
from small_device import contract_of

from conformance.api.permission import Permission
from conformance.contract.pack import Contract
from conformance.engine.certification import certify
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Calls, Statement, empty_statement
from conformance.transport import raw
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import NotPermittedError, Outgoing
from conformance.transport.parallel import send_together
from conformance.transport.raw import PartialRequest
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run
from proof.table1.independent_robots import plain

_READS = "/turtlesim_subscriber_ws"
_LINE = re.compile(rb"([A-Z]+) (\S+) HTTP/\d")
_SAFE = {"GET", "HEAD", "OPTIONS"}


class Recording:
    """A TCP relay to a robot; keeps what clients sent over each connection."""

    def __init__(self, url, listening):
        self._to = urlsplit(url).port
        self._sent = []
        self.url = listening(self._relay)

    def _relay(self, client):
        heard = bytearray()
        self._sent.append(heard)
        with client, socket.create_connection(("127.0.0.1", self._to)) as robot:
            back = threading.Thread(target=self._answer, args=(robot, client), daemon=True)
            back.start()
            while octets := client.recv(65536):
                heard += octets
                robot.sendall(octets)
            robot.shutdown(socket.SHUT_WR)
            back.join()

    @staticmethod
    def _answer(robot, client):
        try:
            while octets := robot.recv(65536):
                client.sendall(octets)
            client.shutdown(socket.SHUT_WR)
        except OSError:
            return

    @property
    def requests(self):
        return [(one[1].decode(), one[2].decode()) for heard in self._sent for one in _LINE.finditer(bytes(heard))]


@pytest.fixture
def robot(listening):
    rest, soap, stop = plain.serve(0, 0)
    yield Recording(rest, listening), Recording(soap, listening)
    stop()


def test_a_whole_run_without_permission_sends_nothing_that_acts(robot, tmp_path, monkeypatch):
    rest, soap = robot
    contract = Contract.load()
    where = Endpoints(
        rest=rest.url,
        publishers_endpoint=f"{soap.url}/turtlesim_publisher_ws",
        subscribers_endpoint=f"{soap.url}{_READS}",
        timeout_s=60.0,
    )
    statement = msgspec.structs.replace(empty_statement(contract), endpoints=where)
    run = Run(statement=statement, contract=contract, claims=tuple(contract.classes), effort=Effort("quick"))
    tested = RobotUnderTest(run, Connection(timeout_s=60.0))
    stopped = []
    take_slot = Connection.take_slot

    def remembering(self, *requests):
        try:
            take_slot(self, *requests)
        except NotPermittedError as error:
            stopped.append(str(error))
            raise

    monkeypatch.setattr(Connection, "take_slot", remembering)
    document = certify(tested, tmp_path, progress=None).document
    acting = [(method, path) for method, path in rest.requests + soap.requests if method not in _SAFE]
    assert {method for method, _ in rest.requests} >= {"GET", "HEAD", "OPTIONS"}
    assert set(acting) == {("POST", _READS)}
    assert stopped == [], "checks ask before they send; the guard is for those that forget"
    verdicts = {item["id"]: item["verdict"] for item in document["requirements"]}
    assert verdicts["http/method-not-allowed"] == verdicts["rest-delivery/put"] == "skip"
    assert verdicts["http/head"] == verdicts["soap-subscribers/pose"] == "pass"
    assert "error" not in verdicts.values()


def send(client):
    client.send("PUT", "/a")


def send_raw(client):
    raw.talk(client, raw.head(client, "PUT", "/a"))


def send_behind(client):
    raw.talk(client, raw.head(client, "GET", "/a", "Content-Length: 20") + b"0\r\n\r\n" + raw.head(client, "PUT", "/a"))


def send_part(client):
    PartialRequest(client, "PUT", "/a")


def send_many(client):
    send_together([[(client, Outgoing("DELETE", "/a")), (client, Outgoing("GET", "/a"))]])


@pytest.mark.parametrize("way", [send, send_raw, send_behind, send_part, send_many])
def test_no_way_leads_around_the_guard(way, closed_port):
    connection = Connection(permit=Permission(Run()).refusal)
    with pytest.raises(NotPermittedError, match="--allow-motion was not given"):
        way(HttpClient(closed_port, connection))
    assert connection.sent == 0


@pytest.mark.parametrize(
    ("octets", "requests"),
    [
        (b"GET /a HTTP/1.1\r\nHost: b\r\n\r\nPUT /c HTTP/1.1\r\n", [("GET", "/a"), ("PUT", "/c")]),
        (b"POST /a HTTP/1.1\r\n\r\n{}DELETE /b HTTP/1.1", [("POST", "/a"), ("DELETE", "/b")]),
        (b"PUT /old\r\n\r\n", [("PUT", "/old")]),
        (b"GET /a HTTP/1.1\r\nHost : b\r\nX: PUT\r\n folded\r\n\r\n", [("GET", "/a")]),
        (b"PUT\x0b/a HTTP/1.1\r\n\r\n", [("PUT", "/a")]),
        (b"GET / HTTP/1.1\r\n\r\nMOVE\x0c/a\r\n", [("GET", "/"), ("MOVE", "/a")]),
        (b"PUT\r/a\rHTTP/1.1\n\n", [("PUT", "/a")]),
        (b"put /a\r\n", [("put", "/a")]),
        (b"\r\n\r\nSTART http://r2/a\r\n", [("START", "http://r2/a")]),
        (b"GET / HTTP/1.1\r\nAccept: a/b, c /d\r\n\r\nsome text, and /more of it", [("GET", "/")]),
        (b"ROBOT\r\n\r\n", []),
        (b"\x00\xff{}\r\n\r\n", []),
    ],
)
def test_request_lines_in_raw_bytes(octets, requests):
    assert raw.requests_in(octets) == requests


def test_the_service_that_reads_takes_messages_unless_it_is_the_one_that_acts():
    permission = Permission(Run())
    permission.may_post_to("http://robot:5555/read")
    assert permission.refusal("POST", "http://robot:5555/read?wsdl") == ""
    assert permission.refusal("PUT", "http://robot:5555/read")
    permission.forbid_post_to("http://robot:5555/read")
    assert permission.refusal("POST", "http://robot:5555/read")
    assert Permission(Run(allow_motion=True)).refusal("DELETE", "http://robot/") == ""


@pytest.mark.parametrize(
    ("path", "sent"),
    [
        ("/play/a%2Fb/c", True),
        ("/play/a/c", True),
        ("/play/..%2F..%2Fstop/c", False),
        ("/play/a%2Fb", True),
        ("/play%2Fa%2Fc", True),
        ("/%73top/now", False),
    ],
)
def test_a_slash_in_a_value_is_no_other_path(tmp_path, path, sent):
    """A robot with the calls /play/{set}/{move} (allowed) and /stop/now (not)."""
    document = {
        "openapi": "3.1.0",
        "info": {"title": "Mini", "version": "1"},
        "paths": {
            "/play/{set}/{move}": {"post": {"responses": {"200": {"description": "it"}}}},
            "/stop/now": {"post": {"responses": {"200": {"description": "it"}}}},
        },
    }
    contract = contract_of(tmp_path, document)
    statement = Statement(endpoints=Endpoints(rest="http://h"), calls=Calls(allow=("POST /play/{set}/{move}",)))
    refusal = Permission(Run(statement=statement, contract=contract)).refusal("POST", f"http://h{path}")
    assert (not refusal) == sent
