"""What SOAP and XML show beside JSON: no good robot is blamed, not even one that is behind; a faulty one is found."""

import json
import math

import pytest
from toy_messages import STILL, ZERO, goal, header, odometry, pose

from conformance.documents.writing import xml_bytes
from conformance.packs.table1.checkers.interfaces import AcrossInterfaces, Lists
from conformance.packs.table1.checkers.plans import Plans
from conformance.packs.table1.robot.robot import GOAL_PATH, PLAN, POSE, SENSORS, VELOCITY
from conformance.packs.table1.robot.soap_services import NAMESPACE
from conformance.packs.table1.statement import Statement
from conformance.transport.exchange import Exchange, Request, Response, Unanswered
from conformance.verdict.evidence import CheckerListener
from conformance.verdict.run import Run

_BASE = "http://robot"
_A, _B = goal("a"), goal("b", x=1.0)
_FAST = {"linear": {**ZERO, "x": 0.4}, "angular": ZERO}
_SLOWER = {"linear": {**ZERO, "x": 0.401}, "angular": ZERO}


def _json(path, value):
    status, body = (404, b"{}") if value is None else (200, json.dumps(value).encode())
    return "GET", path, b"", status, "application/json", body


def _xml(path, value, name):
    status, body = (404, b"<problem/>") if value is None else (200, xml_bytes(value, name))
    return "GET", path, b"", status, "application/xml" if value else "application/problem+xml", body


def _soap(name, value):
    inner = "" if value is None else xml_bytes(value, "return").decode().rpartition("?>")[2]
    text = f'<r:Get{name}Response xmlns:r="{NAMESPACE}">{inner}</r:Get{name}Response>'
    return "POST", "/ws", f"<r:Get{name}/>".encode(), 200, "text/xml", _envelope(text)


def _envelope(text: str) -> bytes:
    space = "http://schemas.xmlsoap.org/soap/envelope/"
    return f'<s:Envelope xmlns:s="{space}"><s:Body>{text}</s:Body></s:Envelope>'.encode()


def _fault():
    text = "<s:Fault><faultcode>s:Server</faultcode><faultstring>no goal</faultstring></s:Fault>"
    return "POST", "/ws", b"<r:GetGoal/>", 500, "text/xml", _envelope(text)


def _head(status):
    return "HEAD", GOAL_PATH, b"", status, "application/json", b""


_PUT = ("PUT", GOAL_PATH, b"{}", 202, "application/json", b"{}")
_PUT_VELOCITY = ("PUT", VELOCITY, b"{}", 204, "application/json", b"")


def _refuted(checker, reads, apart_s=1.0) -> set[str]:
    """Return what is refuted by exchanges that follow each other."""
    run = Run(statement=Statement())
    observer = CheckerListener(run.judge, [checker])
    for number, (method, path, sent, status, media_type, body) in enumerate(reads, 1):
        response = Response(status, (("Content-Type", media_type),), body, 1.0, received_s=10 + number * apart_s)
        observer.on_response(Exchange(Request(method, _BASE + path, (), sent), response))
    return set(run.judge.failure_counts())


def _goals(other, value):
    return [_json(GOAL_PATH, value), other, _json(GOAL_PATH, value)]


def _speeds(other, value):
    return [_json(VELOCITY, value), other, _json(VELOCITY, value)]


@pytest.mark.parametrize(
    "reads",
    [
        _goals(_soap("Goal", _A), _A) * 3,
        _goals(_soap("Goal", None), None) * 3,
        _goals(_fault(), None) * 3,
        _goals(_head(404), None) * 3,
        _goals(_head(200), _A) * 3,
        _goals(_xml(GOAL_PATH, _A, "MoveBaseActionGoal"), _A) * 3,
        _goals(_xml(GOAL_PATH, None, ""), None) * 3,
        _goals(_soap("Goal", _A), None),  # once is none too often
        [_json(GOAL_PATH, _A), _soap("Goal", _B), _json(GOAL_PATH, _B)] * 3,  # another client's
        [_json(GOAL_PATH, None), _PUT, _soap("Goal", None), _json(GOAL_PATH, _A)] * 3,  # it is behind
        _speeds(_soap("Velocity", STILL), STILL) * 3,
        _speeds(_soap("Velocity", _SLOWER), _FAST) * 3,
        _speeds(_xml(VELOCITY, _FAST, "Twist"), _FAST) * 3,
        [_json(VELOCITY, _FAST), _soap("Velocity", _FAST), _json(VELOCITY, STILL)] * 3,
        [_PUT_VELOCITY, *_speeds(_soap("Velocity", _FAST), STILL)] * 3,  # so soon after a command
    ],
)
def test_a_good_robot_is_not_blamed(reads):
    apart_s = 0.1 if _PUT_VELOCITY in reads else 1.0
    assert _refuted(AcrossInterfaces(_BASE.__add__, Statement().limits), reads, apart_s) == set()


