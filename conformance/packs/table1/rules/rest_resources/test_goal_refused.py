"""Goals that a robot cannot take."""

from typing import Final

import pytest

from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import NEW, await_none, goal_body, put_goal
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.robot import Robot
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]
# A robot may look for a way before it gives up, s.
_GIVES_UP_S: Final = 10.0
_FAR: Final = (Pose(1e6, 1e6, 0.0), Pose(-1e6, 0.0, 1.0), Pose(1e300, -1e300, 0.0))
_LENGTHS: Final = (0.0, 0.5, 0.99, 0.9975, 1.0025, 1.005, 1.009, 1.01, 2.0, 1e200)
_TAKEN: Final = (0.9991, 1.0009)
_FRAMES: Final = ("no_such_frame", "map2")


@pytest.mark.requirement(
    "rest-resources/goal-unreachable",
    "rest-resources/goal-frame",
    "rest-resources/goal-quaternion",
    "rest-resources/goal-quaternion-taken",
)
def test_goals_that_cannot_be_taken(robot: Robot, judge: Judge) -> None:
    """Outside the map, in an unknown frame, with an orientation that is none."""
    frame = robot.statement.motion.frame
    (near,) = choose_goals(robot, 1.0, 1)
    for length in _LENGTHS:
        _refused(robot, judge, "goal-quaternion", goal_body(near, frame, length=length), f"a quaternion of {length:g}")
    for length in _TAKEN:
        exchange = put_goal(robot, goal_body(near, frame, length=length))
        judge.check(
            "rest-resources/goal-quaternion-taken",
            exchange.response.status in NEW,
            exchange,
            f"201 or 202 for a goal with a quaternion of {length:g}",
            cause=exchange.came,
        )
    robot.delete_goal()
    await_none(robot)
    for unknown in _FRAMES:
        if unknown != frame:
            _refused(robot, judge, "goal-frame", goal_body(near, unknown), f"the frame {unknown!r}")
    for pose in _FAR:
        exchange = put_goal(robot, goal_body(pose, frame))
        status = exchange.response.status
        none = exchange
        if status in {200, 201, 202, 204}:
            none = await_none(robot, _GIVES_UP_S)
        ended = none.response.status == 404
        judge.check(
            "rest-resources/goal-unreachable",
            400 <= status < 500 or ended,
            exchange,
            "422 (another 4xx conforms), or a goal that is accepted and ends",
            found=exchange.came if ended or none is exchange else f"the goal is current {_GIVES_UP_S:g} s later",
        )
        if none is not exchange and not ended:
            robot.delete_goal()
            return


def _refused(robot: Robot, judge: Judge, name: str, body: dict[str, object], what: str) -> None:
    exchange = put_goal(robot, body)
    status = exchange.response.status
    judge.check(
        f"rest-resources/{name}", 400 <= status < 500, exchange, f"4xx for a goal with {what}", cause=exchange.came
    )
    if status < 400:
        robot.delete_goal()
