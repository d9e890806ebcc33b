"""Judge a velocity that is not renewed: it must hold for its time, then begin to stop, and end in rest.

Functions here judge a record and send nothing.
"""

import itertools
from dataclasses import dataclass
from typing import Final, Literal

from conformance.measures.samples import FARTHEST, SEVERAL
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot import windows
from conformance.packs.table1.robot.drive_trace import Turn
from conformance.packs.table1.robot.geometry import wrapped
from conformance.packs.table1.robot.robot import STILL, Velocity, is_near

# A velocity that still holds may be off by this many tolerances.
_OFF: Final = 1.5
# Rounds that are looked at: more than the window of several samples has.
_LOOKED_AT: Final = 60
# Shortest time that a velocity holds, s.
_AT_LEAST_S: Final = 0.1
# Hold time that is assumed where none is declared, s.
COUNTED_ON_S: Final = 0.5
# Share of the hold time in which a velocity must hold. Code that still has to send something uses the smaller share.
JUDGED: Final = 0.95
_COUNTED_ON: Final = 0.9
_LATE_S: Final = 0.02
_ROUNDING_S: Final = 1e-6
# A pose of a robot at rest may be off by this much, m and rad.
_PLACE_M: Final = 0.05
_HEADING_RAD: Final = 0.1
# Readings farther apart than this share of the hold time show nothing of it.
_GAP: Final = 0.25
# Without a declared hold time, a velocity has to end within this time, s.
_ENDS_S: Final = 10.0
#: How a velocity is commanded last: by both parts, by a PUT of the linear part, by both as XML, or on a connection that
#: is then closed.
Way = Literal["velocity", "linear", "xml", "closing"]


def certain_s(hold_s: float | None, share: float = _COUNTED_ON) -> float:
    """Return how long after its command a velocity certainly holds, s; ``share``: counted share of the hold time."""
    return COUNTED_ON_S if hold_s is None else share * hold_s - _LATE_S


def ends_by(limits: Limits, settle_s: float) -> float:
    """Return how long after its command a velocity must have ended, s; ``settle_s``: time the robot has to stop."""
    return _ENDS_S if limits.hold_s is None else 1.1 * limits.hold_s + settle_s


