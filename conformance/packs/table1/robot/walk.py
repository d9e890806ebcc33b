"""State shared by the random walks of a check: they end by a failure, an unreachable robot, or a deadline."""

from collections.abc import Callable

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_trace import Trace
from conformance.packs.table1.robot.robot import Robot
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.exchange import NoAnswerError

_TIME_IS_UP = "the time is up"


class Walk:
    """The shared state of all random walks of one check.

    Attributes:
        robot: the robot.
        drive: its velocity commands and readings.
        ended: why no further step is made: a requirement failed, the time is up, or the robot is busy.
        unreachable: the request without a response that ended the walk, if any.
        left_out: number of steps left out because the time was up.
    """

    def __init__(self, robot: Robot, budget_s: float, trace: Trace | None = None) -> None:
        self.robot = robot
        self.drive = Drive(robot)
        self.drive.trace = trace or self.drive.trace
        self.ended = ""
        self.unreachable: NoAnswerError | None = None
        self.left_out = 0
        self._until = robot.clock.now() + budget_s

    def step(self, act: Callable[[], bool]) -> None:
        """Make one step unless the walk has ended; ``act`` returns whether all was well."""
        if not self.ended and self.robot.clock.now() > self._until:
            self.ended = _TIME_IS_UP
        if self.ended:
            self.left_out += self.ended == _TIME_IS_UP
            return
        try:
            if not act():
                self.ended = "refuted"
        except NoAnswerError as none:
            self.unreachable, self.ended = none, str(none)
        except NotPossibleError as busy:
            self.ended = str(busy)
