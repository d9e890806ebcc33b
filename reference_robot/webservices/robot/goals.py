"""The life of a navigation goal: sent, repeated, displaced, cancelled, ended. At most one goal is current at a time."""

import asyncio
import contextlib
import json
import uuid
from collections import deque
from dataclasses import dataclass
from typing import Any, Final

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Header

from reference_robot.goal_statuses import ReportedGoal
from reference_robot.names import Frames
from reference_robot.webservices.nodes.calls import ManagedNode, RosCalls
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.messages import message_from, reader_of
from reference_robot.webservices.representation.problems import Problem, not_yet
from reference_robot.webservices.representation.shapes import Record, Text, shape_of
from reference_robot.webservices.robot.plans import require_pose

_GOAL_ID: Final = Record("GoalID", (("stamp", shape_of(Time)), ("id", Text(1, 255))), optional=frozenset({"stamp"}))
# move_base_msgs/MoveBaseActionGoal, a ROS 1 type that only the web interface uses.
GOAL: Final = Record(
    "MoveBaseActionGoal",
    (
        ("header", shape_of(Header)),
        ("goal_id", _GOAL_ID),
        ("goal", Record("MoveBaseGoal", (("target_pose", shape_of(PoseStamped)),))),
    ),
    optional=frozenset({"header", "goal_id"}),
)

_REMEMBERED: Final = 100
_REASON_COMES_WITHIN: Final = 0.3  # seconds to wait for the reason of a refusal, or for the end of a goal
_REASON_STEP: Final = 0.02
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


@dataclass(frozen=True)
class _Goal:
    """A goal that the robot accepted from these web services.

    Attributes:
        identity: The goal's UUID in ROS, 16 bytes.
        described: The goal as a plain MoveBaseActionGoal.
        handle: rclpy's ClientGoalHandle, which follows the goal's status.
        losses: How many action servers had disappeared when the goal was accepted.
    """

    identity: bytes
    described: dict[str, Any]
    handle: Any
    losses: int

    @property
    def status(self) -> int:
        reported: int = self.handle.status
        return reported or GoalStatus.STATUS_ACCEPTED  # 0: accepted, but no status received yet


