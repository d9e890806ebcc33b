"""What the walks of a state machine share: they end by a refutation, an unreachable robot, or the clock."""

from collections.abc import Callable

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_trace import Trace
from conformance.packs.table1.robot.robot import Robot
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.exchange import NoAnswerError

_TIME_IS_UP = "the time is up"


class Walk:
    """What all walks of one check share.

    Attributes:
        robot: that walks.
        drive: its velocity.
        ended: why no further step is made: a requirement was refuted, the time is up, the robot is busy.
        unreachable: the request that was not answered, if that ended it.
        left_out: how many steps were not made because the time was up.
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
        """Make one step, unless the walk has ended; ``act`` tells whether all was well."""
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
