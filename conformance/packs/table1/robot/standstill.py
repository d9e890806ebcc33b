"""One watch for many actions that must leave a robot at rest.

A request that the robot had to refuse may still move it a moment later, so the suite has to watch the robot for as long
as it takes to settle. The suite does all actions first, one after another, and then watches once. Only if the robot
moves, the suite repeats each action with a watch of its own, to learn which one moves it.
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
class Expectation:
    """That a robot stays at rest after an action.

    Attributes:
        requirement: its id.
        expected: what a finding says, as a noun phrase.
        until: when an effect of the action would have shown, s of the run's clock.
        goal: whether a goal that is active again is a failure as well.
        again: repeats the action, watches, and judges.
    """

    requirement: str
    expected: str
    until: float
    goal: bool
    again: Callable[[], None]


class Standstill:
    """A robot that has to stay at rest.

    Args:
        api: its REST interface.
        clock: by which it is watched.
    """

    def __init__(self, api: RestInterface, clock: Clock = WALL_CLOCK) -> None:
        self._api, self._clock = api, clock
        self._expectations: list[Expectation] = []
        # What moved while another check read the robot.
        self._moved: _Seen | None = None

    def expect(
        self, requirement: str, expected: str, again: Callable[[], None], *, seconds: float, goal: bool = False
    ) -> None:
        """Expect that the robot stays at rest after an action just now.

        The arguments are those of Expectation; an effect would show within so many ``seconds``.
        """
        until = self._clock.now() + seconds
        self._expectations.append(Expectation(requirement, expected, until, goal, again))

    @property
    def lasts(self) -> bool:
        """Whether there is an expectation, and the robot is at rest without a goal, so that it need not be stopped.

        A command of rest, or a cancel, might end the effect of an action before it shows.
        """
        if not self._expectations:
            return False
        robot = Robot(self._api, self._clock)
        none = robot.get(GOAL_PATH).response.status == HTTPStatus.NOT_FOUND
        return none and _stays(Drive(robot)) is not False

    def look(self) -> None:
        """Look once, if an effect might still show: a check that reads the robot meanwhile calls this."""
        if self._moved is None and self._expectations and self._clock.now() < self._until:
            self._moved = self._look(Drive(Robot(self._api, self._clock)))

    def judge(self) -> None:
        """Watch until the last effect would have shown, and judge all expectations."""
        expectations = self._expectations
        if not expectations:
            return
        try:
            seen = self._moved or self._watch()
        finally:
            self._expectations, self._moved = [], None
        judge = self._api.run.judge
        if seen.found:
            before = judge.refuted()
            for one in expectations:
                bring_to_rest(self._api)
                one.again()
            if any(judge.refuted().get(one.requirement, 0) > before.get(one.requirement, 0) for one in expectations):
                return
        # No action moved the robot when it was repeated: any of them may have done so before.
        for one in expectations:
            judge.check(one.requirement, not seen.found, seen.exchange, one.expected, found=seen.found, cause="moves")

    @property
    def _until(self) -> float:
        """When the last effect would have shown, s of the run's clock."""
        return max(one.until for one in self._expectations)

    def _watch(self) -> _Seen:
        drive = Drive(Robot(self._api, self._clock))
        for _ in poll(self._clock, 0.0, lambda: self._clock.now() > self._until):
            moved = self._look(drive)
            if moved is not None:
                return moved
        return _Seen(drive.trace.turns[-1].velocity_exchange, "")

    def _look(self, drive: Drive) -> _Seen | None:
        """Return what moves, or is about to; None where nothing does."""
        if _stays(drive) is False:
            turn = drive.trace.turns[-1]
            return _Seen(turn.velocity_exchange, f"the velocity ({turn.velocity})")
        if any(one.goal for one in self._expectations):
            active, shown = drive.robot.goal()
            if active is not None:
                return _Seen(shown, "an active goal")
        return None


@dataclass(frozen=True)
class _Seen:
    exchange: Exchange
    found: str


def _stays(drive: Drive) -> bool | None:
    return drive.sees(STILL, _OFF)[0]
