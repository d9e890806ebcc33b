"""Goals of other clients in the form of a MoveBaseActionGoal, from the robot's report or from the action's status."""

import json
from typing import Any, Final

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped

from reference_robot.goal_statuses import ReportedGoal
from reference_robot.webservices.representation.messages import message_from, reader_of
from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.representation.shapes import shape_of

STATUS_TEXTS: Final = {
    GoalStatus.STATUS_ACCEPTED: "accepted",
    GoalStatus.STATUS_EXECUTING: "executing",
    GoalStatus.STATUS_CANCELING: "canceling",
}
ENDED_TEXTS: Final = {
    GoalStatus.STATUS_SUCCEEDED: "succeeded",
    GoalStatus.STATUS_CANCELED: "canceled",
    GoalStatus.STATUS_ABORTED: "aborted",
}
_ORIGIN: Final = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}


def goal_from_report(report: str) -> dict[str, Any] | None:
    """Return the goal in a report of the robot (``current_goal`` in ``names.toml``); None for an invalid report."""
    try:
        fields = json.loads(report)
        code, pose = int(fields["status"]), fields["pose"]
        header = {"stamp": pose["header"]["stamp"], "frame_id": pose["header"]["frame_id"]}
        return {
            "header": header,
            "goal_id": {"stamp": header["stamp"], "id": str(fields["goal_id"])},
            "goal": {"target_pose": reader_of(PoseStamped)(message_from(shape_of(PoseStamped), pose))},
            "status": status_of(code),
        }
    except (ValueError, TypeError, KeyError, AssertionError, Problem):
        return None


def ended_goal(goal: ReportedGoal) -> dict[str, Any]:
    """Return id and status of a goal of another client that has ended."""
    stamp = {"sec": goal.seconds, "nanosec": goal.nanoseconds}
    return {"goal_id": {"stamp": stamp, "id": goal.identity}, "status": status_of(goal.status)}


def status_of(code: int) -> dict[str, Any]:
    """Return the status {code, text} of a goal."""
    return {"code": code, "text": (STATUS_TEXTS | ENDED_TEXTS)[code]}


def goal_from_status(goal: ReportedGoal) -> dict[str, Any]:
    """Return an active goal whose target pose is unknown, because only the action's status reports the goal.

    The representation requires a pose. It is the origin in an empty ``frame_id``, so that no client takes it for a real
    place, and the status text says that the target is not known.
    """
    header = {"stamp": {"sec": goal.seconds, "nanosec": goal.nanoseconds}, "frame_id": ""}
    return {
        "header": header,
        "goal_id": {"stamp": header["stamp"], "id": goal.identity},
        "goal": {"target_pose": {"header": header, "pose": _ORIGIN}},
        "status": {
            "code": goal.status,
            "text": f"{STATUS_TEXTS[goal.status]}; another client sent it, and its target is unknown",
        },
    }
