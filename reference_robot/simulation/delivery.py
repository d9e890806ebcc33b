"""The paper's delivery application: each delivery request on a topic makes the robot drive a mission.

A mission has three legs, each a NavigateToPose goal: to the source, the destination and the depot. Missions wait in a
queue while the navigation follows another client's goal.

- The navigation refuses a leg, gives it up, or disappears: the mission fails, and the next mission begins.
- Another client cancels or displaces a leg: the mission fails, and all waiting missions are dropped. So are they when
  another client's goal is cancelled while missions wait. An operator who stops the robot wants it to stay stopped.

The application works with every robot that offers Nav2's NavigateToPose action.

When ``capacity`` missions are waiting, a new request is dropped.
"""

import itertools
import json
import math
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from itertools import islice
from operator import attrgetter
from typing import Any, Final

from action_msgs.msg import GoalStatus
from mybot_delivery_app.msg import DeliveryRequestMsg
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header, String
from unique_identifier_msgs.msg import UUID

from conformance.papers_robot.delivery import COFFEE, COURIER
from reference_robot.deliveries import DeliveryRequest
from reference_robot.goal_statuses import GoalStatuses
from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime, waiting_messages
from reference_robot.simulation.messages import MISSION_REPORTS, stamped_pose


class MissionState(StrEnum):
    """The state of a mission."""

    QUEUED = "queued"
    ACTIVE = "active"
    DONE = "done"
    FAILED = "failed"
    DROPPED = "dropped"


_ALIVE: Final = frozenset({MissionState.QUEUED, MissionState.ACTIVE})


@dataclass(slots=True)
class Mission:
    """A delivery request that the application received, and its progress.

    Attributes:
        request: The delivery request.
        accepted: When the request was received: seconds and nanoseconds of ROS time.
        number: The request's sequence number, from 1.
        state: The present state.
        reason: Why the mission failed or was dropped; otherwise empty.
    """

    request: DeliveryRequest
    accepted: tuple[int, int]
    number: int
    state: MissionState = MissionState.QUEUED
    reason: str = ""

    def stops(self) -> tuple[tuple[float, float], ...]:
        """Return the (x, y) positions that the robot drives to, in order: source, destination, depot."""
        request = self.request
        return (
            (request.source_x, request.source_y),
            (request.destination_x, request.destination_y),
            (request.depot_x, request.depot_y),
        )

    def plain(self) -> dict[str, Any]:
        """Return the mission as a JSON-ready dict, as published on the topic of missions."""
        return {
            "number": self.number,
            "request": self.request._asdict(),
            "state": self.state.value,
            "reason": self.reason,
            "accepted": {"sec": self.accepted[0], "nanosec": self.accepted[1]},
        }


class Missions:
    """A queue of at most ``capacity`` missions, the active mission, and the missions that changed lately.

    Attributes:
        active: The mission that the robot drives; None if there is none.
        taken: How many requests have been received.
        dropped: How many of them were dropped.
    """

    def __init__(self, capacity: int = 20) -> None:
        self._capacity = capacity
        self._queue: deque[Mission] = deque()
        self._changed: dict[int, Mission] = {}
        self.active: Mission | None = None
        self.taken = 0
        self.dropped = 0

    def changes(self) -> list[Mission]:
        """Return the missions that changed since the last call, newest first, and forget the changes.

        At most a hundred changes are kept; missions that wait or are driven are never left out.
        """
        changed = sorted(self._changed.values(), key=attrgetter("number"), reverse=True)
        self._changed.clear()
        return changed

    def add(self, request: DeliveryRequest, accepted: tuple[int, int]) -> Mission:
        """Return a new mission for a request: queued, or dropped if the queue is full."""
        self.taken += 1
        mission = Mission(request, accepted, self.taken)
        if len(self._queue) < self._capacity:
            self._queue.append(mission)
            self._set(mission, MissionState.QUEUED)
        else:
            self._drop(mission, f"the queue is full with {self._capacity} missions")
        return mission

    def begin(self) -> Mission | None:
        """Make the longest waiting mission active and return it; None if a mission is active or none waits."""
        if self.active is not None or not self._queue:
            return None
        self.active = self._queue.popleft()
        self._set(self.active, MissionState.ACTIVE)
        return self.active

    def finish(self, state: MissionState, reason: str = "") -> None:
        """End the active mission, if any, in the state DONE or FAILED."""
        if self.active is not None:
            self._set(self.active, state, reason)
            self.active = None

    def abandon(self) -> None:
        """Fail the active mission and drop all waiting ones, because another client controls the robot now."""
        self.finish(MissionState.FAILED, "its goal was cancelled or displaced")
        while self._queue:
            self._drop(self._queue.popleft(), "another goal was cancelled or displaced")

    def _drop(self, mission: Mission, reason: str) -> None:
        self.dropped += 1
        self._set(mission, MissionState.DROPPED, reason)

    def _set(self, mission: Mission, state: MissionState, reason: str = "") -> None:
        mission.state, mission.reason = state, reason
        self._changed.pop(mission.number, None)
        self._changed[mission.number] = mission
        if len(self._changed) > _REMEMBERED:
            self._forget_one()

    def _forget_one(self) -> None:
        """Forget the oldest change of a mission that has ended; waiting and active missions are kept."""
        for number, mission in self._changed.items():
            if mission.state not in _ALIVE:
                del self._changed[number]
                return


