import json

import pytest
from toy_messages import goal

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.checkers.goals import Goals
from conformance.packs.table1.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import CheckerListener
from conformance.verdict.run import Run

_BASE = "http://robot:7003"
_JSON = (("Content-Type", "application/json"),)


@pytest.fixture
def api() -> RestInterface:
    return RestInterface(Run(statement=Statement()), HttpClient(_BASE, Connection()))


def watching(api: RestInterface) -> CheckerListener:
    return CheckerListener(api.run.judge, [Goals(api.client.url)])


def refuted(api: RestInterface, *rounds: list[dict]) -> set[str]:
    """What is refuted by goals as they are shown, with something put before each of the rounds."""
    observer = watching(api)
    url = f"{_BASE}/robot/navigation/action/goal/"
    for shown in rounds:
        observer.on_response(Exchange(Request("PUT", url, ()), Response(201, (), b"", 1.0)))
        for one in shown:
            answer = Response(200, _JSON, json.dumps(one).encode(), 1.0)
            observer.on_response(Exchange(Request("GET", url, ()), answer))
    return set(api.run.judge.failure_counts())


def test_goals_of_one_piece(api):
    assert not refuted(api, *([goal(str(n), n, n)] * 2 for n in range(6)))


def test_a_goal_that_is_shown_late(api):
    assert not refuted(api, *([goal(str(n - 1), n - 1, n - 1), *[goal(str(n), n, n)] * 2] for n in range(1, 7)))


@pytest.mark.parametrize("what", ["stamp", "pose", "id"])
def test_a_part_of_the_goal_before_is_shown_first(api, what):
    def first(n: int) -> dict:
        return goal(str(n - (what == "id")), n - (what == "stamp"), n - (what == "pose"), n)

    assert refuted(api, *([first(n), *[goal(str(n), n, n)] * 2] for n in range(1, 7))) == {"rest-resources/goal-get"}


def test_once_is_no_rule(api):
    rounds = [[goal(str(n), n, n)] * 2 for n in range(1, 9)]
    for n in (3, 6):
        rounds[n][0] = goal(str(n + 1), n, n + 1)
    assert not refuted(api, *rounds)


def test_a_stamp_that_goes_on_by_itself(api):
    # A header with the time of the answer, in whole seconds: now and then it is that of the goal before.
    rounds = [[goal(str(n), n, n, header) for header in (n, n, n + 1)] for n in range(1, 3)]
    rounds += [[goal(str(n), n, n, header) for header in (n, n + 1)] for n in range(3, 9)]
    assert not refuted(api, *rounds)


@pytest.mark.parametrize(
    ("between", "expected"),
    [
        (goal("1", 1, 1.5), {"rest-resources/goal-get"}),
        (goal("2", 1, 1), {"rest-resources/goal-get"}),
        (goal("1", 1, 1), set()),
        (goal("1", 1, 1) | {"status": {"code": 1, "text": "on its way"}}, set()),
    ],
)
def test_a_goal_that_nobody_changed_is_shown_in_one_way(api, between, expected):
    assert refuted(api, [goal("1", 1, 1), goal("1", 1, 1), between, goal("1", 1, 1)]) == expected


def test_another_goal_may_follow_and_that_before_it_be_put_again(api):
    assert not refuted(api, [goal("1", 1, 1)], [goal("2", 2, 2)], [goal("1", 3, 1)])


@pytest.mark.parametrize(
    ("shown", "wrong"), [(goal("<b>&amp;"), 0), (goal("another"), 1), ({"goal_id": {"id": "another"}}, 1), ({}, 0)]
)
def test_the_response_to_a_put_has_the_goal_of_its_request(api, shown, wrong):
    sent = Request("PUT", f"{_BASE}/robot/navigation/action/goal/", _JSON, json.dumps(goal("<b>&amp;")).encode())
    watching(api).on_response(Exchange(sent, Response(202, _JSON, json.dumps(shown).encode(), 1.0)))
    assert api.run.judge.failure_counts().get("rest-resources/goal-id", 0) == wrong


def turned(x: float, frame: str = "map") -> dict:
    shown = goal("1", x=x)
    # The same orientation, at another length and with the other sign.
    shown["goal"]["target_pose"]["pose"]["orientation"] = {"x": 0.0, "y": 0.0, "z": 0.0, "w": -2.0}
    shown["goal"]["target_pose"]["header"]["frame_id"] = frame
    return shown


@pytest.mark.parametrize(
    ("shown", "wrong"),
    [(turned(0.123456), 0), (turned(0.12), 1), (turned(0.12, "odom"), 0), ({"goal_id": {"id": "1"}}, 0), ([1], 0)],
)
def test_the_response_to_a_put_has_the_pose_of_its_request_in_the_same_frame(api, shown, wrong):
    body = {"goal": goal("1", x=0.123456)["goal"]}
    sent = Request("PUT", f"{_BASE}/robot/navigation/action/goal/", _JSON, json.dumps(body).encode())
    watching(api).on_response(Exchange(sent, Response(202, _JSON, json.dumps(shown).encode(), 1.0)))
    assert api.run.judge.failure_counts().get("rest-resources/goal-put", 0) == wrong
