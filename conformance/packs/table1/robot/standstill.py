"""One watch for many requests that must leave a robot at rest.

A request that the robot had to refuse may still move the robot a moment later, so the suite has to watch the robot for
as long as it takes to settle. The suite makes all attempts first, one after another, and then watches once. Only if the
robot moves, the suite repeats each attempt with a watch of its own, to learn which one moves the robot.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from http import HTTPStatus

from conformance.api.rest.interface import RestInterface
from conformance.observe.clock import WALL_CLOCK, Clock, poll
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.robot import GOAL_PATH, STILL, Robot
from conformance.packs.table1.robot.standstill_trace import GOAL, Attempt, Standing, rest
from conformance.packs.table1.robot.stopping import bring_to_rest, halt
from conformance.verdict.evidence import Case


@dataclass(frozen=True)
class _Waiting:
    """An attempt whose effect may still show.

    Attributes:
        attempt: the attempt.
        seconds: within so long an effect would show, s.
        until: when that is, s of the run's clock.
        goal: whether an active goal is an effect as well.
        repeat: makes the attempt again, and returns what was read meanwhile.
    """

    attempt: Attempt
    seconds: float
    until: float
    goal: bool
    repeat: Callable[[], Iterable[Case]]


class Standstill:
    """The attempts that must leave a robot at rest, and the watches after them.

    Args:
        api: the robot's REST interface.
        clock: by which the robot is watched.

    Attributes:
        watched: all watches so far.
    """

    def __init__(self, api: RestInterface, clock: Clock = WALL_CLOCK) -> None:
        self.watched: tuple[Standing, ...] = ()
        self._api, self._clock = api, clock
        self._waiting: list[_Waiting] = []
        # What moved while another check read the robot.
        self._moved: Case | None = None
        self._looked_at = -1

    def begin(self) -> str:
        """Bring the robot to rest before an attempt; return why it is not, or an empty text.

        A robot that is still at rest may yet begin what it was told just before: it gets the time to do so.
        """
        robot = Robot(self._api, self._clock)
        settled = self._api.client.connection.acted_at + robot.settle_s
        halt(self._api)
        self._clock.sleep(settled - self._clock.now())
        return bring_to_rest(self._api)

    def attempted(
        self, requirement: str, after: str, repeat: Callable[[], Iterable[Case]], *, seconds: float, goal: bool = False
    ) -> None:
        """Note an attempt that was made just now.

        Args:
            requirement: id of the requirement that the robot must stay at rest.
            after: the requests, as the end of a sentence "rest after …".
            repeat: makes the attempt again, and returns what was read meanwhile; then the robot is watched.
            seconds: within so long an effect would show, s.
            goal: whether an active goal is an effect as well.
        """
        until = self._clock.now() + seconds
        self._waiting.append(_Waiting(Attempt(requirement, after), seconds, until, goal, repeat))

    @property
    def lasts(self) -> bool:
        """Return whether an effect may still show, and the robot need not be stopped: it is at rest without a goal.

        A command of zero velocity, or a cancel, might end the effect of an attempt before it shows.
        """
        if not self._waiting:
            return False
        robot = Robot(self._api, self._clock)
        none = robot.get(GOAL_PATH).response.status == HTTPStatus.NOT_FOUND
        return none and _stays(Drive(robot)) is not False

    def look(self) -> None:
        """Read the robot once if an effect may still show, and something was sent since; called after each check."""
        sent = self._api.client.connection.sent
        if self._moved is None and self._waiting and sent != self._looked_at and self._clock.now() < self._until:
            self._moved = self._look(Drive(Robot(self._api, self._clock)))
            self._looked_at = self._api.client.connection.sent

    def watch(self) -> None:
        """Watch until the last effect would have shown; if the robot moves, repeat each attempt alone."""
        waiting = self._waiting
        if not waiting:
            return
        try:
            seen = self._moved or self._watch()
        finally:
            self._waiting, self._moved = [], None
        attempts = [one.attempt for one in waiting]
        if not seen.holds:
            for index, one in enumerate(waiting):
                bring_to_rest(self._api)
                alone = tuple(one.repeat())
                if all(case.holds for case in alone):
                    drive = Drive(Robot(self._api, self._clock))
                    alone += (watch_rest(drive, one.attempt.after, one.seconds, goal=one.goal),)
                attempts[index] = replace(one.attempt, alone=alone)
            bring_to_rest(self._api)
        self.watched += (Standing(seen, tuple(attempts)),)

    @property
    def _until(self) -> float:
        """Return when the last effect would have shown, s of the run's clock."""
        return max(one.until for one in self._waiting)

    def _watch(self) -> Case:
        drive = Drive(Robot(self._api, self._clock))
        for _ in poll(self._clock, 0.0, lambda: self._clock.now() > self._until):
            moved = self._look(drive)
            if moved is not None:
                return moved
        return rest("", drive.trace.turns[-1].velocity_exchange, "")

    def _look(self, drive: Drive) -> Case | None:
        """Return readings that show motion or a goal, or None."""
        seen = read_rest(drive, "", goal=any(one.goal for one in self._waiting))
        return None if seen.holds else seen


def glance_rest(robot: Robot, after: str) -> Case:
    """Read the velocity, and where it is not rest, read again whether the robot is at rest."""
    velocity, read = robot.velocity()
    at_rest = velocity is None or robot.near(velocity, STILL)
    return rest(after, read, "") if at_rest else read_rest(Drive(robot), after)


def read_rest(drive: Drive, after: str, *, goal: bool = False) -> Case:
    """Read whether the robot is at rest, and with ``goal`` also whether it has a goal."""
    still, seen = drive.sees(STILL)
    exchange = drive.trace.turns[-1].velocity_exchange
    if still is False:
        return rest(after, exchange, f"the velocity ({seen})")
    active, shown = drive.robot.goal() if goal else (None, exchange)
    return rest(after, shown, "" if active is None else GOAL)


def watch_rest(drive: Drive, after: str, seconds: float, *, goal: bool = False) -> Case:
    """Read for so many seconds whether the robot stays at rest; return the first reading that shows motion or a goal.

    If there is none, return the last reading.
    """
    until = drive.clock.now() + seconds
    while True:
        seen = read_rest(drive, after, goal=goal)
        if not seen.holds or drive.clock.now() > until:
            return seen


def _stays(drive: Drive) -> bool | None:
    return drive.sees(STILL)[0]
