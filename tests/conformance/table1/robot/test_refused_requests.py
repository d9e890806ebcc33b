"""Which refused requests of a run are sent again, and what a robot may do with them."""

import itertools
import json

import pytest
from driven_device import SimulatedClock
from toy_body import interface_of

from conformance.api.soap.callable_services import SoapServices
from conformance.packs.table1.robot.refused_requests import RefusedRequests, is_refused, no_commands
from conformance.packs.table1.robot.robot import GOAL_PATH, JSON_BODY, VELOCITY, Robot
from conformance.packs.table1.rules.strict_input import test_refused_state as rules
from conformance.packs.table1.scenarios.refused_again import RefusedAgain, refused_again
from conformance.packs.table1.scenarios.walks import Walk
from conformance.transport.exchange import SAFE_METHODS, Exchange, Request, Response
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Case

_FAULT = (
    b'<e:Envelope xmlns:e="http://schemas.xmlsoap.org/soap/envelope/"><e:Body><e:Fault>'
    b"<faultcode>e:%s</faultcode><faultstring>no</faultstring></e:Fault></e:Body></e:Envelope>"
)


class _Silent:
    def answer(self, _method: str, _path: str, _sent: bytes) -> tuple[int, object]:
        return 404, None


@pytest.fixture
def api():
    with interface_of(_Silent()) as api:
        yield api


def _came(api, method, path, status, body=b"", fields=(), detail="no", media_type="application/problem+json"):
    fields = (("Host", api.client.authority), *fields)
    content = detail if isinstance(detail, bytes) else json.dumps({"status": status, "detail": detail}).encode()
    response = Response(status, (("Content-Type", media_type),), content, 1.0)
    return Exchange(Request(method, api.client.url(path), fields, body), response)


def _chosen(api, *exchanges, effort="standard"):
    refused = RefusedRequests(api)
    for one in exchanges:
        refused.on_response(one)
    return refused, refused.choose((), Effort(effort))


@pytest.mark.parametrize("status", [400, 404, 405, 406, 415, 422])
def test_what_is_wrong_in_any_state_is_kept(api, status):
    _, (one,) = _chosen(api, _came(api, "PUT", VELOCITY, status, b"{}", JSON_BODY))
    assert (one.request.body, one.path, one.acts) == (b"{}", VELOCITY, True)


@pytest.mark.parametrize(
    ("method", "path", "status", "fields", "body"),
    [
        ("PUT", VELOCITY, 409, (), b"{}"),
        ("PUT", VELOCITY, 401, (), b"{}"),
        ("PUT", VELOCITY, 413, (), b"{}"),
        ("PUT", VELOCITY, 429, (), b"{}"),
        ("PUT", VELOCITY, 503, (), b"{}"),
        ("PUT", VELOCITY, 200, (), b"{}"),
        ("GET", GOAL_PATH, 404, (), b""),
        ("DELETE", GOAL_PATH, 404, (), b""),
        ("PUT", VELOCITY, 400, (("Transfer-Encoding", "chunked"),), b"{}"),
        ("PUT", VELOCITY, 400, (("Accept", "a/b"), ("Accept", "c/d")), b"{}"),
        ("PUT", VELOCITY, 400, (("Content-Length", "7"),), b"{}"),
        ("PUT", VELOCITY, 400, (), b"<!DOCTYPE a>"),
        ("PUT", VELOCITY, 400, (), b" " * 10_000),
        ("GET", "/" + "a" * 2_000, 404, (), b""),
    ],
)
def test_what_depends_on_the_state_or_attacks_is_not_kept(api, method, path, status, fields, body):
    assert _chosen(api, _came(api, method, path, status, body, fields))[1] == []


@pytest.mark.parametrize(
    ("code", "kept"), [("Client", True), ("MustUnderstand", True), ("VersionMismatch", True), ("Server", False)]
)
def test_a_soap_fault_is_a_refusal_by_its_code(api, code, kept):
    assert is_refused(_came(api, "POST", "/s", 500, b"", (), _FAULT % code.encode(), "text/xml")) is kept


