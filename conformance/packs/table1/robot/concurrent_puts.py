"""What several clients put at one moment, and what the robot then showed, as values that can be judged without it."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Final

from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.letting_go import JUDGED, certain_s
from conformance.packs.table1.robot.robot import Velocity, is_near
from conformance.transport.exchange import Exchange

# Within so many tolerances a velocity is the one that was put.
_NEAR: Final = 1.5
# Of the settle time: from then on a velocity has to be there.
_SETTLED: Final = 1.1


@dataclass(frozen=True)
class GoalRead:
    """A GET of the goal.

    Attributes:
        exchange: the evidence.
        differs: in what the goal differs from each that was put; empty: it is one of them.
    """

    exchange: Exchange
    differs: str


@dataclass(frozen=True)
class ConcurrentGoal:
    """One new goal that several clients put at one moment.

    Attributes:
        puts: of the clients that the robot had time for.
        read: the goal after that; None: it may have ended before it could be read.
        cancelled: each GET for a while after the goal was cancelled, up to one that shows the goal once more.
    """

    puts: tuple[Exchange, ...]
    read: GoalRead | None
    cancelled: tuple[GoalRead, ...] = ()


@dataclass(frozen=True)
class Accepted:
    """A velocity that was accepted.

    Attributes:
        velocity: the velocity that was put.
        exchange: of the PUT.
    """

    velocity: Velocity
    exchange: Exchange


@dataclass(frozen=True)
class VelocityRead:
    """A GET of the velocity.

    Attributes:
        sent, received: when, s of the run's clock.
        velocity: the measured one; None: it could not be read.
        exchange: the evidence.
    """

    sent: float
    received: float
    velocity: Velocity | None
    exchange: Exchange


@dataclass(frozen=True)
class ConcurrentVelocities:
    """Different velocities that several clients put at one moment to a robot at rest.

    Attributes:
        accepted: those that the robot accepted.
        sent, answered: when the first was sent and the last was answered, s of the run's clock.
        reads: of the velocity, up to one that shows an accepted velocity, or cannot be read.
        last: whether these velocities are not put again if the reads do not show what the robot does.
    """

    accepted: tuple[Accepted, ...]
    sent: float
    answered: float
    reads: tuple[VelocityRead, ...]
    last: bool

    def read(self, one: VelocityRead) -> ConcurrentVelocities:
        """Return this with one more read of the velocity."""
        return replace(self, reads=(*self.reads, one))

    def settled(self, limits: Limits) -> float:
        """Return from when on the robot has to do one of the velocities, s of the run's clock."""
        return self.answered + _SETTLED * limits.settle_s

    def ends(self, limits: Limits) -> float:
        """Return until when that velocity certainly holds, s of the run's clock.

        The robot may have taken it up as soon as the first was sent, however late the others were answered.
        """
        return math.inf if limits.hold_s is None else self.sent + certain_s(limits.hold_s, JUDGED)

    def reached(self, limits: Limits) -> VelocityRead | None:
        """Return the read that shows an accepted velocity, or None."""
        read = self.reads[-1] if self.reads else None
        if read is None or read.velocity is None:
            return None
        return read if any(is_near(limits, read.velocity, one.velocity, _NEAR) for one in self.accepted) else None

    def missed(self, limits: Limits) -> VelocityRead | None:
        """Return the last read that shows another velocity while an accepted one had to be there, or None.

        The linear part of one client with the angular part of another counts at once. Another velocity counts only on
        the last try: the robot may have been held up.
        """
        settled, ends = self.settled(limits), self.ends(limits)
        if self.reached(limits) is not None or self.is_unreadable:
            return None
        late = [one for one in self.reads if one.sent >= settled and one.received <= ends]
        if not late or not (self.last or self._is_mixture(limits, late[-1].velocity)):
            return None
        return late[-1]

    @property
    def is_unreadable(self) -> bool:
        """Whether the velocity could not be read in the end, which the observers have judged."""
        return bool(self.reads) and self.reads[-1].velocity is None

    def is_decided(self, limits: Limits) -> bool:
        """Return whether there is nothing to put again."""
        shown = self.reached(limits) is not None or self.missed(limits) is not None
        return not self.accepted or self.is_unreadable or shown

    def _is_mixture(self, limits: Limits, measured: Velocity | None) -> bool:
        """Return whether a velocity has the linear part of one client, and the angular part of another."""
        pairs = itertools.permutations((accepted.velocity for accepted in self.accepted), 2)
        mixtures = (Velocity(*one[:3], *other[3:]) for one, other in pairs)
        return measured is not None and any(is_near(limits, measured, mixture, _NEAR) for mixture in mixtures)
