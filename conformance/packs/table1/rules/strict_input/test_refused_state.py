"""Rejected requests must change nothing: neither the velocity nor the goal."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

import pytest

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.observe.polling import poll_for
from conformance.packs.table1.robot.goal import arrived, await_goal, await_none, difference, goal_body, put_goal
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.invalid_bodies import invalid_bodies, put_body
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import GOAL_PATH, Robot
from conformance.packs.table1.robot.standstill_trace import Rest, Standing, stays
from conformance.packs.table1.scenarios.invalid_velocities import invalid_velocities
from conformance.packs.table1.scenarios.standing import standing
from conformance.scenarios.rule import Outcome, rule
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.needs("rest"), pytest.mark.motion]
_VELOCITY: Final = "strict-input/velocity-refused"


@rule(_VELOCITY, on=(invalid_velocities,))
def velocity_refused(trace: tuple[Rest, ...]) -> Iterator[Outcome]:
    """Judge that the robot is at rest after each invalid velocity."""
    return (rest.case for rest in trace)


@rule(_VELOCITY, on=(standing,))
def velocity_refused_later(trace: tuple[Standing, ...]) -> Iterator[Outcome]:
    """Judge that the robot stays at rest after all invalid velocities."""
    return stays(trace, _VELOCITY)


@pytest.mark.phase("motion")
@pytest.mark.requirement("strict-input/goal-refused")
def test_an_invalid_goal_is_not_followed(api: RestInterface, robot: Robot, judge: Judge, effort: Effort) -> None:
    """Send invalid goals without a goal and during one: the robot must not follow them."""
    frame = robot.statement.motion.frame
    near, other = choose_goals(robot, 1.5, 2)
    number = "goal.target_pose.pose.position.x"
    bodies = invalid_bodies(api, GOAL_PATH, goal_body(near, frame, "not to be followed"), number)
    bodies += [(what, JSON, body_of(body)) for what, body in _invalid_goals(near, frame)]
    bodies = effort.subsample(bodies, 8)
    for what, media_type, body in bodies:
        exchange = put_body(robot, GOAL_PATH, media_type, body)
        goal, _ = robot.goal()
        if not judge.check(
            "strict-input/goal-refused",
            goal is None,
            exchange,
            f"no goal after PUT of one with {what}",
            found="this goal as the active one",
            cause=what,
        ):
            robot.delete_goal()
            await_none(robot)
    active = goal_body(other, frame, "to be followed")
    put_goal(robot, active)
    if await_goal(robot, active)[1]:
        return  # that a valid goal is followed is for others to judge
    for what, media_type, body in bodies:
        exchange = put_body(robot, GOAL_PATH, media_type, body)
        goal, _ = robot.goal()
        if goal is None and (
            arrived(robot, other) or not _ends(robot, active, partial(put_body, robot, GOAL_PATH, media_type, body))
        ):
            break  # it has arrived, or the robot gave it up by itself
        problem = "none" if goal is None else difference(goal, active)
        judge.check(
            "strict-input/goal-refused",
            not problem,
            exchange,
            f"the goal that was active before PUT of one with {what}",
            found=problem,
            cause=what,
        )
        if problem:
            break
    robot.delete_goal()
    await_none(robot)


def _ends(robot: Robot, active: dict[str, Any], act: Callable[[], object]) -> bool:
    """Return whether an action ends the goal, by comparing with a goal of the same kind without the action."""
    put_goal(robot, active)
    began = robot.clock.now()
    act()
    ended = robot.goal()[0] is None
    took = robot.clock.now() - began
    put_goal(robot, active)
    return ended and all(robot.goal()[0] is not None for _ in poll_for(robot.clock, 0.0, 2 * took))


def _invalid_goals(near: Any, frame: str) -> list[tuple[str, dict[str, Any]]]:
    return [
        ("an empty id", goal_body(near, frame, "")),
        ("an id of 256 characters", goal_body(near, frame, "a" * 256)),
        ("a number as id", {**goal_body(near, frame), "goal_id": {"id": 5}}),
        ("an unknown frame", goal_body(near, "no_such_frame", "unknown frame")),
        ("a quaternion of length 2", goal_body(near, frame, "long", length=2.0)),
        ("a quaternion of length 0", goal_body(near, frame, "none", length=0.0)),
    ]