def test_kinds_of_faults_are_told_apart_by_what_is_said_without_its_values(api):
    bodies = [_came(api, "PUT", GOAL_PATH, 422, b"%d" % n, JSON_BODY, f"x: {n} is {n!r}") for n in range(9)]
    assert len(_chosen(api, *bodies)[1]) == 2
    other = _came(api, "PUT", GOAL_PATH, 422, b"other", JSON_BODY, "frame_id: 'a' is unknown")
    assert len(_chosen(api, *bodies, other)[1]) == 3


def test_there_are_few_of_them_and_those_that_move_come_first(api):
    many = [_came(api, "GET", f"/a{chr(97 + n)}{chr(97 + m)}", 404) for n, m in itertools.product(range(26), repeat=2)]
    moves = _came(api, "PUT", VELOCITY, 422, b"{}", JSON_BODY)
    _, chosen = _chosen(api, *many, moves, effort="quick")
    assert len(chosen) == 60
    assert chosen[0].path == VELOCITY


def test_one_that_the_robot_takes_later_is_not_sent_again(api):
    exchange = _came(api, "PUT", VELOCITY, 422, b"{}", JSON_BODY)
    refused, (one,) = _chosen(api, exchange)
    refused.drop(one)
    refused.on_response(exchange)
    assert refused.choose((), Effort()) == []


class _Body:
    """A robot that drives to its goal a little with each reading, and what is wrong with it, by a name."""

    def __init__(self, fault: str = "", style: int = 422) -> None:
        self.fault, self.style = fault, style
        self.goal: dict | None = None
        self.x = self.speed = 0.0
        self.refused = 0
        self.last: dict | None = None

    def _refuse(self, sent: bytes) -> tuple[int, object]:
        self.refused += 1
        if self.fault == "ends" or (self.fault == "ends by frame" and b"no_such_frame" in sent):
            self.goal = None
        if self.fault == "ends the third time" and self.refused % 3 == 0:
            self.goal = None
        if self.fault == "drives" and self.goal is None:
            self.speed = 0.3
        if self.fault == "takes" and self.goal is None and self.refused % 4 == 0:
            self.goal = _shown({"goal": _POSE, "goal_id": {"id": "taken"}})
        return self.style, {"status": self.style, "detail": "no"}

    def answer(self, method: str, path: str, sent: bytes) -> tuple[int, object]:
        if path == GOAL_PATH:
            return self._of_goal(method, sent)
        if method == "PUT":
            value = _json(sent)
            if path != VELOCITY or value is None or value["angular"]["z"] > 1:
                return self._refuse(sent)
            self.speed = value["linear"]["x"]
            return 204, None
        if path.endswith("/pose/"):
            self.x += 0.02 if self.goal else 0.0
        twist = _twist(self.speed)
        shown = {"/pose/": _odometry(self.x, self.speed), "/velocity/": twist, "/linear/": twist["linear"]}
        return next(((200, value) for end, value in shown.items() if path.endswith(end)), (503, None))

    def _of_goal(self, method: str, sent: bytes) -> tuple[int, object]:
        if method in {"GET", "HEAD"}:
            return (404, {"status": 404, "last_goal": self.last}) if self.goal is None else (200, self.goal)
        if method == "DELETE":
            was, self.goal = self.goal, None
            return (404 if was is None else 204), None
        value = _json(sent)
        target = value["goal"]["target_pose"] if value else {"header": {"frame_id": ""}}
        if target["header"]["frame_id"] != "map" or target["pose"]["orientation"]["w"] > 1:
            return self._refuse(sent)
        if self.goal and self.goal["goal_id"]["id"] == value["goal_id"]["id"]:
            same = self.goal["goal"]["target_pose"]["pose"] == value["goal"]["target_pose"]["pose"]
            return (200, None) if same or self.fault == "no conflict" else (409, None)
        if (
            self.fault == "same pose"
            and self.goal
            and self.goal["goal"]["target_pose"]["pose"]["position"]
            == (value["goal"]["target_pose"]["pose"]["position"])
        ):
            return 200, None
        self.goal = _shown(value)
        return 202, self.goal


def _json(sent: bytes):
    try:
        return json.loads(sent)
    except ValueError:
        return None


