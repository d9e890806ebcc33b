"""State shared by the random walks of a check: they end by a failure, an unreachable robot, or when all is done."""

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import chain, cycle, islice, repeat

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_trace import Trace
from conformance.packs.table1.robot.robot import Robot
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.exchange import NoAnswerError
from conformance.verdict.effort import Effort

_TIME_IS_UP = "the time is up"
_ENOUGH = "all steps that were planned are done"
# Least time until a command is reached, s, and share of a slow robot's settle time.
_COMMAND_S = 0.4
_OF_SETTLE = 0.25
# A pause without any request, s; once in a walk.
_PAUSE_S = 1.5


class Walk:
    """The shared state of all random walks of one check.

    Attributes:
        robot: the robot.
        drive: its velocity commands and readings.
        commands: number of velocities commanded so far, by the signs of their components.
        ended: why no further step is made: a requirement failed, the planned steps are done, the time is up, or the
            robot is busy.
        unreachable: the request without a response that ended the walk, if any.
        left_out: number of steps left out because the time was up.
    """

    def __init__(
        self,
        robot: Robot,
        effort: Effort,
        share: float,
        trace: Trace | None = None,
        preludes: Sequence[Callable[[], object]] = (),
    ) -> None:
        """Plan a walk that takes about ``share`` of the effort's budget: its steps are counted, not timed.

        Two of the ``preludes`` come before each command: they change nothing, and neither do they spoil the command.
        """
        before: list[Callable[[], object]] = [] if effort.slow else list(preludes)
        if before and effort.name != "quick":
            lengths = chain([_PAUSE_S], repeat(0.0))
            before.append(lambda: robot.clock.sleep(next(lengths)))
        self._preludes = cycle(before)
        self.robot = robot
        self.drive = Drive(robot)
        self.commands: Counter[tuple[int, ...]] = Counter()
        self.drive.trace = trace or self.drive.trace
        self.ended = ""
        self.unreachable: NoAnswerError | None = None
        self.left_out = 0
        self._until = robot.clock.now() + share * effort.longest_s
        self._commands_left = max(
            1, round(share * effort.budget_s / max(_COMMAND_S, _OF_SETTLE * robot.limits.settle_s))
        )

    def prelude(self) -> None:
        """Do the next two things that command nothing."""
        for before in islice(self._preludes, 2):
            before()

    def command(self, act: Callable[[], bool]) -> None:
        """Make one step that commands a velocity and waits for it; the planned time decides how many there are."""
        if not self.ended and self._commands_left == 0:
            self.ended = _ENOUGH
        self._commands_left -= not self.ended
        self.step(act)

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
