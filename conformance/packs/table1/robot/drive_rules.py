"""Records of scenarios that drive a robot, and what judges them. No function here sends anything to the robot.

The velocity is integrated and compared with the pose. The first and last reading may each be wrong. Therefore the
readings are cut into overlapping windows of a quarter of the way, and the median window counts, extrapolated to the
whole way. A jump of the localisation is in fewer than half of the windows, and a slow link makes windows coarse; a real
fault, such as a wrong unit, is in most windows and in the whole. Where the odometry itself was delayed, the robot's
motion in between is unknown, and that step is left out.
"""

from __future__ import annotations

import itertools
import math
import operator
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from statistics import median
from typing import Any, Final, NamedTuple

from conformance.measures.samples import SEVERAL
from conformance.packs.table1.limits import Limits, Noise
from conformance.packs.table1.robot.drive_trace import (
    LONGEST_SAMPLE_S,
    Command,
    Reach,
    Trace,
    Turn,
    is_shown,
    middle,
    newest,
    velocities,
)
from conformance.packs.table1.robot.geometry import wrapped
from conformance.packs.table1.robot.message_shapes import TWIST, VECTOR3, read_as
from conformance.packs.table1.robot.robot import Odometry, Velocity, is_near
from conformance.packs.table1.statement import said_of
from conformance.scenarios.motion.trace import Drive
from conformance.scenarios.rule import NotTested, Outcome, Rule, rule
from conformance.scenarios.scenario import Scenario
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run

_SHORTEST: Final = 0.08  # shortest drive that is judged, m
_LEAST_TURN: Final = 0.2  # smallest turn that is judged, rad
# Fewest readings to sum: one step says nothing.
_FEWEST: Final = 3
# Allowed difference between the summed velocity and the distance: _SHARE of it, plus _OFF, m, or _OFF_TURN, rad.
_SHARE: Final = 0.1
_OFF: Final = 0.03
_OFF_TURN: Final = 0.06
# A robot drives in a direction if it has at least this share of its greatest speed.
_MOVES: Final = 0.25
# Between readings farther apart than this, s, a velocity may have ended and begun again: its sum is a guess.
_FINE_S: Final = 0.25
_WINDOW: Final = 0.25  # share of the way that each window covers
_NOISES: Final = 8.0  # factor on the position's noise in the tolerance for a whole way
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
        f"a displacement of ({whole.x:.3f}, {whole.y:.3f}) m, the sum of the velocity over time",
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
        f"a turn of {whole.turn:.3f} rad, the sum of the angular velocity over time",
        observed=f"the heading turned by {whole.turn + whole.turn_error:.3f} rad",
        cause="another turn",
    )


# Readings that agree for this long are steady, so that two resources can be compared, s.
_STEADY_S: Final = 0.3
# Consecutive readings that must be wrong while the velocity changes: fewer may come from sampling.
_IN_A_ROW: Final = 5
# Rounds of readings to judge: more than any window has.
_LOOKED_AT: Final = 200
#: Texts of the same double differ by less than this, whatever tolerance is declared.
ECHO: Final = 1e-9
_OUTLASTED: Final = NotTested("a response takes so long that a velocity ends before it is read")
_RESOURCES: Final = "rest-resources"
_AGREEMENT: Final = (f"{_RESOURCES}/velocity-odometry", f"{_RESOURCES}/linear-agrees")
_LIMITS_HOLD: Final = "safety/limits-hold"
_WAY: Final = (f"{_RESOURCES}/pose-motion", f"{_RESOURCES}/pose-rotation")


def outcomes(requirement: str, trace: Trace, limits: Limits) -> Iterator[Outcome]:
    """Yield the outcomes of a trace for one requirement."""
    readings, way = requirement in {*_AGREEMENT, _LIMITS_HOLD}, requirement in _WAY
    shown = every_outcome(trace, limits, way=way, readings=readings)
    return (one for id_, one in shown if id_ == requirement)


def every_outcome(trace: Trace, limits: Limits, *, way: bool, readings: bool = True) -> Iterator[tuple[str, Outcome]]:
    """Yield all outcomes of a trace, each with the id of its requirement.

    Args:
        trace: the trace of the drive.
        limits: the robot's limits.
        way: whether the pose must follow the velocity.
        readings: whether to include the outcomes of single readings, of which there are hundreds.
    """
    yield from ((_put_requirement(command), answer_of(command)) for command in trace.commands if not command.renewal)
    if readings:
        yield from _readings(trace, limits)
    for reach in trace.reaches:
        for id_ in reach.shows:
            yield id_, _OUTLASTED if reach.outlasted else arrival(trace, reach, limits)
    yield from trace.sightings
    if way:
        yield from _ways(trace, limits)


