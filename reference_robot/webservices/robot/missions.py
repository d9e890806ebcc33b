"""The mission reports of the delivery application, and the mission of each accepted request."""

from collections.abc import Callable
from typing import Final, Literal, NamedTuple

import msgspec

from reference_robot.deliveries import DeliveryRequest

_REMEMBERED: Final = 300
_NANOSECONDS: Final = 10**9


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
        while len(self._missions) > _REMEMBERED:
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
