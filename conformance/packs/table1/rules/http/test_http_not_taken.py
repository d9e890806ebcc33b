"""A PUT whose Accept excludes all formats is either rejected with 406 or applied (contract, several clients).

A PUT answered 406 must have no effect, and a PUT answered 2xx must have one (RFC 9110 9.3.4).
"""

from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from typing import Any, Final

import pytest

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, STILL, VELOCITY, Robot, Velocity
from conformance.packs.table1.robot.standstill import Standstill
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.packs.table1.robot.taken import goal_has_effect, turned_goal, velocity_has_effect
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("standstill"), pytest.mark.needs("rest"), pytest.mark.motion]
_ID: Final = "http/not-acceptable-undone"
# What says that a PUT has its effect.
_EFFECT: Final = {
    VELOCITY: "rest-resources/velocity-converges",
    LINEAR: "rest-resources/linear-put",
    GOAL_PATH: "rest-resources/goal-get",
}
# What no robot answers a PUT in.
_NOTHING: Final = "image/png"


@pytest.mark.requirement(_ID, *_EFFECT.values())
def test_what_is_not_acceptable_is_not_done(
    api: RestInterface, robot: Robot, standstill: Standstill, judge: Judge
) -> None:
    """PUT velocities and goals with an Accept that excludes all formats: after 406 the robot must not move."""
    refused, moved = _try_each(api, robot, 0.0)
    if not refused:
        judge.note(_ID, "no PUT of a velocity or a goal is answered 406")
        return

    def again() -> None:
        _try_each(api, robot, robot.limits.settle_s)

    standstill.expect(_ID, "rest, and no goal, after 406", again, seconds=robot.limits.settle_s, goal=True)
    if moved:
        # By this, or by what was tried before: each is tried again by itself.
        standstill.judge()


def _put(robot: Robot, path: str, value: dict[str, Any]) -> Exchange:
    """PUT JSON with an Accept header that excludes every format of the response."""
    fields = (("Content-Type", JSON), ("Accept", _NOTHING))
    return robot.rest.send("PUT", path, headers=fields, body=body_of(value))


def _try_each(api: RestInterface, robot: Robot, watched_s: float) -> tuple[int, bool]:
    """PUT velocities and goals with such an Accept header, and watch the robot for ``watched_s`` after each.

    Returns:
        How many were answered 406, and whether the robot moves. Without a watch, the first motion ends the check, and a
        later repetition finds its cause.
    """
    fast = robot.share_of_limits(0.6, 0.4)
    straight = Velocity(*fast[:3])
    tried: list[tuple[str, dict[str, Any], Callable[[], bool | None]]] = [
        (VELOCITY, fast.twist, lambda: _velocity_has_effect(api, robot, VELOCITY, fast, fast.twist)),
        (LINEAR, fast.linear, lambda: _velocity_has_effect(api, robot, LINEAR, straight, fast.linear)),
    ]
    here = robot.map_pose()
    if here is not None:
        puts = partial(_put, robot, GOAL_PATH), partial(robot.put, GOAL_PATH)
        tried.append((GOAL_PATH, turned_goal(robot, here), lambda: goal_has_effect(api, *puts)))
    refused = 0
    for path, value, has_effect in tried:
        exchange = _put(robot, path, value)
        if exchange.response.ok:
            bring_to_rest(api)
            _judge_done(robot, path, exchange, done=has_effect())
        if exchange.response.status == HTTPStatus.NOT_ACCEPTABLE:
            refused += 1
            if _moves(api, robot, path, exchange, watched_s):
                return refused, True
    return refused, False


def _velocity_has_effect(
    api: RestInterface, robot: Robot, path: str, wanted: Velocity, value: dict[str, Any]
) -> bool | None:
    return velocity_has_effect(api, wanted, partial(_put, robot, path, value), partial(robot.put, path, value))


def _judge_done(robot: Robot, path: str, exchange: Exchange, *, done: bool | None) -> None:
    if done is not None:
        expected = f"the effect of a PUT of {path} that is answered {exchange.response.status}"
        found = "none, where the same PUT with Accept: application/json has it"
        robot.judge.check(_EFFECT[path], done, exchange, expected, found=found)


def _moves(api: RestInterface, robot: Robot, path: str, exchange: Exchange, watched_s: float) -> bool:
    drive = Drive(robot)
    drive.keep(watched_s)
    still, found = drive.sees(STILL, 2)
    if still and robot.goal()[0] is not None:
        still, found = False, "a goal is active"
    moves = still is False
    if not moves or watched_s:
        robot.judge.check(_ID, not moves, exchange, f"no effect of a PUT of {path} that is answered 406", found=found)
    if moves and watched_s:
        bring_to_rest(api)
    return moves
