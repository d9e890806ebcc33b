"""What the delivery application has told of its missions, change by change."""

from collections.abc import Callable
from typing import Final, Literal, NamedTuple

import msgspec

from reference_robot.deliveries import DeliveryRequest

_REMEMBERED: Final = 300
_NANOSECONDS: Final = 10**9


class _Time(msgspec.Struct):
    sec: int
    nanosec: int


class _Told(msgspec.Struct):
    """A mission in a report (see ``names.toml``)."""

    number: int
    request: dict[str, float]
    state: Literal["queued", "active", "done", "failed", "dropped"]
    accepted: _Time
    reason: str = ""


class _Report(msgspec.Struct):
    missions: list[_Told]


# A report of a hundred missions is read in 0.1 ms, which other requests wait for; with json and checks of our own, 0.3.
_REPORT: Final = msgspec.json.Decoder(_Report)


class Mission(NamedTuple):
    """A mission as it was reported last: its request, when it was taken (ns), its state, the reason of a bad end."""

    request: DeliveryRequest
    nanoseconds: int
    state: str
    reason: str


class MissionTable:
    """The missions reported last."""

    def __init__(self) -> None:
        self._missions: dict[tuple[int, int], Mission] = {}  # by time and number, oldest first

    def note(self, report: str) -> None:
        """Take up a report (see ``names.toml``); one that is amiss counts as none."""
        try:
            found = [_mission(told) for told in _REPORT.decode(report).missions]
        except (msgspec.DecodeError, TypeError):
            return
        for key, mission in reversed(found):  # which are told newest first
            self._missions[key] = mission
        while len(self._missions) > _REMEMBERED:
            del self._missions[next(iter(self._missions))]

    def finder(self) -> Callable[[DeliveryRequest, int], Mission]:
        """Return a function that finds the mission of a request accepted at a time (ns), asked newest first.

        A message carries no identity, so equal requests are told apart by order: the newest request takes the newest
        mission that began after it. What the application has not reported (yet) is queued.
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


def _mission(told: _Told) -> tuple[tuple[int, int], Mission]:
    """Return a mission under its place in the order; raises TypeError for a request that is none."""
    nanoseconds = told.accepted.sec * _NANOSECONDS + told.accepted.nanosec
    mission = Mission(DeliveryRequest(**told.request), nanoseconds, told.state, told.reason)  # type: ignore[arg-type]
    return (nanoseconds, told.number), mission
