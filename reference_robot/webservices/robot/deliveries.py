"""The delivery application as both interfaces see it: hand a request to ROS, remember it, tell what became of it."""

import json
import math
import time
from collections import deque
from typing import Any, Final, Literal, NamedTuple

from mybot_delivery_app.msg import DeliveryRequestMsg

from conformance.contract.delivery import COFFEE, COURIER
from reference_robot.deliveries import DeliveryRequest
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.checking import shown
from reference_robot.webservices.representation.problems import Problem, not_yet

_CODES: Final = frozenset({COURIER, COFFEE})
_REMEMBERED: Final = 100  # the contract asks for the last 50
_STATES: Final = frozenset({"queued", "active", "done", "failed", "dropped"})
_NANOSECONDS: Final = 10**9


class UnusableFieldError(ValueError):
    """A field of the message has a value that no delivery may have; the rule says what it must be."""

    def __init__(self, field: str, rule: str) -> None:
        super().__init__(f"{field} {rule}")
        self.field = field
        self.rule = rule

    def refusal(self, name: str, sent: str) -> Problem:
        """Return the 422 in the words of an interface: its own name of the field, and the text that came in it."""
        return Problem(422, f"{name} {self.rule}, not {shown(sent)}")


class _Accepted(NamedTuple):
    request: DeliveryRequest
    nanoseconds: int
    interface: Literal["rest", "soap"]


class Deliveries:
    """Takes delivery requests from both interfaces."""

    def __init__(self, publishers: RobotPublishersNode, subscribers: RobotSubscribersNode) -> None:
        self._publishers = publishers
        self._subscribers = subscribers
        self._message = DeliveryRequestMsg()  # filled anew for each request: publishing copies it
        self._accepted: deque[_Accepted] = deque(maxlen=_REMEMBERED)

    def accept(self, request: DeliveryRequest, interface: Literal["rest", "soap"]) -> None:
        """Publish a request: exactly one message.

        Raises:
            UnusableFieldError: The code is no delivery's, or a coordinate is not finite.
            Problem: 503, when no delivery application listens, for the message would be lost, and while those that
                listen are behind by thousands.
        """
        _require_usable(request)
        if not self._publishers.delivery_is_served():
            raise not_yet("no delivery application listens on the robot")
        message = self._message
        (  # written out: a loop of setattr costs each PUT half a microsecond more
            message.message_code,
            message.depot_x,
            message.depot_y,
            message.destination_x,
            message.destination_y,
            message.source_x,
            message.source_y,
        ) = request
        at = time.time_ns()  # before a mission can begin
        if not self._publishers.publish_delivery(message):
            raise not_yet("the delivery application cannot keep up with the requests")
        self._accepted.append(_Accepted(request, at, interface))

    def listed(self) -> list[dict[str, Any]]:
        """Return the requests accepted last, newest first, with the state that the application reports."""
        missions = _missions(self._subscribers.missions)
        return [
            {
                "request": accepted.request._asdict(),
                "state": _state(accepted, missions),
                "accepted": dict(zip(("sec", "nanosec"), divmod(accepted.nanoseconds, _NANOSECONDS), strict=True)),
                "interface": accepted.interface,
            }
            for accepted in reversed(self._accepted)
        ]


def _require_usable(request: DeliveryRequest) -> None:
    if request.message_code not in _CODES:
        raise UnusableFieldError("message_code", "must be 3 (courier) or 4 (coffee)")
    if not math.isfinite(sum(request)):
        # Finite doubles may add up to an infinity; so look closer before refusing.
        for field, value in request._asdict().items():
            if not math.isfinite(value):
                raise UnusableFieldError(field, "must be finite")


def _state(accepted: _Accepted, missions: dict[DeliveryRequest, list[tuple[int, str]]]) -> str:
    """Return the state of a request, and take its mission off the list.

    A message carries no identity, so equal requests are told apart by order: the newest request takes the newest
    mission that began after it. What the application has not reported (yet) is queued.
    """
    same = missions.get(accepted.request)
    if same and same[0][0] >= accepted.nanoseconds:
        return same.pop(0)[1]
    return "queued"


def _missions(report: str) -> dict[DeliveryRequest, list[tuple[int, str]]]:
    """Return start (ns) and state of the reported missions by request, newest first; a report amiss counts as none."""
    found: dict[DeliveryRequest, list[tuple[int, str]]] = {}
    try:
        for mission in json.loads(report or "[]"):
            request = DeliveryRequest(**mission["request"])
            accepted = mission["accepted"]
            nanoseconds = int(accepted["sec"]) * _NANOSECONDS + int(accepted["nanosec"])
            if mission["state"] in _STATES:
                found.setdefault(request, []).append((nanoseconds, mission["state"]))
    except (ValueError, TypeError, KeyError):
        return {}
    return found
