import json
import time
from dataclasses import replace

import pytest
from toy_messages import STILL, ZERO, odometry

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.checkers.interfaces import Lists
from conformance.packs.table1.checkers.state import State
from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.clock import Clock
from conformance.packs.table1.robot.robot import SENSORS
from conformance.packs.table1.robot.soap_services import NAMESPACE
from conformance.packs.table1.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.credentials import Credential, Credentials, Kind
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import CheckerListener
from conformance.verdict.run import Run

_BASE = "http://robot:7003/r2d2"


def opened(statement: Statement) -> RestInterface:
    api = RestInterface(Run(statement=statement), HttpClient(_BASE + "/", Connection()))
    watch(api)
    return api


def watch(api: RestInterface) -> None:
    connection = api.client.connection
    checker = State(api.client.url, api.run.statement.limits, Clock(), connection.credentials)
    connection.listeners[:] = [CheckerListener(api.run.judge, [checker])]


@pytest.mark.parametrize(("received_s", "refuted"), [(100.001, set()), (100.1, {"rest-resources/pose-stamp"})])
def test_answers_of_several_clients_that_crossed_say_nothing_of_order(api, received_s, refuted):
    request = Request("GET", _BASE + "/robot/pose/", (("Host", "robot:7003"), ("Accept", "*/*")))
    json_type = (("Content-Type", "application/json"),)
    for second, at in ((2, 100.0), (1, received_s)):
        answer = Response(200, json_type, json.dumps(odometry(second)).encode(), 5.0, received_s=at)
        for listener in api.client.connection.listeners:
            listener.on_response(Exchange(request, answer))
    assert set(api.run.judge.failure_counts()) == refuted


@pytest.fixture
def api() -> RestInterface:
    return opened(Statement(declared=DeclaredLimits(linear_m_s=0.5, angular_rad_s=2.0)))


def see(api, path, value, *, status=200, headers=(("Accept", "*/*"),), method="GET", after="", query=""):
    body = value if isinstance(value, bytes) else json.dumps(value).encode()
    request = Request(method, _BASE + path, (("Host", "robot:7003"), *headers), query=query)
    said = (("Content-Type", "application/json"), *((("Retry-After", after),) if after else ()))
    exchange = Exchange(request, Response(status, said, body, 0.0, received_s=time.monotonic()))
    for listener in api.client.connection.listeners:
        listener.on_response(exchange)


def found(api: RestInterface) -> set[str]:
    return set(api.run.judge.failure_counts())


def test_good_readings_are_cases(api):
    for second in (1, 1, 2):
        see(api, "/robot/pose/", odometry(second))
    see(api, "/robot/velocity/", STILL | {"unit": "m/s"})
    see(api, "/robot/velocity/linear/", ZERO)
    assert not found(api)
    assert api.run.judge.evidence["rest-resources/pose-type"].cases == 3
    assert api.run.judge.evidence["rest-resources/linear-type"].cases == 1


@pytest.mark.parametrize(
    ("path", "value", "requirement"),
    [
        ("/robot/pose/", {}, "rest-resources/pose-type"),
        ("/robot/pose/", b"<Odometry/>", "rest-resources/pose-type"),
        ("/robot/pose/", odometry(6, w=1.01), "rest-resources/pose-quaternion"),
        ("/robot/pose/", odometry(6, w=0), "rest-resources/pose-quaternion"),
        ("/robot/pose/", odometry(0), "rest-resources/pose-stamp"),
        ("/robot/velocity/", {"linear": ZERO}, "rest-resources/velocity-type"),
        ("/robot/velocity/linear/", [0, 0, 0], "rest-resources/linear-type"),
    ],
)
def test_one_bad_reading_among_good_ones_is_found(api, path, value, requirement):
    see(api, "/robot/pose/", odometry(5))
    see(api, path, value)
    assert found(api) == {requirement}


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("/robot/velocity/", STILL | {"linear": ZERO | {"x": 0.6}}),
        ("/robot/velocity/", STILL | {"angular": ZERO | {"z": -2.2}}),
        ("/robot/velocity/linear/", ZERO | {"y": 1.0}),
    ],
)
def test_a_robot_is_too_fast_by_several_samples_never_by_one(api, path, value):
    for second in range(1, 4):
        assert not found(api)
        see(api, "/robot/pose/", odometry(second))
        see(api, path, value)
        see(api, path, value)
    assert found(api) == {"safety/limits-hold"}


def test_an_error_is_no_reading(api):
    see(api, "/robot/velocity/", {}, status=500)
    assert found(api) == {"rest-resources/velocity-type"}


def test_before_the_first_odometry_retry_after_is_asked_for(api):
    see(api, "/robot/pose/", {}, status=503)
    assert found(api) == {"rest-resources/pose-unavailable"}


def test_an_odometry_that_was_never_missed_says_nothing_of_one_that_is(api):
    see(api, "/robot/pose/", odometry(1))
    assert not api.run.judge.evidence["rest-resources/pose-unavailable"].cases
    assert not api.run.judge.evidence["rest-resources/pose-fresh"].cases