class Goals:
    """The goals of the goal resource, on the event loop's thread; target poses must be in one of ``frames``."""

    def __init__(
        self,
        publishers: RobotPublishersNode,
        subscribers: RobotSubscribersNode,
        calls: RosCalls,
        navigator: ManagedNode,
        frames: Frames,
    ) -> None:
        self._publishers = publishers
        self._subscribers = subscribers
        self._calls = calls
        self._navigator = navigator
        self._frames = frames
        self._own: _Goal | None = None
        self._last: _Goal | None = None  # the goal that was accepted last, also after its end
        self._sending = 0  # goals that are being sent, or wait to be sent
        self._cancels = 0
        # Ids of our own and of cancelled goals, because the robot's report of its goal may lag behind.
        self._known: deque[str] = deque(maxlen=_REMEMBERED)
        self._one_at_a_time = asyncio.Lock()

    def current(self) -> dict[str, Any] | None:
        """Return the active goal as the dict of a MoveBaseActionGoal with its status, or None.

        Raises:
            Problem: 503 while the ROS thread hangs, because the robot's present state is unknown.
        """
        ros = self._subscribers.ros
        if ros.hangs():
            raise not_yet(f"ROS has been silent for {ros.silence():.1f} s: the goal is unknown")
        own = self._active_own()
        if own is not None:
            return own.described | {"status": status_of(own.status)}
        return self._foreign()

    def active_goal(self) -> dict[str, Any]:
        """Return the active goal.

        Raises:
            Problem: 404 without one, with id and status of the goal that ended last as the member ``last_goal``; 503
                as for current().
        """
        goal = self.current()
        if goal is None:
            last = self._last_ended()
            raise Problem(404, "the robot follows no goal", extensions=None if last is None else {"last_goal": last})
        return goal

    def is_active(self) -> bool:
        """Return whether the robot follows a goal of any client."""
        return self.current() is not None

    async def send(self, wanted: dict[str, Any]) -> tuple[int, dict[str, Any]]:
        """Send the goal in a dict of a MoveBaseActionGoal to the navigation, unless it is the current goal already.

        Returns:
            The HTTP status and the goal as the robot holds it: 200 for a repeat, 201 for a new goal, 202 if it
                displaces another goal.

        Raises:
            Problem: 422 for an invalid pose or a goal that the robot refuses, 409 for the current goal's id with
                another pose, 503 while no navigation is running.
        """
        require_pose(wanted["goal"]["target_pose"], self._frames, "goal.target_pose")
        cancels = self._cancels
        self._sending += 1
        try:
            async with self._one_at_a_time:
                return await self._send(wanted, cancels)
        finally:
            self._sending -= 1

    async def _send(self, wanted: dict[str, Any], cancels: int) -> tuple[int, dict[str, Any]]:
        current = self.current()
        identity = wanted.get("goal_id", {}).get("id")
        if current is not None and identity == current["goal_id"]["id"]:
            if _destination(wanted) != _destination(current):
                raise Problem(409, f"goal_id.id {identity!a} is the current goal's, which has another target_pose")
            return 200, current
        own = self._own = self._last = await self._wait_accepted(self._filled_in(wanted), cancels)
        # A goal at the robot's present pose may have ended already; then there is no current goal.
        sent = self.current() or own.described | {"status": status_of(GoalStatus.STATUS_ACCEPTED)}
        return (201 if current is None else 202), sent

    async def cancel(self) -> None:
        """Cancel the active goal of any client, and a goal that is being sent; do not wait for other requests.

        While it is unknown whether there is a goal, cancel all that the navigation may have.

        Raises:
            Problem: 404 if there is no goal, 409 if the robot refuses to cancel it, 503 if the robot does not respond.
        """
        is_unknown, own, sending = self._subscribers.ros.hangs(), self._own, self._sending
        current = None if is_unknown else self.current()
        if current is None and not (sending or is_unknown):
            self.active_goal()  # raises the Problem 404
        self._cancels += 1
        # Cancel all goals: another goal may have displaced the known one a moment ago.
        doomed = [goal.identity for goal in self._subscribers.goals.active()]
        reply = await self._calls.result(self._publishers.cancel_all_goals, "the navigation's cancel service")
        if current is not None and await self._is_refused(reply, own):
            raise Problem(409, f"the navigation refuses to cancel goal {current['goal_id']['id']!a}")
        # The goal is cancelled, unknown or ended: in each case no longer current.
        if self._own is own:
            self._own = None
        self._known.extend(doomed if current is None else [*doomed, current["goal_id"]["id"]])

    async def _is_refused(self, reply: CancelGoal.Response, own: _Goal | None) -> bool:
        """Return whether the navigation refused to cancel; rclpy's servers refuse by an empty list without a code."""
        if reply.return_code != CancelGoal.Response.ERROR_NONE or reply.goals_canceling or own is None:
            return bool(reply.return_code == CancelGoal.Response.ERROR_REJECTED)
        # A goal that has just ended is not in the list either.
        for _ in range(round(_REASON_COMES_WITHIN / _REASON_STEP)):
            if self._active_own() is not own:
                return False
            await asyncio.sleep(_REASON_STEP)
        return True

    def _active_own(self) -> _Goal | None:
        own = self._own
        if own is None or not self._publishers.navigation_is_served():
            return None  # without a navigation no goal is followed
        goals = self._subscribers.goals
        is_lost = own.losses != goals.losses and own.identity.hex() not in {goal.identity for goal in goals.active()}
        if is_lost or own.status not in STATUS_TEXTS:
            self._own = own = None  # it has ended
        return own

    def _last_ended(self) -> dict[str, Any] | None:
        """Return id and status of the goal that was accepted last, of this or another client, after its end."""
        reported = [goal for goal in self._subscribers.goals.reported if goal.status in ENDED_TEXTS]
        newest = max(reported, key=lambda goal: (goal.seconds, goal.nanoseconds), default=None)
        own = self._last
        if own is None:
            return None if newest is None else ended_goal(newest)
        since = own.handle.stamp.sec, own.handle.stamp.nanosec
        if newest is not None and newest.identity != own.identity.hex() and newest[2:] > since:
            return ended_goal(newest)
        # The end of a cancelled goal may not be reported yet; that of a goal whose server is gone never is.
        lost = own.losses != self._subscribers.goals.losses
        code = GoalStatus.STATUS_ABORTED if lost else GoalStatus.STATUS_CANCELED
        return {
            "goal_id": own.described["goal_id"],
            "status": status_of(own.status if own.status in ENDED_TEXTS else code),
        }

    def _foreign(self) -> dict[str, Any] | None:
        """Return the active goal that another client or a mission of the robot has sent, or None."""
        if not self._publishers.navigation_is_served():
            return None
        report = self._subscribers.current_goal
        if report == "":
            return None  # the robot reports that it follows no goal
        goal = goal_from_report(report) if report else None
        if goal is None:
            unknown = [goal for goal in self._subscribers.goals.active() if goal.identity not in self._known]
            goal = goal_from_status(unknown[-1]) if unknown else None
        return None if goal is None or goal["goal_id"]["id"] in self._known else goal

    def _filled_in(self, wanted: dict[str, Any]) -> dict[str, Any]:
        """Return the goal with optional fields added: the present time for stamps, and a new id."""
        seconds, nanoseconds = self._publishers.node.get_clock().now().seconds_nanoseconds()
        now = {"stamp": {"sec": seconds, "nanosec": nanoseconds}}
        target = wanted["goal"]["target_pose"]
        return {
            "header": now | wanted.get("header", {"frame_id": target["header"]["frame_id"]}),
            "goal_id": now | wanted.get("goal_id", {"id": str(uuid.uuid4())}),
            "goal": {"target_pose": {"header": now | target["header"], "pose": target["pose"]}},
        }

    async def _wait_accepted(self, described: dict[str, Any], cancels: int) -> _Goal:
        """Return the goal after the navigation has accepted it.

        Args:
            described: The goal as a plain MoveBaseActionGoal.
            cancels: The number of DELETE requests when the goal's request arrived.

        Raises:
            Problem: 409 if a DELETE request has arrived since; 422 if the navigation refuses the goal; 503 without a
                navigation.
        """
        if not self._publishers.navigation_is_served():
            raise not_yet("the robot has no navigation that accepts goals")
        identity = uuid.uuid4().bytes  # not the client's id, which may be reused for another goal
        self._known.append(identity.hex())
        losses = self._subscribers.goals.losses
        pose = message_from(shape_of(PoseStamped), described["goal"]["target_pose"])
        self._require_wanted(cancels)
        try:
            handle = await self._calls.result(lambda: self._publishers.send_goal(identity, pose), "the navigation")
        except Problem:
            with contextlib.suppress(ValueError):
                self._known.remove(identity.hex())  # if it is accepted later, it counts as another client's
            raise
        if not handle.accepted:
            await self._navigator.require_active()
            reason = await self._reason(described["goal"]["target_pose"])
            raise Problem(422, f"goal.target_pose is refused by the navigation: {reason}")
        if self._cancels != cancels:  # the goal may have been accepted after the DELETE
            cancel = self._publishers.cancel_goal
            await self._calls.result(lambda: cancel(identity), "the navigation's cancel service")
        self._require_wanted(cancels)
        return _Goal(identity, described, handle, losses)

    def _require_wanted(self, cancels: int) -> None:
        if self._cancels != cancels:
            raise Problem(409, "a DELETE request cancelled the goal before the navigation had accepted it")

    async def _reason(self, target: dict[str, Any]) -> str:
        """Return why the robot refused a goal; the reference robot publishes the reason on a topic, Nav2 does not."""
        for _ in range(round(_REASON_COMES_WITHIN / _REASON_STEP)):
            try:
                rejection = json.loads(self._subscribers.last_rejection or "{}")
                if rejection.get("pose") == target:
                    return str(rejection["reason"])
            except (ValueError, KeyError, AttributeError):
                break
            await asyncio.sleep(_REASON_STEP)
        return "no reason was given"


def _destination(goal: dict[str, Any]) -> tuple[str, Any]:
    target = goal["goal"]["target_pose"]
    return target["header"]["frame_id"], target["pose"]


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