# Waking a Python thread for each message costs this process 40 µs and takes a processor from the sender: on a small
# robot's machine, that of the client that waits for its response. So the first message wakes a thread, and messages of
# the next 5 ms are read together. Until then Fast DDS stores and acknowledges them.
# No request is lost: unread messages are kept, and a publisher with KEEP_ALL waits when the queue is full.
_QOS: Final = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
# A batch occupies a processor: the messages of 50 ms for 3 ms, the messages of 5 ms for 0.3 ms.
_PAUSE_S: Final = 0.005
_MOST: Final = 5000  # messages that Fast DDS keeps; others may arrive while a batch is read
_CODES: Final = frozenset({COURIER, COFFEE})
_REPORT_PERIOD_S: Final = 0.05  # shortest time between two reports
_RETRY_PERIOD_S: Final = 0.2  # after a refused leg, and while the navigation is not running
_CANCELED: Final = frozenset({GoalStatus.STATUS_CANCELING, GoalStatus.STATUS_CANCELED})
_REMEMBERED: Final = 100  # goal ids of legs, and of other clients' cancelled goals


class DeliveryRequests:
    """A subscription to the topic of delivery requests that is read in batches."""

    def __init__(self, ros: RosRuntime, names: RosNames) -> None:
        self._ros = ros
        node = ros.create_node("delivery_requests", spun=False)
        self._subscription = node.create_subscription(
            DeliveryRequestMsg, names.topics.delivery, lambda _: None, _QOS, raw=True
        )

    def watch(self, node: Node, callback: Callable[[], None]) -> None:
        """Call ``callback`` in a node's thread whenever requests are waiting to be read."""
        self._ros.watch(self._subscription, node, callback, _PAUSE_S)

    def waiting(self) -> Iterator[DeliveryRequest]:
        """Yield the waiting requests, oldest first, and remove them from the subscription's queue."""
        return map(DeliveryRequest.of, islice(waiting_messages(self._subscription), _MOST))