@dataclass(frozen=True)
class LetGo:
    """A velocity that was commanded and not renewed, and the readings after it.

    Attributes:
        velocity: the velocity.
        full: when the last command of all components was sent, s of the run's clock.
        answered: when its response arrived.
        turns: the readings since.
        resumed: the first reading after a pause without requests; None: there was no pause.
        due: when the pause was to end, s of the run's clock; None: there was no pause.
        by: what the last command was.
    """

    velocity: Velocity
    full: float
    answered: float
    turns: tuple[Turn, ...]
    resumed: int | None = None
    due: float | None = None
    by: Way = "velocity"

    @property
    def command(self) -> str:
        """Return what commanded the velocity, as a noun phrase."""
        return {
            "velocity": "a PUT of the velocity",
            "linear": "a PUT of its linear part",
            "xml": "a PUT of the velocity as XML",
            "closing": "a PUT of the velocity whose connection was closed",
        }[self.by]

    def holds_by(self, limits: Limits, count: int) -> bool | None:
        """Return whether the first ``count`` readings end with the velocity; None if they are too few."""
        begin = max(0, count - _LOOKED_AT)
        if self.resumed is not None and count > self.resumed:
            # Samples from before the silence say nothing of what is behind it.
            begin = max(begin, self.resumed)
        return windows.verdict(limits, self.turns[begin:count], self.velocity, _OFF)

    def was_held(self, limits: Limits) -> bool:
        """Return whether a reading showed the velocity within its hold time; slow responses may come too late."""
        certain = self.full + certain_s(limits.hold_s or 0.0, JUDGED)
        in_time = sum(turn.at <= certain for turn in self.turns)
        return any(self.holds_by(limits, count) for count in range(1, in_time + 1))

    def rested_alone(self, limits: Limits) -> bool:
        """Return whether the first reading after the pause shows the robot at rest, or there was no pause."""
        if self.resumed is None:
            return True
        return bool(windows.shown(limits, self.turns[self.resumed : self.resumed + 1], STILL, count=1))

    def _rested(self, limits: Limits) -> tuple[Turn, Turn] | None:
        """Return the first two readings after a pause at whose end no robot moves, if the odometry of both rests.

        A robot may smooth its velocity, and thus move on in its readings after a shorter pause.
        """
        if self.resumed is None or self.due is None or self.due < self.answered + self.longest(limits) - _ROUNDING_S:
            return None
        two = self.turns[self.resumed : self.resumed + 2]
        rested = all(one.odometry is not None and is_near(limits, one.odometry.velocity, STILL) for one in two)
        return (two[0], two[1]) if rested and len(two) > 1 else None

    def stale_velocity(self, limits: Limits) -> Turn | None:
        """Return the first reading after a long pause if its velocity is not the one of the odometry around it."""
        first, _ = self._rested(limits) or (None, None)
        if first is None or first.velocity is None or is_near(limits, first.velocity, STILL, _OFF):
            return None
        return first

    def stale_pose(self, limits: Limits) -> Turn | None:
        """Return the first reading after a long pause if its pose does not follow from the motion."""
        first, later = self._rested(limits) or (None, None)
        if first is None or later is None or first.odometry is None or later.odometry is None:
            return None
        one, two, noise = first.odometry.pose, later.odometry.pose, limits.noise
        near = one.distance(two) <= _PLACE_M + FARTHEST * noise.position_m
        turned = abs(wrapped(one.yaw - two.yaw)) > _HEADING_RAD + FARTHEST * noise.heading_rad
        return None if near and not turned else first

    def is_stale(self, limits: Limits) -> bool:
        """Return whether the first reading after a long pause is not as the robot is."""
        return bool(self.stale_velocity(limits) or self.stale_pose(limits))

    def rests(self, limits: Limits) -> bool:
        """Return whether the newest samples show the robot at rest."""
        return bool(windows.shown(limits, self.turns[-_LOOKED_AT:], STILL))

    def is_decided(self, limits: Limits, ends: float) -> bool:
        """Return whether the robot rests, or several samples from after ``ends`` (s of the run's clock) can tell."""
        samples = windows.newest([turn for turn in self.turns if turn.at > ends])
        lasts = self.turns[-1].at > ends + SEVERAL * windows.LONGEST_SAMPLE_S
        return self.rests(limits) or lasts or len(samples) >= SEVERAL

    def early(self, limits: Limits) -> Turn | None:
        """Return the first reading in which the velocity ended before its hold time, or None.

        Without a declared hold time the velocity must hold only for a moment.
        """
        hold_s = limits.hold_s
        certain = self.answered + _AT_LEAST_S if hold_s is None else self.full + certain_s(hold_s, JUDGED)
        for count, turn in enumerate(self.turns, 1):
            if turn.received > certain:
                return None
            if self.holds_by(limits, count) is False:
                return turn
        return None

    def late(self, limits: Limits) -> Turn | None:
        """Return the first reading in which the velocity still held after it had to end, or None."""
        if limits.hold_s is None:
            return None
        last, stale = self.answered + self.longest(limits), self.stale_velocity(limits)
        for count, turn in enumerate(self.turns, 1):
            if turn.at > last and turn is not stale and self.holds_by(limits, count):
                return turn
        return None

    def longest(self, limits: Limits) -> float:
        """Return how long after the command the velocity may be seen, s.

        Commands and odometry are delayed by part of the settle time; half as long again is no such delay.
        """
        hold = limits.hold_s or 0.0
        samples = windows.newest(self.turns[: self.resumed], len(self.turns))
        lasted = samples[-1].at - samples[0].at if samples else 0.0
        period = min(lasted / max(1, len(samples) - 1), windows.LONGEST_SAMPLE_S)
        return hold + max(0.4 * hold, 0.5 * limits.settle_s, windows.LONGEST_SAMPLE_S) + 2 * period

    def is_spoilt(self, limits: Limits) -> bool:
        """Return whether the velocity seemed to hold too short or too long, and the readings do not prove it."""
        return self.is_void(limits) and bool(self.early(limits) or self.late(limits))

    def is_void(self, limits: Limits) -> bool:
        """Return whether a response, or the suite, was so slow that the readings prove nothing about the hold time."""
        gap = _GAP * (limits.hold_s or 0.0)
        before, behind = self.turns[: self.resumed], self.turns[len(self.turns[: self.resumed]) :]
        times = [self.full, self.answered, *(turn.at for turn in before)]
        seen = (times, [*([] if self.due is None else [self.due]), *(turn.at for turn in behind)])
        return any(two - one > gap for part in seen for one, two in itertools.pairwise(part))
