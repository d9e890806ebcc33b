"""What the walks of a state machine share: they end by a refutation, an unreachable robot, or the clock."""

import time
from collections.abc import Callable

import pytest

from conformance.robot.drive import Drive
from conformance.robot.robot import Robot
from conformance.transport.exchange import NoAnswerError


class Walk:
    """What all walks of one check share.

    Attributes:
        robot: that walks.
        drive: its velocity.
        ended: why no further step is made: a requirement was refuted, the time is up, the robot is busy.
        unreachable: the request that was not answered, if that ended it.
    """

    def __init__(self, robot: Robot, budget_s: float) -> None:
        self.robot = robot
        self.drive = Drive(robot)
        self.ended = ""
        self.unreachable: NoAnswerError | None = None
        self._until = time.monotonic() + budget_s

    def step(self, act: Callable[[], bool]) -> None:
        """Make one step, unless the walk has ended; ``act`` tells whether all was well."""
        if self.ended:
            return
        if time.monotonic() > self._until:
            self.ended = "the time is up"
            return
        try:
            if not act():
                self.ended = "refuted"
        except NoAnswerError as none:
            self.unreachable, self.ended = none, str(none)
        except pytest.skip.Exception as busy:
            self.ended = str(busy)
