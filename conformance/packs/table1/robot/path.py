"""Judge whether the pose follows the velocity: integrate the velocity and compare it with the pose.

The first and last reading may each be wrong. Therefore the readings are cut into overlapping windows of a quarter of
the way, and the median window counts, extrapolated to the whole way. A jump of the localisation is in fewer than half
of the windows, and a slow link makes windows coarse; a real fault, such as a wrong unit, is in most windows and in the
whole. Where the odometry itself was delayed, the robot's motion in between is unknown, and that step is left out.
"""

from __future__ import annotations

import itertools
import math
import operator
from bisect import bisect_left
from collections.abc import Callable, Sequence
from statistics import median
from typing import Final, NamedTuple

from conformance.packs.table1.limits import Noise
from conformance.packs.table1.robot.geometry import wrapped
from conformance.packs.table1.robot.robot import Odometry, Velocity
from conformance.verdict.evidence import Case

# _SHORTEST: shortest drive that is judged, m. _LEAST_TURN: smallest turn, rad.
_SHORTEST: Final = 0.08
_LEAST_TURN: Final = 0.2
# Fewest readings to sum: one step says nothing.
_FEWEST: Final = 3
# Difference allowed between the summed velocity and the distance: _SHARE of it, plus _OFF m; below, rad.
_SHARE: Final = 0.1
_OFF: Final = 0.03
_OFF_TURN: Final = 0.06
# A robot drives in a direction if it has at least this share of its greatest speed.
_MOVES: Final = 0.25
# Between readings farther apart than this, s, a velocity may have ended and begun again: its sum is a guess.
_FINE_S: Final = 0.25
# _WINDOW: share of the way in one window. _NOISES: noise at its ends, as a multiple for the whole way.
_WINDOW: Final = 0.25
_NOISES: Final = 8.0
# The velocity is unknown in a gap between readings longer than _HELD_UP_S and _HELD_UP_TIMES the usual gap.
_HELD_UP_S: Final = 0.5
_HELD_UP_TIMES: Final = 3.0
# The same for gaps between stamps of odometry samples, s: odometry comes at least five times a second.
_SKIPPED_S: Final = 0.15


class _Sum(NamedTuple):
    """The velocity's integral by one clock, up to one reading.

    Attributes:
        x, y: integrated position in the odometry frame, m; turn: integrated change of heading, rad.
        length, turned: the integrals of the absolute speeds.
        off, off_turn: bound of the integration error, as the velocity changes between two samples.
        x_error, y_error, turn_error: measured minus integrated, summed step by step, so that whole turns do not matter.
        along_error, turned_error: the same in the direction of motion, so that driving ahead and back (or turning left
            and
            right) does not cancel an error of scale. Only readings close together count.
    """

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0
    length: float = 0.0
    turned: float = 0.0
    off: float = 0.0
    off_turn: float = 0.0
    x_error: float = 0.0
    y_error: float = 0.0
    turn_error: float = 0.0
    along_error: float = 0.0
    turned_error: float = 0.0

    def miss(self, earlier: _Sum) -> _Miss:
        """Return how far pose and heading are from the integral since an earlier reading."""
        way = math.hypot(self.x_error - earlier.x_error, self.y_error - earlier.y_error)
        way = max(way, abs(self.along_error - earlier.along_error))
        turn = max(abs(self.turn_error - earlier.turn_error), abs(self.turned_error - earlier.turned_error))
        # A heading that is not a number matches no heading.
        return _Miss(way, math.inf if math.isnan(turn) else turn)


class _Miss(NamedTuple):
    """The distance between measured and integrated pose, m, and heading, rad."""

    way: float
    turn: float


class _Sums(NamedTuple):
    """The integrals up to each reading, and the poses that were read."""

    trace: Sequence[Odometry]
    each: Sequence[_Sum]

    def middle_miss(self, course: Sequence[float], part: Callable[[_Miss], float]) -> float:
        """Return the median window's miss, extrapolated to the whole course.

        A window is weighted with the distance between its first reading and the next one, so that many readings of a
        resting robot do not outweigh those of a moving one.

        Args:
            course: length or turn integrated up to each reading.
            part: selects the part of a miss that counts.
        """
        wanted = _WINDOW * course[-1]
        found: list[tuple[float, float]] = []
        for first, (begun, then) in enumerate(itertools.pairwise(course)):
            last = bisect_left(course, begun + wanted)
            if last == len(course):
                break
            times = course[-1] / (course[last] - begun)
            found.append((times * part(self.each[last].miss(self.each[first])), then - begun))
        found.sort()
        half = sum(weight for _, weight in found) / 2
        passed = itertools.accumulate(weight for _, weight in found)
        return next((miss for (miss, _), weight in zip(found, passed, strict=True) if weight >= half), 0.0)

    @property
    def whole_miss(self) -> _Miss:
        """Return the distance between measured and integrated pose and heading over all readings."""
        return self.each[-1].miss(self.each[0])


