"""Build goals, send them, and compare the goal in the robot's response with the sent one."""

import math
from http import HTTPStatus
from typing import Any, Final

from conformance.documents.json_text import clip, read_json
from conformance.observe.clock import poll
from conformance.packs.table1.robot.geometry import Pose, quaternion_of
from conformance.packs.table1.robot.message_shapes import LAST_GOAL, STATUS
from conformance.packs.table1.robot.robot import GOAL_PATH, Robot
from conformance.transport.exchange import Exchange

NEW: Final = frozenset({201, 202})
REPEATED: Final = frozenset({200, 202, 204})
# Statuses for a cancelled goal: the contract has 204, and a response with a body means the same.
CANCELLED: Final = frozenset({200, 202, 204})
# RATHER_XML: an Accept header with a preference, which must not matter for cancelling.
RATHER_XML: Final = ("Accept", "application/xml, */*;q=0.1")
SUCCEEDED: Final = 4
CANCELED: Final = 5
ACTIVE: Final = frozenset({1, 2, 3})
_STEP_S: Final = 0.02
_CLOSE: Final = 1e-6
# Within this distance of its goal, a robot may end the goal while the suite reads, m.
_ARRIVED_M: Final = 0.1


def goal_body(pose: Pose, frame: str, id_: str | None = None, *, length: float = 1.0) -> dict[str, Any]:
    """Return the JSON body of a goal's PUT (move_base_msgs/MoveBaseActionGoal).

    Args:
        pose: the target.
        frame: frame of the pose.
        id_: goal_id.id, or None: the robot chooses one.
        length: length of the quaternion.
    """
    body: dict[str, Any] = {
        "goal": {
            "target_pose": {
                "header": {"frame_id": frame},
                "pose": {
                    "position": {"x": pose.x, "y": pose.y, "z": 0.0},
                    "orientation": quaternion_of(pose.yaw, length),
                },
            }
        }
    }
    if id_ is not None:
        body["goal_id"] = {"id": id_}
    return body


def difference(goal: Any, put: dict[str, Any]) -> str:
    """Return where the robot's goal differs from the sent one; empty if nowhere.

    A quaternion and its negative are the same orientation.
    """
    if "goal_id" in put and goal["goal_id"]["id"] != put["goal_id"]["id"]:
        return f"goal_id.id {clip(goal['goal_id']['id'])} for {clip(put['goal_id']['id'])}"
    active, wanted = goal["goal"]["target_pose"], put["goal"]["target_pose"]
    if active["header"]["frame_id"] != wanted["header"]["frame_id"]:
        return f"frame_id {clip(active['header']['frame_id'])} for {clip(wanted['header']['frame_id'])}"
    for axis, put_at in wanted["pose"]["position"].items():
        found = float(active["pose"]["position"][axis])
        if not math.isclose(found, put_at, rel_tol=1e-9, abs_tol=_CLOSE):
            return f"position.{axis} {found:g} for {put_at:g}"
    turned, wished = active["pose"]["orientation"], wanted["pose"]["orientation"]
    dot = sum(float(turned[axis]) * wished[axis] for axis in "xyzw")
    length = math.hypot(*(float(turned[axis]) for axis in "xyzw")) * math.hypot(*wished.values())
    if not abs(abs(dot) - length) <= _CLOSE or not length > _CLOSE:
        return f"orientation {clip(turned)} for {clip(wished)}"
    return ""


def status_fault(goal: Any) -> str:
    """Return what is wrong with the status of an active goal, or an empty text."""
    problem = STATUS.problem(goal.get("status"), "status")
    if problem:
        return problem
    code = goal["status"]["code"]
    return "" if code in ACTIVE else f"status.code {code:g}"


def outcome_fault(exchange: Exchange, code: int, id_: str | None = None) -> str:
    """Return what is wrong with the last goal in a problem document, or an empty text.

    Args:
        exchange: a GET of the goal that was answered 404.
        code: the status with which the goal ended (action_msgs/GoalStatus).
        id_: the goal's id; None: any.
    """
    problem = read_json(exchange.response.body).value
    last: Any = problem.get("last_goal") if isinstance(problem, dict) else None
    wrong = "no member last_goal" if last is None else LAST_GOAL.problem(last, "last_goal")
    if wrong:
        return wrong
    if id_ not in {None, last["goal_id"]["id"]}:
        return f"last_goal.goal_id.id {clip(last['goal_id']['id'])}"
    return "" if last["status"]["code"] == code else f"last_goal.status.code {last['status']['code']:g}"


def await_goal(robot: Robot, *put: dict[str, Any]) -> tuple[Any, str, Exchange]:
    """GET the active goal until it is one of the sent ones, at most for the settle time.

    Returns:
        The goal (None: the robot shows no goal), where it differs from those PUT, and the last exchange.
    """
    patience = robot.patience(robot.settle_s)
    for _ in poll(robot.clock, _STEP_S, lambda: patience.over):
        goal, exchange = robot.goal()
        problem = exchange.came if goal is None else min((difference(goal, item) for item in put), key=len)
        if not problem:
            break
    return goal, problem, exchange


def await_none(robot: Robot, seconds: float | None = None) -> Exchange:
    """GET the active goal until there is none, for ``seconds`` or the settle time."""
    patience = robot.patience(robot.settle_s if seconds is None else seconds)
    for _ in poll(robot.clock, _STEP_S, lambda: patience.over):
        exchange = robot.get(GOAL_PATH)
        if exchange.response.status == HTTPStatus.NOT_FOUND:
            break
    return exchange


def is_there(robot: Robot, pose: Pose) -> bool:
    """Return whether the robot is so near a goal that the goal may have ended."""
    here = robot.map_pose()
    return here is None or here.distance(pose) < robot.limits.arrival[0] + _ARRIVED_M


def put_goal(robot: Robot, body: dict[str, Any]) -> Exchange:
    """PUT a goal."""
    return robot.put(GOAL_PATH, body)