def _readings(trace: Trace, limits: Limits) -> Iterator[tuple[str, Outcome]]:
    """Yield the outcomes of each reading, compared with the readings before it."""
    for turns in range(1, len(trace.turns) + 1):
        seen = trace.upto(turns)
        yield from agreement(seen, limits)
        if not (limits.linear_declared and limits.angular_declared):
            fastest = speed(seen)
            if fastest is not None:
                yield _LIMITS_HOLD, fastest
    yield from ((_AGREEMENT[1], case) for case in _in_between(trace, limits))


def _in_between(trace: Trace, limits: Limits) -> Iterator[Case]:
    """Judge whether the linear velocity changes with the velocity: each between the velocities before and after it.

    It may be ahead or behind by as much as the velocity changes from one look to the next, as one of them may come from
    a newer sample. Only several in a row that are farther off are a difference.
    """
    off = 0
    for turn, later in itertools.pairwise(trace.turns):
        before, after = turn.velocity, later.velocity
        if before is None or after is None or turn.linear is None or before[:3] == after[:3]:
            continue
        apart = [abs(one - other) for one, other in zip(before[:3], after[:3], strict=True)]
        least, greatest = (
            [end(one, other) + way * step for one, other, step in zip(before[:3], after[:3], apart, strict=True)]
            for end, way in ((min, -1), (max, 1))
        )
        nearest = Velocity(*map(max, least, map(min, greatest, turn.linear[:3])))
        off = 0 if is_near(limits, turn.linear, nearest) else off + 1
        if off == _IN_A_ROW:
            expected = f"a linear part between {rounded(before)} and {rounded(after)}, the velocities around it"
            found, cause = str(turn.linear), "does not change with the velocity"
            yield Case(holds=False, exchange=turn.linear_exchange, expected=expected, observed=found, cause=cause)
            return


def _ways(trace: Trace, limits: Limits) -> Iterator[tuple[str, Outcome]]:
    """Yield whether the pose followed the velocity, over each stretch of the drive."""
    for id_, case in zip(_WAY, way_and_turn(trace.odometry, trace.measured, limits.noise), strict=True):
        if trace.outlasted:
            yield id_, _OUTLASTED
        elif case is not None:
            yield id_, case


def _put_requirement(command: Command) -> str:
    """Return the id of the requirement on the response to a velocity command."""
    name = "linear-put" if command.linear_only else "velocity-integers" if command.integers else "velocity-put"
    return f"{_RESOURCES}/{name}"


def answer_of(command: Command) -> Case:
    """Judge the response to a velocity command: it must be 204, or 200 with the accepted velocity."""
    answer = command.exchange.response
    kind, shape = ("Vector3", VECTOR3) if command.linear_only else ("Twist", TWIST)
    problem = "" if answer.status in {HTTPStatus.OK, HTTPStatus.NO_CONTENT} else command.exchange.came
    if answer.status == HTTPStatus.OK:
        value, problem = read_as(answer, shape)
        problem = problem or _other_number(command, value)
    return Case(not problem, command.exchange, f"200 with the accepted {kind}, or 204", problem)


def _other_number(command: Command, value: Any) -> str:
    """Return the first component that the response shows with another number than was PUT; empty if none."""
    given = {"linear": value} if command.linear_only else value
    for part, put in command.velocity.twist.items():
        for axis, number in put.items() if part in given else ():
            accepted = given[part][axis]
            if abs(float(accepted) - number) > ECHO:
                return f"{part} {axis} {accepted} for {number}"
    return ""


