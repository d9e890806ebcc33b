"""Delivery requests from REST and SOAP: publishing them to ROS, and listing them with their states."""

import math
import time
from collections import deque
from typing import Any, Final, Literal

from conformance.papers_robot.delivery import COFFEE, COURIER
from reference_robot.deliveries import DeliveryRequest
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.problems import Problem, not_yet, shown
from reference_robot.webservices.robot.missions import MissionTable

_CODES: Final = frozenset({COURIER, COFFEE})
_REMEMBERED: Final = 100  # the contract requires the last 50
_REPORTS: Final = 50  # mission reports that may wait to be read
_NANOSECONDS: Final = 10**9


class UnusableFieldError(ValueError):
    """An error for a field with an invalid value; ``rule`` says what the value must be."""

    def __init__(self, field: str, rule: str) -> None:
        super().__init__(f"{field} {rule}")
        self.field = field
        self.rule = rule

    def refusal(self, name: str, sent: str) -> Problem:
        """Return the Problem 422 with the interface's own name of the field and the text that the client sent."""
        return Problem(422, f"{name} {self.rule}, not {shown(sent)}")


Sender = Literal["rest", "soap"]


class Deliveries:
    """The publisher and the list of delivery requests from both interfaces."""

    def __init__(self, publishers: RobotPublishersNode, subscribers: RobotSubscribersNode) -> None:
        self._publishers = publishers
        self._reports = subscribers.mission_reports
        self._missions = MissionTable()
        # Each with its time in nanoseconds and its interface. Plain tuples, because each request creates one.
        self._accepted: deque[tuple[DeliveryRequest, int, Sender]] = deque(maxlen=_REMEMBERED)

    def accept(self, request: DeliveryRequest, interface: Sender) -> None:
        """Publish a delivery request as exactly one ROS message.

        Raises:
            UnusableFieldError: The message code is unknown, or a coordinate is not finite.
            Problem: 503, if no delivery application subscribes, so that the message would be lost, or if the
                subscribers are thousands of messages behind.
        """
        _require_usable(request)
        if len(self._reports) > _REPORTS:
            self._missions.note(self._reports.popleft())  # all at once would delay the next request
        if not self._publishers.delivery_is_served():
            raise not_yet("no delivery application listens on the robot")
        at = time.time_ns()  # before publishing, so that no mission is older than its request
        if not self._publishers.publish_delivery(request):
            raise not_yet("the delivery application cannot keep up with the requests")
        self._accepted.append((request, at, interface))

    def listed(self) -> list[dict[str, Any]]:
        """Return the latest accepted requests, newest first, with the states and reasons reported for them."""
        while self._reports:
            self._missions.note(self._reports.popleft())
        find = self._missions.finder()
        listed = []
        for request, nanoseconds, interface in reversed(self._accepted):
            mission = find(request, nanoseconds)
            entry = {
                "request": request._asdict(),
                "state": mission.state,
                "accepted": dict(zip(("sec", "nanosec"), divmod(nanoseconds, _NANOSECONDS), strict=True)),
                "interface": interface,
            }
            listed.append(entry | {"reason": mission.reason} if mission.reason else entry)
        return listed


def _require_usable(request: DeliveryRequest) -> None:
    if request.message_code not in _CODES:
        raise UnusableFieldError("message_code", "must be 3 (courier) or 4 (coffee)")
    if not math.isfinite(sum(request)):
        # The sum of finite doubles may be infinite, so check each value before refusing.
        for field, value in request._asdict().items():
            if not math.isfinite(value):
                raise UnusableFieldError(field, "must be finite")
