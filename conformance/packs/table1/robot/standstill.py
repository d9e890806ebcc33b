"""One watch for many attempts that must leave a robot at rest.

What a robot was not to take may still move it a moment later, so whoever tried it has to look for as long as the robot
takes to settle. The looks are alike, whatever was tried: so all is tried first, one thing after another, and one watch
follows. Only where the robot does move is each thing tried again by itself, with a watch of its own, to learn which.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus

from conformance.api.rest.interface import RestInterface
from conformance.observe.clock import WALL_CLOCK, Clock
from conformance.observe.polling import poll
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.robot import GOAL_PATH, STILL, Robot
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.transport.exchange import Exchange

# Of the tolerance: by so much a robot at rest may be off.
_OFF = 2


@dataclass(frozen=True)
class Tried:
    """What was tried on a robot at rest.

    Attributes:
        requirement: that it stays there.
        expected: in words.
        until: how long it may take to show, s of the monotonic clock.
        goal: whether a goal that is current again is a failure as well.
        again: tries it once more, watches, and judges.
    """

    requirement: str
    expected: str
    until: float
    goal: bool
    again: Callable[[], None]


class Standstill:
    """A robot that has to stay at rest, whatever is tried.

    Args:
        api: its REST interface.
        clock: by which it is watched.
    """

    def __init__(self, api: RestInterface, clock: Clock = WALL_CLOCK) -> None:
        self._api, self._clock = api, clock
        self._tried: list[Tried] = []
        # What moved while something else was read.
        self._moved: _Seen | None = None

    def tried(
        self, requirement: str, expected: str, again: Callable[[], None], *, seconds: float, goal: bool = False
    ) -> None:
        """Take down that something was tried just now; see Tried. It shows within so many ``seconds`` if at all."""
        self._tried.append(Tried(requirement, expected, self._clock.now() + seconds, goal, again))

    @property
    def lasts(self) -> bool:
        """Whether something was tried, and the robot is at rest and has no goal: nothing need be done to stop it.

        To command rest, or to cancel, might end what was tried before it shows.
        """
        if not self._tried:
            return False
        robot = Robot(self._api, self._clock)
        none = robot.get(GOAL_PATH).response.status == HTTPStatus.NOT_FOUND
        return none and _stays(Drive(robot)) is not False

    def look(self) -> None:
        """Look once, where something was tried that might still show: for whoever has the robot to read meanwhile."""
        if self._moved is None and self._tried and self._clock.now() < self._until:
            self._moved = self._look(Drive(Robot(self._api, self._clock)))

    def judge(self) -> None:
        """Watch until the last of what was tried would have shown, and judge all of it."""
        tried = self._tried
        if not tried:
            return
        try:
            seen = self._moved or self._watch()
        finally:
            self._tried, self._moved = [], None
        judge = self._api.run.judge
        if seen.found:
            before = judge.refuted()
            for one in tried:
                bring_to_rest(self._api)
                one.again()
            if any(judge.refuted().get(one.requirement, 0) > before.get(one.requirement, 0) for one in tried):
                return
        # What moved the robot once, and not when it was tried again, is not known: any of it.
        for one in tried:
            judge.check(one.requirement, not seen.found, seen.exchange, one.expected, found=seen.found, cause="moves")

    @property
    def _until(self) -> float:
        """When the last of what was tried would have shown, s of the monotonic clock."""
        return max(one.until for one in self._tried)

    def _watch(self) -> _Seen:
        drive = Drive(Robot(self._api, self._clock))
        for _ in poll(self._clock, 0.0, lambda: self._clock.now() > self._until):
            moved = self._look(drive)
            if moved is not None:
                return moved
        return _Seen(drive.trace.turns[-1].velocity_exchange, "")

    def _look(self, drive: Drive) -> _Seen | None:
        """What moves, or is about to; None where nothing does."""
        if _stays(drive) is False:
            turn = drive.trace.turns[-1]
            return _Seen(turn.velocity_exchange, f"velocity {turn.velocity}")
        if any(one.goal for one in self._tried):
            active, shown = drive.robot.goal()
            if active is not None:
                return _Seen(shown, "a goal is active again")
        return None


@dataclass(frozen=True)
class _Seen:
    exchange: Exchange
    found: str


def _stays(drive: Drive) -> bool | None:
    return drive.sees(STILL, _OFF)[0]