def test_an_odometry_that_was_seen_long_ago_is_old(api, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    for seconds, old in ((0.0, False), (1.2, False), (0.2, False), (0.2, True)):
        now[0] += seconds
        see(api, "/robot/pose/", odometry(1))
        assert bool(found(api)) is old
    assert found(api) == {"rest-resources/pose-fresh"}


@pytest.mark.parametrize(("status", "found_"), [(200, {"rest-resources/pose-fresh"}), (503, set())])
def test_without_odometry_there_is_no_velocity(api, status, found_):
    see(api, "/robot/pose/", {}, status=503, after="1")
    see(api, "/robot/velocity/", STILL, status=status, after="1")
    see(api, "/robot/pose/", {}, status=503, after="1")
    assert found(api) == found_


@pytest.mark.parametrize(
    "odd",
    [{"headers": ((name, value),)} for name, value in (("Accept", "application/xml"), ("X-Odd", "1"))]
    + [{"method": "HEAD"}, {"status": 429}],
)
def test_odd_requests_are_left_to_others(api, odd):
    see(api, "/robot/pose/", b"", **odd)
    assert not found(api)


@pytest.mark.parametrize(
    ("kind", "name"),
    [(Kind.BEARER, ""), (Kind.BASIC, ""), (Kind.HEADER, "X-Api-Key"), (Kind.COOKIE, "session"), (Kind.QUERY, "key")],
)
def test_only_what_has_the_credentials_is_judged(api, kind, name):
    credentials = Credentials((Credential(kind, "a:secret", name),))
    api.client.connection = replace(api.client.connection, credentials=credentials)
    watch(api)
    see(api, "/robot/pose/", b"", status=401)
    for sent in (credentials.wrong, credentials):
        assert not found(api)
        fields = (("Accept", "*/*"), *sent.fields(shown=True))
        see(api, "/robot/pose/", b"", status=401, headers=fields, query=sent.target("", shown=True))
    assert found(api) == {"rest-resources/pose-type"}


def test_undeclared_limits_are_not_known():
    api = opened(Statement())
    see(api, "/robot/velocity/", STILL | {"linear": ZERO | {"x": 3.0}})
    assert not found(api)


def test_a_limit_declared_as_high_as_one_that_nobody_declared_is_judged():
    undeclared = Statement().limits
    api = opened(Statement(declared=DeclaredLimits(linear_m_s=undeclared.linear_m_s)))
    fast = {"linear": ZERO | {"x": 2 * undeclared.linear_m_s}, "angular": ZERO | {"z": 9.0}}
    for second in range(1, 4):
        see(api, "/robot/pose/", odometry(second))
        see(api, "/robot/velocity/", fast)
    assert found(api) == {"safety/limits-hold"}


_LIDAR = {"name": "lidar", "topic": "/scan", "type": "sensor_msgs/LaserScan"}
_CAMERA = {"name": "camera", "topic": "/image", "type": "sensor_msgs/Image"}


def over_rest(*entries):
    return SENSORS, "application/json", json.dumps(entries).encode()


def over_soap(*entries):
    items = "".join(
        f"<return>{''.join(f'<{name}>{value}</{name}>' for name, value in entry.items())}</return>" for entry in entries
    )
    body = f'<w:GetSensorsResponse xmlns:w="{NAMESPACE}">{items}</w:GetSensorsResponse>'
    envelope = f'<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>{body}</s:Body></s:Envelope>'
    return "/ws", "text/xml", envelope.encode()


_BOTH, _ONE = (_LIDAR, _CAMERA), (_LIDAR,)


@pytest.mark.parametrize(
    ("read", "wrong"),
    [
        ([over_rest(*_BOTH), over_soap(*_BOTH), over_rest(*_BOTH)], 0),
        ([over_rest(*_BOTH), over_soap(_CAMERA, _LIDAR), over_rest(*_BOTH)], 0),
        ([over_rest(*_BOTH), over_soap(*_ONE), over_rest(*_BOTH)], 1),
        ([over_rest(*_ONE), over_soap(_LIDAR, _LIDAR), over_rest(*_ONE)], 1),
        ([over_rest(*_BOTH), over_soap(*_ONE), over_rest(*_ONE)], 0),  # a sensor has gone
        ([over_soap(*_ONE), over_rest(*_BOTH)], 0),  # and one has come
        ([over_rest(*_BOTH), over_soap({**_LIDAR, "topic": "/scam"}, _CAMERA), over_rest(*_BOTH)], 1),
    ],
)
def test_a_list_that_differs_while_rest_s_does_not_change(read, wrong):
    found, checker = [], Lists(lambda path: f"http://r2{path}")
    for number, (path, media_type, body) in enumerate(read):
        method = "GET" if media_type == "application/json" else "POST"
        response = Response(200, (("Content-Type", media_type),), body, 1.0, received_s=number + 1.0)
        found += checker(Exchange(Request(method, f"http://r2{path}"), response))
    differ = [one for one in found if not one.holds and one.requirement.startswith("equivalence/")]
    assert len(differ) == wrong
