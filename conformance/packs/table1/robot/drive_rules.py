"""Records of scenarios that drive a robot, and what judges them. No function here sends anything to the robot."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final

from conformance.measures.samples import SEVERAL
from conformance.packs.table1.limits import Limits
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
from conformance.packs.table1.robot.message_shapes import TWIST, VECTOR3, read_as
from conformance.packs.table1.robot.path import way_and_turn
from conformance.packs.table1.robot.robot import Velocity, is_near
from conformance.packs.table1.statement import said_of
from conformance.scenarios.motion.trace import Drive
from conformance.scenarios.rule import NotTested, Outcome, Rule, rule
from conformance.scenarios.scenario import Scenario
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run

# Readings that agree for this long are steady, so that two resources can be compared, s.
_STEADY_S: Final = 0.3
# Consecutive readings that must be wrong while the velocity changes: fewer may come from sampling.
_IN_A_ROW: Final = 5
# Rounds of readings to judge: more than any window has.
_LOOKED_AT: Final = 200
#: ECHO: texts of the same double differ by less than this, whatever tolerance is declared.
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