_STAMP = {"sec": 1, "nanosec": 0}
_POSE = {
    "target_pose": {
        "header": {"stamp": _STAMP, "frame_id": "map"},
        "pose": {"position": dict.fromkeys("xyz", 9.0), "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}},
    }
}


def _shown(value: dict) -> dict:
    target = {**value["goal"]["target_pose"], "header": {"stamp": _STAMP, "frame_id": "map"}}
    return {
        "header": {"stamp": _STAMP, "frame_id": "map"},
        "goal_id": {"stamp": _STAMP, "id": value["goal_id"]["id"]},
        "goal": {"target_pose": target},
        "status": {"code": 2, "text": ""},
    }


def _twist(speed: float) -> dict:
    return {"linear": {"x": speed, "y": 0.0, "z": 0.0}, "angular": dict.fromkeys("xyz", 0.0)}


def _odometry(x: float, speed: float) -> dict:
    pose = {"position": {"x": x, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    return {
        "header": {"stamp": {"sec": int(x * 100) + 1, "nanosec": 0}, "frame_id": "odom"},
        "child_frame_id": "base_link",
        "pose": {"pose": pose, "covariance": [0.0] * 36},
        "twist": {"twist": _twist(speed), "covariance": [0.0] * 36},
    }


def _played(body: _Body) -> RefusedAgain:
    with interface_of(body, linear_m_s=0.7, angular_rad_s=1.0, settle_s=0.1) as api:
        refused = RefusedRequests(api)
        api.client.connection.listeners.append(refused)
        return refused_again.play(api, Robot(api), SoapServices(api.run), None, refused, [])


def _failed(trace: RefusedAgain) -> set[str]:
    own = [one for one in vars(rules).values() if getattr(one, "on", None) == (refused_again,)]
    return {
        one.requirement
        for one in own
        for case in one.outcomes(trace, {}.__getitem__)
        if isinstance(case, Case) and not case.holds
    } - {"rest-resources/goal-outcome"}


@pytest.mark.parametrize("style", [400, 422, 404, 406, 405])
def test_a_good_robot_is_not_blamed_by_whatever_it_refuses(style):
    trace = _played(_Body(style=style))
    assert trace.during
    assert trace.drives
    assert _failed(trace) == set()


@pytest.mark.parametrize(
    ("fault", "requirement"),
    [
        ("ends", "goal-refused"),
        ("ends by frame", "goal-refused"),
        ("ends the third time", "goal-"),
        ("drives", "velocity-refused"),
        ("takes", "velocity-refused"),
        ("no conflict", "goal-conflict"),
        ("same pose", "goal-preempt"),
    ],
)
def test_what_a_refused_request_does_in_another_state_is_found(fault, requirement):
    assert any(requirement in one for one in _failed(_played(_Body(fault))))


def test_a_robot_that_stands_still_as_long_as_requests_are_refused_is_found_the_second_time():
    refused = _came_at("PUT")
    assert _failed(RefusedAgain(stands=(refused,))) == set()
    assert _failed(RefusedAgain(stands=(refused, refused))) == {"rest-resources/goal-drives"}


def _came_at(method: str) -> Exchange:
    return Exchange(Request(method, "http://robot/"), Response(422, (), b"", 1.0))


def test_what_commands_nothing_is_refused_or_only_read():
    body = _Body()
    with interface_of(body, linear_m_s=0.7, angular_rad_s=1.0, settle_s=0.1) as api:
        robot = Robot(api)
        exchanges = [act() for act in no_commands(robot, SoapServices(api.run), "seed")]
    assert (body.goal, body.speed) == (None, 0.0)
    assert all(one.response.status >= 400 or one.request.method in SAFE_METHODS for one in exchanges)


@pytest.mark.parametrize("effort", ["quick", "standard"])
def test_two_of_them_come_before_each_command_of_a_walk(api, effort):
    done = []
    walk = Walk(Robot(api), Effort(effort), 0.1, preludes=[lambda: done.append(1), lambda: done.append(2)])
    walk.prelude()
    assert done == [1, 2]


def test_a_walk_pauses_once(api):
    clock = SimulatedClock()
    walk = Walk(Robot(api, clock), Effort("standard"), 0.1, preludes=[lambda: None])
    began = clock.now()
    for _ in range(40):
        walk.prelude()
    assert clock.now() - began == pytest.approx(1.5)


def test_a_slow_robot_is_sent_no_more_than_the_commands(api):
    walk = Walk(Robot(api), Effort("quick").slowed_to(1000.0), 0.1, preludes=[lambda: pytest.fail("sent")])
    walk.prelude()