@pytest.mark.parametrize(
    ("reads", "requirement"),
    [
        (_goals(_soap("Goal", _A), None), "equivalence/goal"),
        (_goals(_soap("Goal", None), _A), "equivalence/goal"),
        (_goals(_fault(), _A), "equivalence/goal"),
        (_goals(_head(200), None), "http/head"),
        (_goals(_head(404), _A), "http/head"),
        (_goals(_soap("Goal", _B), _A), "equivalence/goal"),
        (_goals(_xml(GOAL_PATH, _B, "MoveBaseActionGoal"), _A), "rest-formats/same-values"),
        (_goals(_xml(GOAL_PATH, None, ""), _A), "rest-formats/same-values"),
        (_speeds(_soap("Velocity", _FAST), STILL), "equivalence/pose"),
        (_speeds(_xml(VELOCITY, STILL, "Twist"), _FAST), "rest-formats/same-values"),
    ],
)
def test_one_that_shows_something_else_twice_is_found(reads, requirement):
    between = [_json(SENSORS, [])] * 3
    assert _refuted(AcrossInterfaces(_BASE.__add__, Statement().limits), [*reads, *between, *reads]) == {requirement}


def test_what_has_no_response_may_have_changed_the_goal():
    run = Run(statement=Statement())
    observer = CheckerListener(run.judge, [AcrossInterfaces(_BASE.__add__, Statement().limits)])
    for number in range(4):
        for method, path, sent, status, media_type, body in (_json(GOAL_PATH, _A), _soap("Goal", None)):
            response = Response(status, (("Content-Type", media_type),), body, 1.0, received_s=number + 1.0)
            observer.on_response(Exchange(Request(method, _BASE + path, (), sent), response))
        observer.on_no_response(Unanswered(Request("DELETE", _BASE + GOAL_PATH), "none", "timeout"))
    assert not run.judge.failure_counts()


def _at(x):
    return _json(POSE, odometry(x=x))


def _plan(x, query="x=5&y=0"):
    poses = [{"header": header(), "pose": pose(x + step * (5 - x) / 20)} for step in range(21)]
    return _json(f"{PLAN}?{query}", {"plan": {"header": header(), "poses": poses}})


@pytest.mark.parametrize(
    ("reads", "found"),
    [
        ([_at(1.0), _plan(1.0), _at(1.0)] * 3, False),
        ([_at(1.0), _plan(1.2), _at(1.01)] * 3, False),
        ([_at(1.0), _plan(3.0, "x=5&y=0&start_x=3&start_y=0"), _at(1.0)] * 3, False),
        ([_at(1.0), _plan(3.0), _at(3.0)] * 3, False),  # it drives
        ([_at(1.0), _plan(3.0), _at(1.0)], False),  # once
        ([_at(1.0), _PUT, _plan(3.0), _at(1.0)] * 3, False),
        ([_at(1.0), _plan(3.0), _at(1.0)] * 2, True),
        ([_at(1.0), _plan(0.5), _at(1.0), _at(1.0), _plan(1.0), _at(1.0), _at(2.0), _plan(1.0), _at(2.0)], True),
        ([_at(2.0), _plan(0.0), _at(2.0)] * 2, True),
        ([_at(-4.0), _plan(4.0), _at(-4.0)] * 2, True),
    ],
)
def test_a_plan_starts_where_the_robot_stands(reads, found):
    assert ("rest-resources/plan-start" in _refuted(Plans(_BASE.__add__, Statement()), reads)) is found


_LIDAR = {"name": "lidar", "topic": "/scan", "type": "sensor_msgs/msg/LaserScan"}


@pytest.mark.parametrize(
    ("entries", "requirement"),
    [
        ([_LIDAR], ""),
        ([], ""),
        ([_LIDAR, {**_LIDAR, "name": "other"}], ""),
        ([{**_LIDAR, "more": math.pi}], ""),
        ([_LIDAR, _LIDAR], "rest-resources/sensors-type"),
        ([_LIDAR, {**_LIDAR, "more": 1}], "rest-resources/sensors-type"),
        ([{**_LIDAR, "type": "LaserScan"}], "rest-resources/sensors-type"),
        ([{**_LIDAR, "type": "sensor_msgs/LaserScan"}], "rest-resources/sensors-type"),
    ],
)
def test_each_list_that_is_read_has_no_entry_twice_and_full_types(entries, requirement):
    assert _refuted(Lists(_BASE.__add__), [_json(SENSORS, entries)]) == ({requirement} if requirement else set())
