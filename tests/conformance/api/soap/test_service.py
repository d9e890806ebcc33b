"""Where a service is, whatever its WSDL is; a bad robot is never a reason to give up."""

import time

import pytest

from conformance.api.soap.service import open_service
from conformance.papers_robot.statement import CONTRACT_DIR
from conformance.statement.statement import StatementError
from conformance.transport.client import Connection
from conformance.transport.reach import Trust

WSDL = (CONTRACT_DIR / "publishers.wsdl").read_bytes()
PATH = CONTRACT_DIR / "publishers.wsdl"


def answered(body: bytes, status: str = "200 OK"):
    def handle(connection):
        while connection.recv(65536):
            head = f"HTTP/1.1 {status}\r\nContent-Type: text/xml\r\nContent-Length: {len(body)}\r\n\r\n"
            connection.sendall(head.encode() + body)

    return handle


def opened(wsdl, endpoint=None, timeout_s=60.0):
    return open_service("publishers", wsdl, endpoint, Connection(timeout_s=timeout_s), PATH)


def addressed(location: str) -> bytes:
    return WSDL.replace(b"http://127.0.0.1:5555/turtlesim_publisher_ws", location.encode())


@pytest.mark.parametrize(
    ("problem", "answer"),
    [
        ("405", (b"", "405 Method Not Allowed")),
        ("not well-formed XML", (b"<html><br></html>",)),
        ("instead of wsdl:definitions", (b"<html/>",)),
        ("not well-formed XML", (b"\xff\xfe\x00",)),
        ("no", (b'<!DOCTYPE a [<!ENTITY b "&b;">]><a>&b;</a>',)),
    ],
)
def test_without_a_wsdl_the_service_is_at_its_url(listening, problem, answer):
    base = listening(answered(*answer))
    service = opened(f"{base}/robot_ws?wsdl")
    assert service.endpoint == f"{base}/robot_ws"
    assert service.own is None
    assert problem in service.own_problem
    assert service.description is service.contract


def test_a_robot_that_hangs_costs_its_deadline(listening):
    base = listening(lambda connection: connection.recv(65536) and time.sleep(60))
    started = time.monotonic()
    service = opened(f"{base}/robot_ws?wsdl", timeout_s=0.3)
    assert time.monotonic() - started < 30
    assert "no response within" in service.own_problem
    assert service.endpoint == f"{base}/robot_ws"


def test_a_closed_port_is_no_error():
    service = opened("http://127.0.0.1:9/robot_ws?wsdl")
    assert service.endpoint == "http://127.0.0.1:9/robot_ws"
    assert service.published.document is None


def test_the_address_in_the_wsdl_is_taken_where_it_answers(listening):
    there = listening(answered(b"", "405 Method Not Allowed"))
    base = listening(answered(addressed(f"{there}/elsewhere")))
    assert opened(f"{base}/robot_ws?wsdl").endpoint == f"{base}/robot_ws", "another server is not followed"
    trust = Trust.of(hosts=[there.removeprefix("http://")])
    service = open_service("publishers", f"{base}/robot_ws?wsdl", None, Connection(timeout_s=60.0, trust=trust), PATH)
    assert service.endpoint == f"{there}/elsewhere"


@pytest.mark.parametrize(
    "location", ["http://0.0.0.0:5555/x", "http://127.0.0.1:9/x", "REPLACE_WITH_URL", "http://[/", ""]
)
def test_an_address_of_no_use_is_not_taken(listening, location):
    base = listening(answered(addressed(location)))
    assert opened(f"{base}/robot_ws?wsdl").endpoint == f"{base}/robot_ws"


def test_a_given_endpoint_wins(listening):
    base = listening(answered(WSDL))
    assert opened(f"{base}/robot_ws?wsdl", "http://127.0.0.1:7777/other").endpoint == "http://127.0.0.1:7777/other"


def test_a_token_does_not_follow_an_address_to_another_host(listening):
    base = listening(answered(addressed("http://localhost.example.invalid:5555/x")))
    service = open_service("publishers", f"{base}/w?wsdl", None, Connection(timeout_s=60.0, token="secret"), PATH)  # noqa: S106 - no secret
    assert service.endpoint == f"{base}/w"


def test_a_wsdl_file_says_where_the_service_is(tmp_path):
    file = tmp_path / "robot.wsdl"
    file.write_bytes(addressed("http://127.0.0.1:5556/there"))
    (tmp_path / "publishers.xsd").write_bytes((CONTRACT_DIR / "publishers.xsd").read_bytes())
    service = opened(str(file))
    assert service.endpoint == "http://127.0.0.1:5556/there"
    assert service.own is not None
    assert service.own.types.problems == []


def test_a_wsdl_file_without_an_address_needs_an_endpoint(tmp_path):
    file = tmp_path / "robot.wsdl"
    file.write_bytes(addressed("REPLACE_WITH_URL"))
    with pytest.raises(StatementError, match="--publishers-endpoint"):
        opened(str(file))
    assert opened(str(file), "http://127.0.0.1:5556/there").endpoint == "http://127.0.0.1:5556/there"


@pytest.mark.parametrize(
    ("wsdl", "endpoint"), [("/no/such/file.wsdl", None), ("ftp://a/b", None), (None, "robot:5555")]
)
def test_what_names_no_place_is_an_error_of_the_statement(wsdl, endpoint):
    with pytest.raises(StatementError):
        opened(wsdl, endpoint)
