"""What a drive shows of a robot: every function judges a trace, or a part of one, and talks to nobody."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final

from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.drive_trace import Command, Trace
from conformance.packs.table1.robot.message_shapes import TWIST, VECTOR3, read_as
from conformance.packs.table1.robot.robot import Velocity, is_near
from conformance.packs.table1.robot.windows import ALL, SEVERAL, middle, newest, shown, velocities
from conformance.transport.exchange import Exchange

# What was measured for so long alike is steady: readings of two resources may be compared, s.
_STEADY_S: Final = 0.3
# More turns than are in any window.
_LOOKED_AT: Final = 200
#: Two writings of one double are no farther apart than this, whatever is accepted.
ECHO: Final = 1e-9


@dataclass(frozen=True)
class Judgement:
    """One case of a requirement; see Judge.check()."""

    requirement: str
    holds: bool
    exchange: Exchange
    expected: str
    found: str = ""
    cause: str = ""


def answer_of(command: Command) -> Judgement:
    """Whether a command was answered as the contract wants it: 204, or 200 with what was accepted."""
    answer = command.exchange.response
    kind, shape = ("Vector3", VECTOR3) if command.linear_only else ("Twist", TWIST)
    problem = "" if answer.status in {HTTPStatus.OK, HTTPStatus.NO_CONTENT} else command.exchange.came
    if answer.status == HTTPStatus.OK:
        value, problem = read_as(answer, shape)
        problem = problem or _other_number(command, value)
    name = "linear-put" if command.linear_only else "velocity-integers" if command.integers else "velocity-put"
    expected = f"200 with the accepted {kind}, or 204"
    return Judgement(f"rest-resources/{name}", not problem, command.exchange, expected, problem)


def _other_number(command: Command, value: Any) -> str:
    """The first component that was accepted with another number than the one that was put; empty where none was."""
    given = {"linear": value} if command.linear_only else value
    for part, asked in command.velocity.twist.items():
        for axis, number in asked.items() if part in given else ():
            accepted = given[part][axis]
            if abs(float(accepted) - number) > ECHO:
                return f"{part} {axis} {accepted} for {number}"
    return ""


def agreement(trace: Trace, limits: Limits) -> list[Judgement]:
    """Whether velocity and linear part agree with the odometry: their medians over a while in which each was steady.

    Only where no command was sent from that while's beginning on. Where answers take long it is as long as several
    turns take. A robot that moves by itself may do so between two readings: what is read of it is then not steady.
    """
    odometry = trace.turns[-SEVERAL].odometry if len(trace.turns) >= SEVERAL else None
    if odometry is None:
        return []
    since = min(trace.turns[-1].at - _STEADY_S, odometry.sent)
    window = list(itertools.takewhile(lambda turn: turn.at >= since, reversed(trace.turns)))
    steady = [turn.odometry.velocity for turn in window if turn.odometry is not None]
    count = len(newest(window[::-1], len(window)))
    lasted = len(trace.turns) > len(window) or since == odometry.sent
    if trace.sent > since or not lasted or count < SEVERAL or len(steady) < len(window):
        return []
    wanted = middle(steady)
    if not _is_steady(limits, steady):
        return []
    found = []
    turn = window[0]
    read = velocities(window)
    if _is_steady(limits, read):
        expected = f"the velocity that the odometry has, {rounded(wanted)}"
        found.append(_same("velocity-odometry", read, wanted, (limits, count), turn.velocity_exchange, expected))
    linear = [one.linear for one in window if one.linear is not None]
    if linear and _is_steady(limits, read):
        wanted = Velocity(*middle(read)[:3])
        expected = f"the linear part of the velocity, {rounded(wanted)}"
        found.append(_same("linear-agrees", linear, wanted, (limits, count), turn.linear_exchange, expected))
    return found


def _is_steady(limits: Limits, readings: Sequence[Velocity]) -> bool:
    """Whether there are readings, and all near their median."""
    return bool(readings) and all(is_near(limits, one, middle(readings), 0.5) for one in readings)


def _same(
    name: str, readings: Sequence[Velocity], wanted: Velocity, by: tuple[Limits, int], exchange: Exchange, expected: str
) -> Judgement:
    limits, samples = by
    measured = middle(readings)
    # Either median is off by its own noise, and by a quarter more than a mean would be.
    holds = is_near(limits, measured, wanted, samples=samples / math.pi)
    return Judgement(f"rest-resources/{name}", holds, exchange, expected, str(measured), "differs")


def speed(trace: Trace) -> Judgement | None:
    """Without declared limits: the robot is not faster than it was asked to be, however it overshoots.

    None where there was no command, or too few samples that could be read.
    """
    window = velocities(newest(trace.turns))
    if len(window) < SEVERAL or not trace.commands:
        return None
    turn, measured = trace.turns[-1], middle(window)
    fastest = Velocity(*(max(map(abs, each)) for each in zip(*(one.velocity for one in trace.commands), strict=True)))
    holds = all(abs(one) <= 1.5 * asked + 0.2 for one, asked in zip(measured, fastest, strict=True))
    expected = f"a speed that was asked for, at most {rounded(fastest)}"
    return Judgement("safety/limits-hold", holds, turn.velocity_exchange, expected, str(measured))


def arrival(
    requirement: str, trace: Trace, wanted: Velocity, limits: Limits, part: slice = ALL, since: float = 0.0
) -> Judgement:
    """Whether a velocity was reached by the last turns, of which those before ``since`` do not count."""
    turns = [turn for turn in trace.turns[-_LOOKED_AT:] if turn.at >= since]
    window = velocities(newest(turns))
    holds = shown(limits, turns, wanted, part=part, count=max(1, min(SEVERAL, len(window))))
    turn = trace.turns[-1]
    expected = f"{rounded(wanted)} within {limits.settle_s:g} s of the command"
    found = str(middle(window)) if window else turn.velocity_exchange.came
    return Judgement(requirement, bool(holds), turn.velocity_exchange, expected, found, "not reached")


def rounded(velocity: Velocity) -> Velocity:
    """A velocity as it is shown."""
    return Velocity(*(round(value, 4) for value in velocity))
