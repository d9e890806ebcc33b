"""Whether what is answered as done has its effect: robots that apply it, late or for a short while, and that do not."""

import json
import math
import time
from functools import partial

import pytest
from toy_body import interface_of
from toy_messages import header, odometry

from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import GOAL_PATH, STILL, VELOCITY, Robot, Velocity
from conformance.packs.table1.scenarios.not_acceptable import goal_has_effect, velocity_has_effect

_SETTLE_S, _HOLD_S = 0.2, 0.25
_WANTED = Velocity(linear_x=0.3)


class Body:
    """A robot that applies what it takes some time after; what it is sent as text, it answers and may forget.

    Args:
        forgets: whether it does; refuses: with what status it answers such a PUT instead.
        stands: whether it cannot be moved.
        takes_s: how long it takes to move; slow_s: for how long it thinks before it does anything.
        goal_ends_s: how long it has a goal, after which its heading is another one by yaw_after_goal.
    """

    forgets, refuses, stands, takes_s, slow_s = False, 0, False, 0.05, 0.0
    goal_ends_s, yaw_after_goal = math.inf, 0.0

    def __init__(self, **given: float) -> None:
        vars(self).update(given)
        self.told = STILL.twist
        self.moves_from = self.until = -math.inf
        self.goal: dict | None = None
        self.goal_until = math.inf
        self.yaw = 0.0

    def answer(self, method: str, path: str, sent: bytes) -> tuple[int, object]:
        time.sleep(self.slow_s)
        now = time.monotonic()
        if now > self.goal_until:
            self.goal, self.goal_until, self.yaw = None, math.inf, self.yaw + self.yaw_after_goal
        if method == "DELETE":
            self.goal, self.goal_until = None, math.inf
            return 204, None
        if method == "PUT":
            return self._put(path, sent, now)
        return self._get(path, now)

    def _put(self, path: str, sent: bytes, now: float) -> tuple[int, object]:
        value = json.loads(sent)
        if value.pop("odd", False):
            if self.refuses:
                return self.refuses, None
            if self.forgets:
                return 204, None
        if path == GOAL_PATH:
            value["goal_id"]["stamp"] = value["goal"]["target_pose"]["header"]["stamp"] = header()["stamp"]
            self.goal = {**value, "header": header(), "status": {"code": 2, "text": ""}}
            self.goal_until = now + self.goal_ends_s
            return 202, None
        if value != self.told or now > self.until:
            self.told, self.moves_from = value, now + self.takes_s
        self.until = now + _HOLD_S
        return 204, None

    def _get(self, path: str, now: float) -> tuple[int, object]:
        twist = self.told if self.moves_from <= now <= self.until and not self.stands else STILL.twist
        if path == VELOCITY:
            return 200, twist
        if path == GOAL_PATH:
            return (404, None) if self.goal is None else (200, self.goal)
        return 200, odometry(now, twist, z=math.sin(self.yaw / 2), w=math.cos(self.yaw / 2))


def _serving(body: Body):
    return interface_of(body, linear_m_s=0.7, angular_rad_s=2.5, settle_s=_SETTLE_S, hold_s=_HOLD_S, odometry_hz=50)


def _odd(robot: Robot, path: str, value: dict):
    fields = (("Content-Type", "application/json"), ("Accept", "image/png"))
    return robot.rest.send("PUT", path, headers=fields, body=body_of({**value, "odd": True}))


def _velocity(body: Body) -> bool | None:
    with _serving(body) as api:
        robot = Robot(api)
        odd = partial(_odd, robot, VELOCITY, _WANTED.twist)
        return velocity_has_effect(api, _WANTED, odd, lambda: robot.put_velocity(_WANTED))


def _goal(body: Body) -> bool | None:
    with _serving(body) as api:
        robot = Robot(api)
        return goal_has_effect(api, partial(_odd, robot, GOAL_PATH), partial(robot.put, GOAL_PATH))


@pytest.mark.parametrize("act", [_velocity, _goal])
def test_what_is_forgotten_has_no_effect(act):
    assert act(Body(forgets=True)) is False


@pytest.mark.parametrize("act", [_velocity, _goal])
def test_what_is_applied_has_one(act):
    assert act(Body()) is True


@pytest.mark.parametrize("act", [_velocity, _goal])
@pytest.mark.parametrize("status", [406, 409])
def test_what_is_refused_need_not_have_one(act, status):
    assert act(Body(refuses=status)) is None


def test_a_robot_that_takes_all_of_its_settle_time_is_waited_for():
    assert _velocity(Body(takes_s=_SETTLE_S)) is True


def test_a_robot_that_answers_late_is_not_taken_for_one_at_rest():
    assert _velocity(Body(slow_s=0.1)) is True
    # It has stopped whenever somebody looks: nothing is known, forgotten or not.
    assert _velocity(Body(slow_s=0.3)) is not False


def test_a_robot_that_does_not_move_at_all_is_for_others_to_judge():
    assert _velocity(Body(forgets=True, stands=True)) is None


def test_a_velocity_that_is_rest_within_the_tolerance_tells_nothing():
    with _serving(Body(forgets=True)) as api:
        slow = Velocity(linear_x=0.03)
        robot = Robot(api)
        put = partial(robot.put_velocity, slow)
        assert velocity_has_effect(api, slow, put, put) is None


def test_a_goal_that_is_over_at_once_tells_nothing():
    assert _goal(Body(goal_ends_s=0.0)) is None


def test_a_goal_that_was_followed_before_anybody_looked_has_had_its_effect():
    assert _goal(Body(goal_ends_s=0.0, yaw_after_goal=2.5)) is True
