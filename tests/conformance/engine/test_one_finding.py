"""A robot with one fault has one finding, however many checks meet it; smaller requests than one."""

import json
import sys
import time

import pytest
from processes import ended
from toy_server import Handler, server_of

from conformance.cli.summary import print_summary
from conformance.contract.pack import Contract
from conformance.engine.certification import certify
from conformance.engine.lost_device import smaller
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import empty_statement
from conformance.transport.client import Connection
from conformance.transport.exchange import Request
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

_SENSORS = "/robot/sensors/"


class _Handler(Handler):
    """Has a fault in /robot/sensors/, and a list of services."""

    def answer(self):
        body = b"[]" if self.path.startswith("/robot/navigation/services/") else b""
        path = self.path.split("?")[0]
        if path == _SENSORS:
            body = self.server.fault(self)
            if body is None:
                self.close_connection = True
                return
        if body:
            self.send(self.server.status if path == _SENSORS else 200, body)
        else:
            self.send(404, b'{"status": 404}', "application/problem+json")


def _endless(handler):
    handler.send_response(200)
    handler.send_header("Content-Type", "text/event-stream")
    handler.end_headers()
    until = time.monotonic() + 60
    while time.monotonic() < until:
        try:
            handler.wfile.write(b"data: 1\n\n")
            handler.wfile.flush()
        except OSError:
            break
        time.sleep(0.05)


# Fault, status, kind of cause, and the requirement that it is a finding of.
_FAULTS = {
    "closes": (lambda _: None, 0, "no-response", "rest-resources/sensors-type"),
    "never ends": (_endless, 0, "hang", "rest-resources/sensors-type"),
    "fails": (lambda _: b"{}", 500, "server-error", "http/declared-status"),
    "is cut short": (lambda _: b'[{"name": "a"', 200, "unreadable", "http/declared-body"),
}
_ONLY = (
    *("rest-resources/sensors-type", "rest-resources/sensors-unique", "rest-resources/sensors-stable"),
    *("rest-resources/services-type", "rest-formats/json-default", "rest-formats/same-values"),
    *("http/head", "http/declared-status", "http/declared-body"),
)


@pytest.mark.parametrize("name", _FAULTS)
def test_one_fault_is_one_finding(name, tmp_path, capsys):
    fault, status, kind, owner = _FAULTS[name]
    contract = Contract.load(only=_ONLY)
    classes = tuple(dict.fromkeys(id_.split("/")[0] for id_ in _ONLY))
    with server_of(_Handler, fault=fault, status=status) as server:
        statement = type(empty_statement(contract))(endpoints=Endpoints(rest=server.url))
        run = Run(statement=statement, contract=contract, claims=classes, effort=Effort("quick"))
        # Only a body that never ends has to be waited for; the other responses may be slow on a busy machine.
        connection = Connection(timeout_s=2 if name == "never ends" else 60)
        outcome = certify(RobotUnderTest(run, connection), tmp_path, progress=None)
    document = json.loads(outcome.path.read_text(encoding="utf-8"))
    of_sensors = [one for one in document["causes"] if _SENSORS in one["text"]]
    assert [(one["kind"], one["requirement"], one["text"].count("GET /robot/sensors/")) for one in of_sensors] == [
        (kind, owner, 1)
    ], of_sensors
    (cause,) = of_sensors
    assert cause["number"] == 1
    waiting = {item["id"]: item for item in document["requirements"] if item.get("because_of") == 1}
    assert set(waiting) == set(cause["blocks"])
    assert ("rest-resources/sensors-type" in waiting) == (owner != "rest-resources/sensors-type")
    assert all(item["verdict"] == "skip" and not item["failures"] for item in waiting.values())
    assert all(item["reason"].startswith("Not tested, because of finding 1: ") for item in waiting.values())
    (failed,) = (item for item in document["requirements"] if item["id"] == owner)
    (failure,) = (one for one in failed["failures"] if one["number"] == 1)
    assert failure["message"] == cause["text"]
    assert (failure["subject"], failure["cause"]) == ("GET /robot/sensors/", kind)
    assert failure["observed"] in failure["message"]
    assert (document["verdict"], document["resent_requests"] > 0) == ("not-conformant", name == "closes")
    if name == "closes":
        assert "closed the connection without a response" in failure["observed"]
    print_summary(outcome)
    shown = capsys.readouterr().out
    assert shown.count(cause["text"]) == 1
    assert f"\n1. FAIL {owner} (" in shown
    assert f"not tested because of it: {cause['blocks'][0]}" in shown