def agreement(trace: Trace, limits: Limits) -> Iterator[tuple[str, Case]]:
    """Judge whether velocity and linear velocity agree with the odometry, by their medians while each was steady.

    Only readings without a command in between count. The window is long enough for several looks, also where responses
    are slow. A robot that moves by itself may do so between two reads: its readings are then not steady.
    """
    odometry = trace.turns[-SEVERAL].odometry if len(trace.turns) >= SEVERAL else None
    if odometry is None:
        return
    since = min(trace.turns[-1].at - _STEADY_S, odometry.sent)
    window = list(itertools.takewhile(lambda turn: turn.at >= since, reversed(trace.turns)))
    steady = [turn.odometry.velocity for turn in window if turn.odometry is not None]
    count = len(newest(window[::-1], len(window)))
    lasted = len(trace.turns) > len(window) or since == odometry.sent
    if trace.last_sent_s > since or not lasted or count < SEVERAL or len(steady) < len(window):
        return
    wanted = middle(steady)
    if not _is_steady(limits, steady):
        return
    turn = window[0]
    read = velocities(window)
    if _is_steady(limits, read):
        expected = f"the velocity that the odometry has, {rounded(wanted)}"
        yield _AGREEMENT[0], _same(read, wanted, (limits, count), turn.velocity_exchange, expected)
    linear = [one.linear for one in window if one.linear is not None]
    if linear and _is_steady(limits, read):
        wanted = Velocity(*middle(read)[:3])
        expected = f"the linear part of the velocity, {rounded(wanted)}"
        yield _AGREEMENT[1], _same(linear, wanted, (limits, count), turn.linear_exchange, expected)


def _is_steady(limits: Limits, readings: Sequence[Velocity]) -> bool:
    """Return whether there are readings and all of them are near their median."""
    return bool(readings) and all(is_near(limits, velocity, middle(readings), 0.5) for velocity in readings)


def _same(
    readings: Sequence[Velocity], wanted: Velocity, by: tuple[Limits, int], exchange: Exchange | None, expected: str
) -> Case:
    limits, samples = by
    measured = middle(readings)
    # Both medians have their own noise, a quarter more than a mean has.
    holds = is_near(limits, measured, wanted, samples=samples / math.pi)
    return Case(holds, exchange, expected, str(measured), "differs")


def speed(trace: Trace) -> Case | None:
    """Judge whether a robot without declared limits drives no faster than commanded.

    Return None where there was no command or too few readable samples.
    """
    window = velocities(newest(trace.turns))
    if len(window) < SEVERAL or not trace.commands:
        return None
    turn, measured = trace.turns[-1], middle(window)
    fastest = Velocity(
        *(max(map(abs, each)) for each in zip(*(command.velocity for command in trace.commands), strict=True))
    )
    holds = all(abs(one) <= 1.5 * most + 0.2 for one, most in zip(measured, fastest, strict=True))
    expected = f"a speed that was commanded, at most {rounded(fastest)}"
    return Case(holds, turn.velocity_exchange, expected, str(measured))


def arrival(trace: Trace, reach: Reach, limits: Limits) -> Case:
    """Judge whether the robot reached a velocity, by the last looks of the wait."""
    seen = trace.turns[: reach.turns]
    turns = [turn for turn in seen[-_LOOKED_AT:] if turn.at >= reach.since]
    window = velocities(newest(turns))
    holds = is_shown(limits, turns, reach.wanted, part=reach.part, count=max(1, min(SEVERAL, len(window))))
    turn = seen[-1]
    expected = f"{rounded(reach.wanted)} within {limits.settle_s:g} s of the command"
    observed = str(middle(window)) if window else turn.velocity_exchange.came
    return Case(bool(holds), turn.velocity_exchange, expected, observed, "not reached")


def rounded(velocity: Velocity) -> Velocity:
    """Return a velocity rounded for display."""
    return Velocity(*(round(value, 4) for value in velocity))


# Share of the hold time by which a velocity may hold longer.
_LONGER: Final = 0.4


@dataclass(frozen=True)
class Driven:
    """A drive, and the velocities in it that were not renewed.

    Attributes:
        drive: all commands and readings.
        let_go: the velocities that were not renewed.
        paused: two looks at the robot at rest after each of them, the first ones of the velocity after a pause.
        over_soap: readings of pose and velocity over SOAP, beside the looks.
    """

    drive: Trace
    let_go: tuple[Drive, ...] = ()
    paused: tuple[tuple[Turn, Turn], ...] = ()
    over_soap: tuple[Exchange, ...] = ()


def longer_s(limits: Limits) -> float:
    """Return for how long after its hold time a velocity may be seen at most, s.

    Commands and odometry are delayed by part of the settle time; half as long again is no such delay.
    """
    return max(_LONGER * (limits.hold_s or 0.0), 0.5 * limits.settle_s, LONGEST_SAMPLE_S)


def rule_on(requirement: str, *scenarios: Scenario) -> Rule:
    """Return a rule that judges one requirement by the traces of these scenarios."""

    def judge(trace: Driven, run: Run) -> Iterator[Outcome]:
        return outcomes(requirement, trace.drive, said_of(run).limits)

    return rule(requirement, on=scenarios)(judge)