class Delivery:
    """The delivery application: receives requests, drives one mission after another, publishes their states."""

    def __init__(self, node: Node, requests: DeliveryRequests, names: RosNames) -> None:
        self._node = node
        self._requests = requests
        self._frames = names.frames
        self._missions = Missions()
        self._legs: list[tuple[float, float, float]] = []
        self._leg = ""  # the id of the active goal
        self._own: deque[str] = deque(maxlen=_REMEMBERED)
        self._seen_canceled: deque[str] = deque(maxlen=_REMEMBERED)
        self._knows_goals = False
        self._losses = 0
        self._reported_at = -math.inf
        self._report_is_due = False
        self._reports = node.create_publisher(String, names.topics.missions, MISSION_REPORTS)
        self._report_later = node.create_timer(_REPORT_PERIOD_S, self._report)
        self._begin_later = node.create_timer(_RETRY_PERIOD_S, self._begin)
        self._begin_later.cancel()
        self._navigate = ActionClient(node, NavigateToPose, names.actions.navigate_to_pose)
        self._goals = GoalStatuses(node, names.actions.navigate_to_pose, self._note_goals)
        requests.watch(node, self._add_waiting)

    def _add_waiting(self) -> None:
        for request in self._requests.waiting():
            self._add(request)

    def _add(self, request: DeliveryRequest) -> None:
        if request.message_code not in _CODES:
            self._node.get_logger().info(
                f"ignored a request with the unknown message code {request.message_code}", throttle_duration_sec=1.0
            )
            return
        mission = self._missions.add(request, divmod(time.time_ns(), 1_000_000_000))
        if mission.state is MissionState.QUEUED and self._begin_later.is_canceled():
            self._begin()
        self._report_changes()

    def _note_goals(self) -> None:
        """Process a status report of the navigation's goals, including those of other clients."""
        canceled = [
            goal.identity
            for goal in self._goals.reported
            if goal.status in _CANCELED and goal.identity not in self._own and goal.identity not in self._seen_canceled
        ]
        self._seen_canceled.extend(canceled)
        # A cancelled leg drops the queue when it ends (`_leg_ended`). Goals that the first report shows as cancelled
        # were cancelled before any request, even if a request was read before that report.
        if canceled and self._knows_goals and self._missions.active is None:
            self._missions.abandon()
            self._report_changes()
        self._knows_goals = True
        if self._goals.losses != self._losses:
            self._losses = self._goals.losses
            if self._leg and self._leg not in {goal.identity for goal in self._goals.active()}:
                self._fail("the navigation is no longer running")
        self._begin()

    def _begin(self) -> None:
        """Begin the next waiting mission, provided that the navigation is running and not busy."""
        self._begin_later.cancel()
        if any(goal.identity not in self._own for goal in self._goals.active()):
            return  # the navigation follows another client's goal
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
        self._report_changes()
        self._next_leg()

    def _next_leg(self) -> None:
        if not self._legs:
            self._missions.finish(MissionState.DONE)
            self._report_changes()
            self._begin()
            return
        header = Header(stamp=self._node.get_clock().now().to_msg(), frame_id=self._frames.map)
        goal = NavigateToPose.Goal(pose=stamped_pose(self._legs.pop(0), header))
        identity = uuid.uuid4()
        self._leg = identity.hex
        self._own.append(self._leg)
        sent = self._navigate.send_goal_async(goal, goal_uuid=UUID(uuid=list(identity.bytes)))
        sent.add_done_callback(partial(self._leg_accepted_or_refused, self._leg))

    def _leg_accepted_or_refused(self, leg: str, response: Any) -> None:
        handle = response.result()
        if leg != self._leg:
            return  # the leg has been given up
        if handle.accepted:
            handle.get_result_async().add_done_callback(partial(self._leg_ended, leg))
        else:
            self._fail("the navigation refused a leg")

    def _leg_ended(self, leg: str, response: Any) -> None:
        if leg != self._leg:
            return
        self._leg = ""
        outcome = response.result()
        if outcome.status == GoalStatus.STATUS_SUCCEEDED:
            self._next_leg()
        elif outcome.result.error_code:  # as in Nav2; a displaced goal has no error code
            self._fail(f"the navigation gave up a leg: {outcome.result.error_msg or outcome.result.error_code}")
        else:
            self._missions.abandon()
            self._report_changes()

    def _fail(self, reason: str) -> None:
        """End the active mission as failed, and begin the next one after a pause."""
        self._leg = ""
        self._missions.finish(MissionState.FAILED, reason)
        self._report_changes()
        # After a pause, so that a queue of impossible missions does not keep the planner busy.
        self._begin_later.reset()

    def _report_changes(self) -> None:
        """Publish the missions that changed, at most 20 times a second."""
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
        report = {
            "taken": missions.taken,
            "dropped": missions.dropped,
            "missions": [mission.plain() for mission in missions.changes()],
        }
        self._reports.publish(String(data=json.dumps(report)))
