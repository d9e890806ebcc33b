"""What the delivery application has told of its missions, change by change."""

import json
from collections.abc import Callable
from typing import Final, NamedTuple

from reference_robot.deliveries import DeliveryRequest

_REMEMBERED: Final = 300
_STATES: Final = frozenset({"queued", "active", "done", "failed", "dropped"})
_NANOSECONDS: Final = 10**9


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
            found = [_mission(told) for told in json.loads(report)["missions"]]
        except (ValueError, TypeError, KeyError):
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


def _mission(told: dict[str, dict[str, int] | str | int]) -> tuple[tuple[int, int], Mission]:
    """Return a mission under its place in the order; raises what a report amiss raises."""
    accepted, state, number, request = told["accepted"], told["state"], told["number"], told["request"]
    if not isinstance(accepted, dict) or not isinstance(request, dict) or not isinstance(number, int):
        raise TypeError("no mission")
    if state not in _STATES:
        raise ValueError(state)
    nanoseconds = int(accepted["sec"]) * _NANOSECONDS + int(accepted["nanosec"])
    mission = Mission(DeliveryRequest(**request), nanoseconds, str(state), str(told.get("reason", "")))
    return (nanoseconds, number), mission