class _Dropping(_Handler):
    """Closes each connection on its fifth request, in place of a response."""

    def setup(self):
        super().setup()
        self.left = 4

    def answer(self):
        self.left -= 1
        if self.left < 0:
            self.close_connection = True
        else:
            self.send(200, b"[]")


def test_requests_that_are_dropped_again_and_again_on_a_busy_connection_are_one_finding(tmp_path):
    contract = Contract.load(only=("http/many-requests", "http/head"))
    with server_of(_Dropping) as server:
        statement = type(empty_statement(contract))(endpoints=Endpoints(rest=server.url))
        run = Run(statement=statement, contract=contract, claims=("http",), effort=Effort("quick"))
        document = certify(RobotUnderTest(run, Connection(timeout_s=60)), tmp_path, progress=None).document
    assert {item["id"]: item["verdict"] for item in document["requirements"]}["http/many-requests"] == "fail"
    (failure,) = (one for item in document["requirements"] for one in item["failures"] if "many" in item["id"])
    assert "the server closed 3 times without a response" in failure["message"]


_CHECKS = """
import pytest

@pytest.mark.requirement("rest-resources/sensors-type")
def test_first(rest):
    rest.send("GET", "/robot/sensors/")

@pytest.mark.requirement("rest-formats/json-default")
def test_second(rest):
    rest.send("GET", "/robot/sensors/")
"""


def test_in_somebody_elses_project_one_cause_fails_one_test(tmp_path):
    (tmp_path / "test_checks.py").write_text(_CHECKS, encoding="utf-8")
    with server_of(_Handler, fault=_FAULTS["closes"][0], status=0) as server:
        command = [sys.executable, "-m", "pytest", "-rs", "-p", "roaas_pytest", "test_checks.py"]
        command += ["--robot-rest", server.url]
        done = ended(*command, cwd=tmp_path)
    assert "1 failed, 1 skipped" in done.stdout, done.stdout
    assert "Sent `GET /robot/sensors/`. Expected a response (rest-resources/sensors-type" in done.stdout
    assert "Not tested, because of a failure before: GET /robot/sensors/: no response" in done.stdout


_JSON = (("Accept", "*/*"), ("Content-Type", "application/json"))


def _minimal(request: Request, does) -> Request:
    """Return the request that is left when no smaller one does it."""
    while (less := next(filter(does, smaller(request)), None)) is not None:
        request = less
    return request


def test_a_parameter_that_does_it_stays_alone():
    request = Request("GET", "http://arm/pose?x=1&z=1e308&y=2", (("Accept", "*/*"), ("X-Trace", "1")))
    assert _minimal(request, lambda one: "z=1e308" in one.url) == Request("GET", "http://arm/pose?z=1e308", _JSON[:1])


def test_a_member_that_does_it_stays_with_those_around_it():
    body = json.dumps({"name": "a", "pose": {"x": 1.0, "z": 1e308, "joints": [1, 2, -1]}, "speed": 3}).encode()

    def does(one: Request) -> bool:
        return b"1e+308" in one.body

    found = _minimal(Request("POST", "http://arm/move", _JSON, body), does)
    assert json.loads(found.body) == {"pose": {"z": 1e308}}
    assert found.headers == _JSON


def test_a_long_text_becomes_shorter():
    body = json.dumps({"text": "a" * 10_000}).encode()
    found = _minimal(Request("POST", "http://arm/say", _JSON, body), lambda one: len(one.body) > 1000)
    assert 1000 < len(found.body) < 2600


def test_no_part_is_taken_twice_and_nothing_is_taken_from_nothing():
    assert list(smaller(Request("GET", "http://arm/pose", _JSON[:1]))) == []
    assert list(smaller(Request("GET", "http://arm/", (), b"", b"raw"))) == []


def test_what_is_no_json_is_halved():
    (empty, half) = smaller(Request("PUT", "http://arm/", _JSON[:1], b"\xff\xfe\x00\x01"))
    assert (empty.body, half.body) == (b"", b"\xff\xfe")
