"""Invalid goals, sent while the robot has no goal; refused_again sends them while it has one."""

from dataclasses import dataclass
from typing import Any, Final

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import await_none, goal_body
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.invalid_bodies import elsewhere, invalid_bodies, put_body
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.robot import GOAL_PATH, Robot
from conformance.packs.table1.scenarios.plans import is_refused
from conformance.scenarios.scenario import partial_trace, scenario
from conformance.scenarios.stage import Need
from conformance.transport.exchange import Exchange

#: A frame that no robot knows.
NO_FRAME: Final = "no_such_frame"
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
    """Send invalid goals without a goal, and read the goal after each."""
    frame = robot.statement.motion.frame
    (near,) = choose_goals(robot, 1.5, 1)
    number = "goal.target_pose.pose.position.x"
    bodies = invalid_bodies(api, GOAL_PATH, goal_body(near, frame, "not to be followed"), number)
    bodies += [(what, JSON, body_of(body)) for what, body in _invalid_goals(near, frame)]
    bodies = api.run.effort.alternatives(bodies, 8)
    sent: list[InvalidGoal] = []
    with partial_trace(lambda: tuple(sent)):
        _send_without(robot, bodies, sent)
        _send_elsewhere(robot, body_of(goal_body(near, frame, "not to be followed either")), sent)
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


def _invalid_goals(near: Pose, frame: str) -> list[tuple[str, dict[str, Any]]]:
    return [
        ("an empty id", goal_body(near, frame, "")),
        ("an id of 256 characters", goal_body(near, frame, "a" * 256)),
        ("a number as id", {**goal_body(near, frame), "goal_id": {"id": 5}}),
        ("an unknown frame", goal_body(near, NO_FRAME, "unknown frame")),
        ("a quaternion of length 2", goal_body(near, frame, "long", length=2.0)),
        ("a quaternion of length 0", goal_body(near, frame, "none", length=0.0)),
    ]
