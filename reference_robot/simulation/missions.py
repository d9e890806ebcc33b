"""The missions of the delivery application: a queue, the active mission, and the changes to report.

The module does not use ROS. When ``capacity`` missions are waiting, a new request is dropped.
"""

from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from operator import attrgetter
from typing import Any, Final

from reference_robot.deliveries import DeliveryRequest

_REMEMBERED: Final = 100  # changes kept between two reports


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
