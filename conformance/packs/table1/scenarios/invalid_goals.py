"""Invalid goals, sent while the robot has no goal and while it has one."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from typing import Any

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.observe.polling import poll_for
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import arrived, await_goal, await_none, difference, goal_body, put_goal
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.invalid_bodies import elsewhere, invalid_bodies, put_body
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import GOAL_PATH, Robot
from conformance.packs.table1.scenarios.plans import is_refused
from conformance.scenarios.scenario import PartialTraceError, scenario
from conformance.scenarios.stage import Need
from conformance.transport.exchange import Exchange

# What is wrong with a goal, media type, body.
_Body = tuple[str, str, bytes]


@dataclass(frozen=True)
class InvalidGoal:
    """The PUT of an invalid goal.

    Attributes:
        what: what is wrong with the goal.
        during: whether another goal was active.
        exchange: the PUT's request and response.
        differs: how the goal that the robot then shows differs from the one before; empty if nowhere.
    """

    what: str
    during: bool
    exchange: Exchange
    differs: str


@scenario(needs={Need.REST, Need.MOTION})
def invalid_goals(api: RestInterface, robot: Robot) -> tuple[InvalidGoal, ...]:
    """Send invalid goals without a goal and during one, and read the goal after each."""
    frame = robot.statement.motion.frame
    near, other = choose_goals(robot, 1.5, 2)
    number = "goal.target_pose.pose.position.x"
    bodies = invalid_bodies(api, GOAL_PATH, goal_body(near, frame, "not to be followed"), number)
    bodies += [(what, JSON, body_of(body)) for what, body in _invalid_goals(near, frame)]
    bodies = api.run.effort.alternatives(bodies, 8)
    sent: list[InvalidGoal] = []
    try:
        _send_without(robot, bodies, sent)
        _send_elsewhere(robot, body_of(goal_body(near, frame, "not to be followed either")), sent)
        _send_during(robot, bodies, other, sent)
    except Exception as error:
        raise PartialTraceError(tuple(sent)) from error
    return tuple(sent)


def _send_without(robot: Robot, bodies: list[_Body], sent: list[InvalidGoal]) -> None:
    for what, media_type, body in bodies:
        exchange = put_body(robot, GOAL_PATH, media_type, body)
        differs = "" if robot.goal()[0] is None else "this goal as the active one"
        sent.append(InvalidGoal(what, during=False, exchange=exchange, differs=differs))
        if differs:
            robot.delete_goal()
            await_none(robot)


def _send_elsewhere(robot: Robot, body: bytes, sent: list[InvalidGoal]) -> None:
    """Send a valid goal by a method or to a path that the robot must refuse."""
    for method, path in elsewhere(robot, GOAL_PATH):
        exchange = robot.rest.send(method, path, headers=(("Content-Type", JSON),), body=body, fresh=True)
        there = robot.goal()[0] is not None
        if is_refused(exchange):  # else it is a vendor's own, or a redirect
            differs = "this goal as the active one" if there else ""
            sent.append(InvalidGoal(f"{method} {path}", during=False, exchange=exchange, differs=differs))
        if there:
            robot.delete_goal()
            await_none(robot)


def _send_during(robot: Robot, bodies: list[_Body], pose: Pose, sent: list[InvalidGoal]) -> None:
    """Send each body while a valid goal is active, until the goal changes or ends by itself; cancel it."""
    active = goal_body(pose, robot.statement.motion.frame, "to be followed")
    put_goal(robot, active)
    if await_goal(robot, active)[1]:
        return  # that a valid goal is followed is for others to judge
    for what, media_type, body in bodies:
        exchange = put_body(robot, GOAL_PATH, media_type, body)
        goal, _ = robot.goal()
        if goal is None and (
            arrived(robot, pose) or not _ends(robot, active, partial(put_body, robot, GOAL_PATH, media_type, body))
        ):
            break  # it has arrived, or the robot gave it up by itself
        differs = "none" if goal is None else difference(goal, active)
        sent.append(InvalidGoal(what, during=True, exchange=exchange, differs=differs))
        if differs:
            break
    _refused_cancel(robot, active, pose, sent)
    robot.delete_goal()
    await_none(robot)


def _refused_cancel(robot: Robot, active: dict[str, Any], pose: Pose, sent: list[InvalidGoal]) -> None:
    """Cancel the goal with an Accept header that excludes all formats: a robot that refuses that keeps the goal."""
    if robot.goal()[0] is None:
        return
    cancel = partial(robot.delete_goal, ("Accept", "image/png"))
    exchange = cancel()
    if exchange.response.status == HTTPStatus.NOT_ACCEPTABLE:
        goal, _ = robot.goal()
        if goal is None and (arrived(robot, pose) or not _ends(robot, active, cancel)):
            return  # as for an invalid goal
        differs = "none" if goal is None else difference(goal, active)
        sent.append(InvalidGoal("Accept: image/png", during=True, exchange=exchange, differs=differs))


def _ends(robot: Robot, active: dict[str, Any], act: Callable[[], object]) -> bool:
    """Return whether an action ends the goal, by comparing with a goal of the same kind without the action."""
    put_goal(robot, active)
    began = robot.clock.now()
    act()
    ended = robot.goal()[0] is None
    took = robot.clock.now() - began
    put_goal(robot, active)
    return ended and all(robot.goal()[0] is not None for _ in poll_for(robot.clock, 0.0, 2 * took))


def _invalid_goals(near: Pose, frame: str) -> list[tuple[str, dict[str, Any]]]:
    return [
        ("an empty id", goal_body(near, frame, "")),
        ("an id of 256 characters", goal_body(near, frame, "a" * 256)),
        ("a number as id", {**goal_body(near, frame), "goal_id": {"id": 5}}),
        ("an unknown frame", goal_body(near, "no_such_frame", "unknown frame")),
        ("a quaternion of length 2", goal_body(near, frame, "long", length=2.0)),
        ("a quaternion of length 0", goal_body(near, frame, "none", length=0.0)),
    ]