def _sum_steps(trace: Sequence[Odometry], velocities: Sequence[Velocity], *, by_stamp: bool) -> _Sums:
    steps = [_Sum()]
    skipped = _longest_lapse(trace)
    linear, angular = (max(abs(velocity[part]) for velocity in velocities) for part in (0, 5))
    for (one, first), (two, last) in itertools.pairwise(zip(trace, velocities, strict=True)):
        if two.stamp - one.stamp > skipped:
            steps.append(_Sum())
            continue
        lapse = two.stamp - one.stamp if by_stamp else (two.sent + two.received - one.sent - one.received) / 2
        turn = (first.angular_z + last.angular_z) / 2 * lapse
        heading = one.pose.yaw + turn / 2
        ahead, aside = (first.linear_x + last.linear_x) / 2 * lapse, (first.linear_y + last.linear_y) / 2 * lapse
        made = two.pose.yaw - one.pose.yaw - turn
        x = ahead * math.cos(heading) - aside * math.sin(heading)
        y = ahead * math.sin(heading) + aside * math.cos(heading)
        x_error, y_error = two.pose.x - one.pose.x - x, two.pose.y - one.pose.y - y
        along = x_error * math.cos(heading) + y_error * math.sin(heading)
        turn_error = wrapped(made) if math.isfinite(made) else math.inf
        fine = two.sent - one.sent <= _FINE_S
        steps.append(
            _Sum(
                x=x,
                y=y,
                turn=turn,
                length=math.hypot(ahead, aside),
                turned=abs(turn),
                off=math.hypot(last.linear_x - first.linear_x, last.linear_y - first.linear_y) * abs(lapse) / 2,
                off_turn=abs(last.angular_z - first.angular_z) * abs(lapse) / 2,
                x_error=x_error,
                y_error=y_error,
                turn_error=turn_error,
                along_error=_along_motion(along, first.linear_x, linear) if fine else 0.0,
                turned_error=_along_motion(turn_error, first.angular_z, angular) if fine else 0.0,
            )
        )
    return _Sums(trace, list(itertools.accumulate(steps, lambda total, step: _Sum(*map(operator.add, total, step)))))


def _along_motion(error: float, speed: float, fastest: float) -> float:
    """Return an error in the direction of motion; 0 at low speed, where the direction may be noise."""
    return math.copysign(error, error * speed) if error and abs(speed) > _MOVES * fastest else 0.0


def _longest_lapse(trace: Sequence[Odometry]) -> float:
    """Return the longest time between two stamps that counts as undelayed odometry, s.

    By the lower quartile: on a machine with too much to do, most of a robot's samples are delayed.
    """
    lapses = sorted(two.stamp - one.stamp for one, two in itertools.pairwise(trace) if two.stamp != one.stamp)
    return max(_SKIPPED_S, _HELD_UP_TIMES * lapses[len(lapses) // 4]) if lapses else _SKIPPED_S


def way_and_turn(
    trace: Sequence[Odometry], measured: Sequence[Velocity], noise: Noise
) -> tuple[Case | None, Case | None]:
    """Judge whether position and heading moved by the integral of the velocity, in one case each.

    Return None in place of a case where the robot did not drive, or turn, far enough to judge.

    Either clock may fit, the robot's stamps or the local time of the readings, as simulations may run slower than real
    time. Either velocity may fit, the odometry's own or the one read beside it: another requirement compares these two.

    Args:
        trace: odometry readings in order.
        measured: the velocity read with each of them.
        noise: noise of the robot's odometry.
    """
    if len(trace) < _FEWEST:
        return None, None
    unbroken = _longest_unbroken(trace)
    trace, measured = trace[unbroken], measured[unbroken]
    if len(trace) < _FEWEST:
        return None, None
    sources = ([odometry.velocity for odometry in trace], measured)
    sums = [_sum_steps(trace, source, by_stamp=by_stamp) for source in sources for by_stamp in (True, False)]
    way = _way([one for one in sums if one.each[-1].length >= _SHORTEST], noise)
    return way, _turn([one for one in sums if one.each[-1].turned >= _LEAST_TURN], noise)


def _longest_unbroken(trace: Sequence[Odometry]) -> slice:
    """Return the longest run of readings without a delay of the odometry."""
    steps = [two.sent - one.sent for one, two in itertools.pairwise(trace)]
    most = max(_HELD_UP_S, _HELD_UP_TIMES * median(steps))
    ends = [0, *(index for index, step in enumerate(steps, 1) if step > most), len(trace)]
    return max((slice(one, two) for one, two in itertools.pairwise(ends)), key=lambda part: part.stop - part.start)


def _agrees(
    sums: Sequence[_Sums],
    course: Callable[[_Sum], float],
    part: Callable[[_Miss], float],
    room: Callable[[_Sum], float],
) -> bool:
    """Return whether by one clock the median window or the whole course misses by no more than it may."""
    return any(
        min(one.middle_miss([course(each) for each in one.each], part), part(one.whole_miss)) <= room(one.each[-1])
        for one in sums
    )


def _way(sums: Sequence[_Sums], noise: Noise) -> Case | None:
    if not sums:
        return None

    def room(whole: _Sum) -> float:
        return _SHARE * whole.length + _OFF + whole.off + _NOISES * noise.position_m

    (first, *_, last), whole = sums[0].trace, sums[0].each[-1]
    return Case(
        _agrees(sums, operator.attrgetter("length"), operator.attrgetter("way"), room),
        last.exchange,
        f"a displacement of ({whole.x:.3f}, {whole.y:.3f}) m, which is what the velocity adds up to",
        observed=f"the pose moved by ({last.pose.x - first.pose.x:.3f}, {last.pose.y - first.pose.y:.3f}) m",
        cause="another way",
    )


def _turn(sums: Sequence[_Sums], noise: Noise) -> Case | None:
    if not sums:
        return None

    def room(whole: _Sum) -> float:
        return _SHARE * whole.turned + _OFF_TURN + whole.off_turn + _NOISES * noise.heading_rad

    whole = sums[0].each[-1]
    return Case(
        _agrees(sums, operator.attrgetter("turned"), operator.attrgetter("turn"), room),
        sums[0].trace[-1].exchange,
        f"a turn of {whole.turn:.3f} rad, which is what the angular velocity adds up to",
        observed=f"the heading turned by {whole.turn + whole.turn_error:.3f} rad",
        cause="another turn",
    )
