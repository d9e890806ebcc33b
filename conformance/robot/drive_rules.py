"""What a drive shows of a robot: every function judges a trace, or a part of one, and talks to nobody."""

from collections.abc import Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Final

from conformance.contract.limits import Limits
from conformance.robot.drive_trace import Command, Trace
from conformance.robot.message_shapes import TWIST, VECTOR3, read_as
from conformance.robot.robot import Velocity, is_near
from conformance.transport.exchange import Exchange

# What was measured for so long alike is steady: readings of two resources may be compared, s.
_STEADY_S: Final = 0.3
# Two writings of one double.
_ECHO: Final = 1e-9
_ALL: Final = slice(None)


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
            if abs(float(accepted) - number) > _ECHO:
                return f"{part} {axis} {accepted} for {number}"
    return ""


def agreement(trace: Trace, limits: Limits) -> list[Judgement]:
    """Whether the readings of the turn before the last agree with the odometry on both sides of them.

    Only where the odometry was steady, and no command was sent, from a while before them on.
    """
    turn = next(iter(trace.turns[-2:-1]), None)
    if turn is None or trace.turns[-1].odometry is None:
        return []
    since = turn.at - _STEADY_S
    around = _from_the_last_before(trace.odometry, since)
    last = trace.odometry[-1].velocity
    if around is None or trace.sent > since or not all(is_near(limits, one, last, 0.5) for one in around):
        return []
    found = []
    if turn.velocity is not None:
        wanted = f"the velocity that the odometry has, {rounded(last)}"
        found.append(_same("velocity-odometry", turn.velocity, last, limits, turn.velocity_exchange, wanted))
    if turn.linear is not None and turn.velocity is not None:
        linear = Velocity(*turn.velocity[:3])
        wanted = f"the linear part of the velocity, {rounded(linear)}"
        found.append(_same("linear-agrees", turn.linear, linear, limits, turn.linear_exchange, wanted))
    return found


def _from_the_last_before(odometry: Sequence[Any], since: float) -> list[Velocity] | None:
    """The velocities from the last one before a time on; None where there is none before it."""
    found = []
    for one in reversed(odometry):
        found.append(one.velocity)
        if one.received <= since:
            return found
    return None


def _same(
    name: str, measured: Velocity, wanted: Velocity, limits: Limits, exchange: Exchange, expected: str
) -> Judgement:
    holds = is_near(limits, measured, wanted)
    return Judgement(f"rest-resources/{name}", holds, exchange, expected, str(measured), "differs")


def speed(trace: Trace) -> Judgement | None:
    """Without declared limits: the robot is not faster than it was asked to be, however it overshoots.

    None where there was no command, or no velocity that could be read.
    """
    turn = trace.turns[-1]
    if turn.velocity is None or not trace.commands:
        return None
    fastest = Velocity(*(max(map(abs, each)) for each in zip(*(one.velocity for one in trace.commands), strict=True)))
    holds = all(abs(one) <= 1.5 * asked + 0.2 for one, asked in zip(turn.velocity, fastest, strict=True))
    expected = f"a speed that was asked for, at most {rounded(fastest)}"
    return Judgement("safety/limits-hold", holds, turn.velocity_exchange, expected, str(turn.velocity))


def is_reached(trace: Trace, wanted: Velocity, limits: Limits, part: slice = _ALL) -> bool:
    """Whether the velocity that was read last is what was wanted, in the components of ``part``."""
    velocity = trace.turns[-1].velocity
    return velocity is not None and is_near(limits, _part(velocity, part), _part(wanted, part))


def arrival(requirement: str, trace: Trace, wanted: Velocity, limits: Limits, part: slice = _ALL) -> Judgement:
    """Whether a velocity was reached by the last turn."""
    turn = trace.turns[-1]
    holds = is_reached(trace, wanted, limits, part)
    expected = f"{rounded(wanted)} within {limits.settle_s:g} s of the command"
    found = str(turn.velocity) if turn.velocity else turn.velocity_exchange.came
    return Judgement(requirement, holds, turn.velocity_exchange, expected, found, "not reached")


def _part(velocity: Velocity, part: slice) -> Velocity:
    chosen = set(range(len(velocity))[part])
    return Velocity(*(value if index in chosen else 0.0 for index, value in enumerate(velocity)))


def rounded(velocity: Velocity) -> Velocity:
    """A velocity as it is shown."""
    return Velocity(*(round(value, 4) for value in velocity))
