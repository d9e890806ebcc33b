"""The paper's delivery application: a request on a topic makes the robot drive a mission.

A mission goes source → destination → depot, each leg a NavigateToPose goal. It waits while navigation
has somebody else's goal. A leg that is refused fails its mission, and the next one begins; a leg that is
cancelled or displaced from outside fails its mission and drops the queue, and so does cancelling somebody
else's goal while missions wait: an operator who stops the robot wants it to stay stopped.
"""

import itertools
import json
import math
import time
from operator import attrgetter
from typing import Any, Final

from action_msgs.msg import GoalStatus
from mybot_delivery_app.msg import DeliveryRequestMsg
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header, String

from conformance.contract.delivery import COFFEE, COURIER
from reference_robot.deliveries import DeliveryRequest
from reference_robot.names import RosNames
from reference_robot.simulation.messages import MISSION_REPORTS, stamped_pose
from reference_robot.simulation.missions import Missions, MissionState

_CODES: Final = frozenset({COURIER, COFFEE})
_REPORT_PERIOD_S: Final = 0.05  # at least this between two reports, however fast requests come
_RETRY_PERIOD_S: Final = 0.2  # after a refused leg, and while navigation's action server is not there

# No request is lost: what has not been taken yet is kept, and a publisher that keeps all as well is held back.
_REQUESTS: Final = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
_FIELDS_OF: Final = attrgetter(*DeliveryRequest._fields)

# Latched as its publisher's, but deep enough that a goal's canceling is not overwritten by its end.
_CURRENT_GOALS: Final = QoSProfile(
    depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


class Delivery:
    """Runs missions."""

    def __init__(self, node: Node, names: RosNames) -> None:
        self._node = node
        self._frames = names.frames
        self._missions = Missions()
        self._legs: list[tuple[float, float, float]] = []
        self._navigation_is_busy = False
        self._reported_at = -math.inf
        self._report_is_due = False
        self._reports = node.create_publisher(String, names.topics.missions, MISSION_REPORTS)
        self._report_later = node.create_timer(_REPORT_PERIOD_S, self._report)
        self._begin_later = node.create_timer(_RETRY_PERIOD_S, self._begin)
        self._begin_later.cancel()
        self._navigate = ActionClient(node, NavigateToPose, names.actions.navigate_to_pose)
        node.create_subscription(String, names.topics.current_goal, self._note_current_goal, _CURRENT_GOALS)
        node.create_subscription(DeliveryRequestMsg, names.topics.delivery, self._take, _REQUESTS)

    def _take(self, message: DeliveryRequestMsg) -> None:
        if message.message_code not in _CODES:
            self._node.get_logger().info(
                f"ignored a request with the unknown message code {message.message_code}", throttle_duration_sec=1.0
            )
            return
        request = DeliveryRequest(*_FIELDS_OF(message))
        mission = self._missions.add(request, divmod(time.time_ns(), 1_000_000_000))
        if mission.state is MissionState.QUEUED and self._begin_later.is_canceled():
            self._begin()
        self._changed()

    def _note_current_goal(self, message: String) -> None:
        self._navigation_is_busy = bool(message.data)
        is_canceling = message.data and json.loads(message.data)["status"] == GoalStatus.STATUS_CANCELING
        # A leg of ours that is cancelled drops the queue when it ends.
        if is_canceling and self._missions.active is None:
            self._missions.abandon()
            self._changed()
        self._begin()

    def _begin(self) -> None:
        """Begin the next mission, if there is one and navigation is free for it."""
        self._begin_later.cancel()
        if self._navigation_is_busy:
            return
        if not self._navigate.server_is_ready():
            self._begin_later.reset()
            return
        mission = self._missions.begin()
        if mission is None:
            return
        stops = mission.stops()
        self._legs = [
            (x, y, math.atan2(y - from_y, x - from_x))
            for (from_x, from_y), (x, y) in itertools.pairwise((stops[-1], *stops))
        ]
        self._changed()
        self._next_leg()

    def _next_leg(self) -> None:
        if not self._legs:
            self._missions.finish(MissionState.DONE)
            self._changed()
            self._begin()
            return
        header = Header(stamp=self._node.get_clock().now().to_msg(), frame_id=self._frames.map)
        goal = NavigateToPose.Goal(pose=stamped_pose(self._legs.pop(0), header))
        self._navigate.send_goal_async(goal).add_done_callback(self._leg_answered)

    def _leg_answered(self, answer: Any) -> None:
        handle = answer.result()
        if handle.accepted:
            handle.get_result_async().add_done_callback(self._leg_ended)
        else:
            # An impossible mission is planned in vain; a queue of them is not to keep the planner busy.
            self._missions.finish(MissionState.FAILED, "the navigation refused a leg")
            self._changed()
            self._begin_later.reset()

    def _leg_ended(self, answer: Any) -> None:
        if answer.result().status == GoalStatus.STATUS_SUCCEEDED:
            self._next_leg()
            return
        self._missions.abandon()
        self._changed()

    def _changed(self) -> None:
        """Report what changed: at once, or when the last report is old enough."""
        if time.monotonic() - self._reported_at >= _REPORT_PERIOD_S:
            self._report()
        elif not self._report_is_due:
            self._report_is_due = True
            self._report_later.reset()

    def _report(self) -> None:
        self._report_later.cancel()
        self._report_is_due = False
        self._reported_at = time.monotonic()
        missions = self._missions
        told = {
            "taken": missions.taken,
            "dropped": missions.dropped,
            "missions": [mission.plain() for mission in missions.changes()],
        }
        self._reports.publish(String(data=json.dumps(told)))
