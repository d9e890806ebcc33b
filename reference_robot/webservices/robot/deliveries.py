"""Delivery requests from REST and SOAP: publishing them to ROS, and listing them with their states.

The state of a request is that of its mission, which the delivery application reports.
"""

import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple

import msgspec

from conformance.papers_robot.delivery import COFFEE, COURIER
from reference_robot.deliveries import DeliveryRequest
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.problems import Problem, clip, not_yet

_MOST_MISSIONS: Final = 300
_CODES: Final = frozenset({COURIER, COFFEE})
_REMEMBERED: Final = 100  # the contract requires the last 50
_REPORTS: Final = 50  # mission reports that may wait to be read
_NANOSECONDS: Final = 10**9
Sender = Literal["rest", "soap"]


class _Time(msgspec.Struct):
    sec: int
    nanosec: int


class _ReportedMission(msgspec.Struct):
    """A mission in a report of the delivery application (see ``names.toml``)."""

    number: int
    request: dict[str, float]
    state: Literal["queued", "active", "done", "failed", "dropped"]
    accepted: _Time
    reason: str = ""


class _Report(msgspec.Struct):
    missions: list[_ReportedMission]


# msgspec reads a report of a hundred missions in 0.1 ms, json and checks in Python in 0.3 ms; other requests wait.
_REPORT: Final = msgspec.json.Decoder(_Report)


class Mission(NamedTuple):
    """A reported mission: its request, its time of acceptance (ns), its state, and the reason of a failure."""

    request: DeliveryRequest
    nanoseconds: int
    state: str
    reason: str


class MissionTable:
    """The last 300 missions that the delivery application reported."""

    def __init__(self) -> None:
        self._missions: dict[tuple[int, int], Mission] = {}  # by time and number, oldest report first

    def note(self, report: str) -> None:
        """Add the missions of a report (JSON, see ``names.toml``); an invalid report is ignored."""
        try:
            found = [_mission(entry) for entry in _REPORT.decode(report).missions]
        except (msgspec.DecodeError, TypeError):
            return
        for key, mission in reversed(found):  # a report lists the newest first
            self._missions[key] = mission
        while len(self._missions) > _MOST_MISSIONS:
            del self._missions[next(iter(self._missions))]

    def finder(self) -> Callable[[DeliveryRequest, int], Mission]:
        """Return a function that finds the mission of a request with its time of acceptance (ns).

        Call the function for the newest request first. Messages have no id, so equal requests are distinguished by
        order: the newest request gets the newest mission accepted after it. A request without a reported mission counts
        as queued.
        """
        left: dict[DeliveryRequest, list[Mission]] = {}
        for _, mission in sorted(self._missions.items()):
            left.setdefault(mission.request, []).append(mission)

        def find(request: DeliveryRequest, nanoseconds: int) -> Mission:
            same = left.get(request)
            if same and same[-1].nanoseconds >= nanoseconds:
                return same.pop()
            return Mission(request, nanoseconds, "queued", "")

        return find


def _mission(entry: _ReportedMission) -> tuple[tuple[int, int], Mission]:
    """Return a reported mission with its sort key (time, number); raise TypeError for an invalid request."""
    nanoseconds = entry.accepted.sec * _NANOSECONDS + entry.accepted.nanosec
    mission = Mission(DeliveryRequest(**entry.request), nanoseconds, entry.state, entry.reason)  # type: ignore[arg-type]
    return (nanoseconds, entry.number), mission


class UnusableFieldError(ValueError):
    """An error for a field with an invalid value; ``rule`` says what the value must be."""

    def __init__(self, field: str, rule: str) -> None:
        super().__init__(f"{field} {rule}")
        self.field = field
        self.rule = rule

    def refusal(self, name: str, sent: str) -> Problem:
        """Return the Problem 422 with the interface's own name of the field and the text that the client sent."""
        return Problem(422, f"{name} {self.rule}, not {clip(sent)}")


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

    def latest(self) -> list[dict[str, Any]]:
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
