"""Records of concurrent PUTs by several clients and of the robot's state afterwards, for rules to judge."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Final

from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.drive_trace import Command, Turn
from conformance.packs.table1.robot.letting_go import JUDGED, certain_s
from conformance.packs.table1.robot.robot import Velocity, is_near
from conformance.transport.exchange import Exchange

# A velocity within this many tolerances of the one that was put is that one.
_NEAR: Final = 1.5
# Multiple of the settle time after which a velocity has to be reached.
_SETTLED: Final = 1.1


@dataclass(frozen=True)
class GoalRead:
    """A GET of the goal.

    Attributes:
        exchange: the GET's request and response.
        differs: how the goal differs from each goal that was PUT; empty when it equals one of them.
    """

    exchange: Exchange
    differs: str


@dataclass(frozen=True)
class ConcurrentGoal:
    """Several clients' simultaneous PUTs of one new goal.

    Attributes:
        puts: the PUTs that the robot did not answer with 429 or 503.
        read: the goal afterwards; None when it may have ended before it could be read.
        cancelled: the GETs after the goal was cancelled, up to the first that shows the goal again.
    """

    puts: tuple[Exchange, ...]
    read: GoalRead | None
    cancelled: tuple[GoalRead, ...] = ()


@dataclass(frozen=True)
class ConcurrentVelocities:
    """Several clients' simultaneous PUTs of different velocities to a robot at rest.

    Attributes:
        accepted: the velocities that the robot accepted.
        sent, answered: time of the first request and of the last response, s of the run's clock.
        reads: GETs of the velocity, up to the first that shows an accepted velocity or cannot be read.
        last: whether this is the last try: reads that show no accepted velocity then count as a failure.
    """

    accepted: tuple[Command, ...]
    sent: float
    answered: float
    reads: tuple[Turn, ...]
    last: bool

    def read(self, one: Turn) -> ConcurrentVelocities:
        """Return a copy with one more GET of the velocity."""
        return replace(self, reads=(*self.reads, one))

    def settled(self, limits: Limits) -> float:
        """Return the time from which the robot must drive one of the velocities, s of the run's clock."""
        return self.answered + _SETTLED * limits.settle_s

    def ends(self, limits: Limits) -> float:
        """Return the time until which the robot must hold that velocity, s of the run's clock.

        It counts from the first request: the robot may have begun to drive before it answered the others.
        """
        return math.inf if limits.hold_s is None else self.sent + certain_s(limits.hold_s, JUDGED)

    def reached(self, limits: Limits) -> Turn | None:
        """Return the GET that shows an accepted velocity, or None."""
        read = self.reads[-1] if self.reads else None
        if read is None or read.velocity is None:
            return None
        return read if any(is_near(limits, read.velocity, one.velocity, _NEAR) for one in self.accepted) else None

    def missed(self, limits: Limits) -> Turn | None:
        """Return the last GET with a wrong velocity while an accepted one had to be driven, or None.

        A mixture (one client's linear part with another's angular part) counts at once. Any other velocity counts only
        on the last try, since the robot may have been delayed.
        """
        settled, ends = self.settled(limits), self.ends(limits)
        if self.reached(limits) is not None or self.is_unreadable:
            return None
        late = [one for one in self.reads if one.at >= settled and one.received <= ends]
        if not late or not (self.last or self._is_mixture(limits, late[-1].velocity)):
            return None
        return late[-1]

    @property
    def is_unreadable(self) -> bool:
        """Return whether the last GET of the velocity cannot be read; the checkers have judged that response."""
        return bool(self.reads) and self.reads[-1].velocity is None

    def is_decided(self, limits: Limits) -> bool:
        """Return whether the velocities need not be PUT again."""
        shown = self.reached(limits) is not None or self.missed(limits) is not None
        return not self.accepted or self.is_unreadable or shown

    def _is_mixture(self, limits: Limits, measured: Velocity | None) -> bool:
        """Return whether a velocity has the linear part of one client's PUT and the angular part of another's."""
        pairs = itertools.permutations((accepted.velocity for accepted in self.accepted), 2)
        mixtures = (Velocity(*one[:3], *other[3:]) for one, other in pairs)
        return measured is not None and any(is_near(limits, measured, mixture, _NEAR) for mixture in mixtures)
