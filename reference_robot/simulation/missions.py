"""The delivery application's missions: what is asked, what waits, what drives, what became of the rest.

Pure state, apart from ROS. Overflow rule: when ``capacity`` missions wait, a new request is dropped.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

from reference_robot.deliveries import DeliveryRequest

_REMEMBERED: Final = 100


class MissionState(StrEnum):
    """Where a mission stands."""

    QUEUED = "queued"
    ACTIVE = "active"
    DONE = "done"
    FAILED = "failed"
    DROPPED = "dropped"


@dataclass(slots=True)
class Mission:
    """A request, when it was accepted (seconds and nanoseconds of ROS time), and its state."""

    request: DeliveryRequest
    accepted: tuple[int, int]
    state: MissionState = MissionState.QUEUED

    def stops(self) -> tuple[tuple[float, float], ...]:
        """Where the robot goes, in order: source, destination, depot."""
        asked = self.request
        return (
            (asked.source_x, asked.source_y),
            (asked.destination_x, asked.destination_y),
            (asked.depot_x, asked.depot_y),
        )

    def plain(self) -> dict[str, Any]:
        """Return JSON-ready values, as they stand on the topic of missions."""
        return {
            "request": self.request._asdict(),
            "state": self.state.value,
            "accepted": {"sec": self.accepted[0], "nanosec": self.accepted[1]},
        }


class Missions:
    """A queue of at most ``capacity`` missions, the one that drives, and a memory of the last hundred."""

    def __init__(self, capacity: int = 20) -> None:
        self._capacity = capacity
        self._queue: deque[Mission] = deque()
        self._newest_first: deque[Mission] = deque(maxlen=_REMEMBERED)
        self.active: Mission | None = None

    def __iter__(self) -> Iterator[Mission]:
        """Iterate over the missions remembered, newest first."""
        return iter(self._newest_first)

    def add(self, request: DeliveryRequest, accepted: tuple[int, int]) -> Mission:
        """Queue a request, or drop it when the queue is full."""
        mission = Mission(request, accepted)
        if len(self._queue) < self._capacity:
            self._queue.append(mission)
        else:
            mission.state = MissionState.DROPPED
        self._newest_first.appendleft(mission)
        return mission

    def begin(self) -> Mission | None:
        """Make the mission that waits longest the active one; None if one is active or none waits."""
        if self.active is not None or not self._queue:
            return None
        self.active = self._queue.popleft()
        self.active.state = MissionState.ACTIVE
        return self.active

    def finish(self, state: MissionState) -> None:
        """End the active mission, done or failed."""
        if self.active is not None:
            self.active.state = state
            self.active = None

    def abandon(self) -> None:
        """End the active mission as failed and drop all that wait: somebody wants the robot elsewhere."""
        self.finish(MissionState.FAILED)
        while self._queue:
            self._queue.popleft().state = MissionState.DROPPED
