"""The goals of a ROS action server, from every client, as the server's status topic reports them (ROS 2 "Actions")."""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from action_msgs.msg import GoalStatus, GoalStatusArray
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default

ACTIVE: Final = frozenset({GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING, GoalStatus.STATUS_CANCELING})


class ReportedGoal(NamedTuple):
    """A goal as reported by its action server: id (32 hexadecimal digits), status, and time of acceptance."""

    identity: str
    status: int
    seconds: int
    nanoseconds: int


class GoalStatuses:
    """A subscriber that keeps the latest goal statuses of an action server.

    The executor's thread updates the object and calls ``on_change`` after each report. A server that crashes does not
    report the end of its goals, and its successor does not know them. So the goals count as ended when their server
    disappears.

    Attributes:
        reported: The goals in the order of the server's report, including goals that ended recently.
        losses: How many servers of this action have disappeared so far.
    """

    def __init__(self, node: Node, action: str, on_change: Callable[[], None] = lambda: None) -> None:
        self.reported: tuple[ReportedGoal, ...] = ()
        self.losses = 0
        self._on_change = on_change
        self._is_of_newest = True  # the newest server has sent a report
        node.create_subscription(
            GoalStatusArray,
            f"{action}/_action/status",
            self._keep,
            qos_profile_action_status_default,
            event_callbacks=SubscriptionEventCallbacks(matched=self._note_servers),
        )

    def active(self) -> list[ReportedGoal]:
        """Return the goals that have not ended, oldest first."""
        found = [goal for goal in self.reported if goal.status in ACTIVE]
        return sorted(found, key=lambda goal: (goal.seconds, goal.nanoseconds))

    def _keep(self, array: GoalStatusArray) -> None:
        self._is_of_newest = True
        self.reported = tuple(_report_of(status) for status in array.status_list)
        self._on_change()

    def _note_servers(self, change: Any) -> None:
        """Update the state after action servers appeared or disappeared.

        ``change`` is rclpy's matched event for the status topic; one event may summarise several changes.
        """
        if change.total_count_change:
            self._is_of_newest = False
        lost = change.total_count_change - change.current_count_change
        if lost > 0:
            self.losses += lost
            if not (self._is_of_newest and change.current_count):
                self.reported = ()
            self._on_change()


def _report_of(status: GoalStatus) -> ReportedGoal:
    info = status.goal_info
    return ReportedGoal(bytes(info.goal_id.uuid).hex(), status.status, info.stamp.sec, info.stamp.nanosec)
