import json
import re
import time

import pytest
from toy_messages import STILL
from toy_server import serving

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.stopping import bring_to_rest, leave_at_rest
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Listener
from conformance.verdict.run import Run


class Body:
    """A robot with goals of its own waiting, which stops when it has none left and is told to."""

    def __init__(self, goals: int = 0, speed: float = 0.0, *, obeys: bool = True) -> None:
        self.goals, self.speed, self.obeys = goals, speed, obeys
        self.asked: list[str] = []

    def answer(self, method: str, path: str, body: bytes) -> tuple[int, object]:
        self.asked.append(f"{method} {path}")
        if path.endswith("/goal/"):
            if method == "DELETE" and self.goals and self.obeys:
                self.goals -= 1
                return 204, None
            return (200, {"goal": 1}) if self.goals else (404, None)
        if method == "PUT":
            if self.goals:
                return 409, None
            self.speed = json.loads(body)["linear"]["x"] if self.obeys else self.speed
            return 204, None
        return 200, STILL | {"linear": {"x": self.speed, "y": 0.0, "z": 0.0}}


class Heard(Listener):
    """Remembers what it is told."""

    def __init__(self) -> None:
        self.exchanges: list[object] = []

    def on_response(self, exchange) -> None:
        self.exchanges.append(exchange)

    on_no_response = on_response


def api(url: str, *, motion: bool = True, timeout_s: float = 60.0) -> RestInterface:
    return RestInterface(Run(allow_motion=motion), HttpClient(url, Connection(timeout_s=timeout_s)))


@pytest.mark.parametrize(("goals", "speed"), [(0, 0.0), (1, 0.3), (5, 0.3)])
def test_a_robot_is_cancelled_until_it_has_no_goal_and_stands(goals, speed):
    body = Body(goals, speed)
    with serving(body.answer) as url:
        assert bring_to_rest(api(url)) == ""
    assert (body.goals, body.speed) == (0, 0.0)


@pytest.mark.parametrize(
    ("goals", "found"),
    [(1, "its goal is still active.*"), (0, r"it still moves: linear\.x 0\.3")],
    ids=["goal", "speed"],
)
def test_a_robot_that_does_not_cancel_or_does_not_stop_is_not_at_rest(goals, found):
    with serving(Body(goals, 0.3, obeys=False).answer) as url:
        assert re.fullmatch(found, bring_to_rest(api(url)))


def test_a_robot_that_is_not_there_raises_nothing(closed_port):
    started = time.monotonic()
    assert "its velocity cannot be read" in bring_to_rest(api(closed_port))
    leave_at_rest(api(closed_port))
    assert time.monotonic() - started < 60


def test_leaving_a_robot_that_hangs_takes_a_few_seconds(listening):
    made = api(listening(lambda connection: connection.recv(1) and time.sleep(30)), timeout_s=60)
    started = time.monotonic()
    leave_at_rest(made)
    assert time.monotonic() - started < 25


def test_a_robot_that_may_not_be_moved_is_sent_nothing():
    body = Body(1, 0.3)
    with serving(body.answer) as url:
        leave_at_rest(api(url, motion=False))
    assert body.asked == []


def test_leaving_judges_nothing_and_stops_the_robot():
    body = Body(2, 0.3)
    with serving(body.answer) as url:
        made = api(url)
        heard = Heard()
        made.client.connection.listeners.append(heard)
        leave_at_rest(made)
    assert (body.goals, body.speed, heard.exchanges) == (0, 0.0, [])
