"""The commands and readings of one drive, as data, and medians over several odometry samples.

A robot publishes odometry 5 to 100 times a second with noise in each sample. A client that reads faster gets one sample
several times; functions here count samples, told apart by their stamps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from conformance.measures import samples as measures
from conformance.measures.samples import SEVERAL
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.robot import Odometry, Velocity, is_near
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

#: All components of a velocity, its linear part, its angular part.
ALL, LINEAR_PART, ANGULAR_PART = slice(None), slice(0, 3), slice(3, 6)
#: Assumed hold time of a velocity where none is declared, s.
COUNTED_ON_S: Final = 0.5
#: Share of the hold time in which a velocity is judged.
JUDGED: Final = 0.95
#: Share of the hold time after which a client that keeps driving must have sent the next velocity.
_COUNTED_ON: Final = 0.9
_LATE_S: Final = 0.02


def certain_s(hold_s: float | None) -> float:
    """Return how long after its command a velocity certainly holds, s."""
    return COUNTED_ON_S if hold_s is None else _COUNTED_ON * hold_s - _LATE_S


@dataclass(frozen=True)
class Command:
    """One PUT of a velocity.

    Attributes:
        velocity: the velocity that was sent.
        sent, answered: times of request and response, s of the run's clock.
        exchange: the PUT's request and response.
        linear_only: whether only the linear part was PUT, which does not prolong the angular part.
        integers: whether whole numbers were written without a fraction.
        renewal: whether it only repeats the command before it.
    """

    velocity: Velocity
    sent: float
    answered: float
    exchange: Exchange
    linear_only: bool = False
    integers: bool = False
    renewal: bool = False


@dataclass(frozen=True)
class Turn:
    """One round of reads: a GET of each resource with the velocity, or of the velocity alone.

    Attributes:
        odometry: the odometry, read first; None where it cannot be read.
        at: when the GET of the velocity was sent, s of the run's clock.
        velocity, linear: the values of these resources; None where they cannot be read.
        velocity_exchange, linear_exchange: their requests and responses.
        commands: number of commands sent before.
    """

    odometry: Odometry | None
    at: float
    velocity: Velocity | None
    velocity_exchange: Exchange
    linear: Velocity | None = None
    linear_exchange: Exchange | None = None
    commands: int = 0

    @property
    def received_s(self) -> float:
        """Return when the velocity had arrived, s of the run's clock."""
        return self.at + self.velocity_exchange.response.elapsed_ms / 1000


@dataclass(frozen=True)
class Reach:
    """A wait until the robot has the commanded velocity.

    Attributes:
        shows: ids of the requirements that say that the robot must reach it.
        wanted: the velocity.
        part: the components that count.
        since: readings before this time do not count, s of the run's clock.
        turns: number of looks in the trace at the end of the wait.
        there: whether the robot reached it.
        outlasted: whether responses take longer than the robot holds a velocity: a miss then proves nothing.
    """

    shows: tuple[str, ...]
    wanted: Velocity
    part: slice
    since: float
    turns: int
    there: bool
    outlasted: bool = False


@dataclass(frozen=True)
class Trace:
    """The commands and readings of one drive so far.

    Attributes:
        begun: start of the drive, s of the run's clock.
        commands, turns, reaches: the drive's records of each kind, in order.
        sightings: cases of single readings, each with the id of its requirement.
        odometry: the odometry of all looks in which it could be read.
        measured: the velocity read with each odometry; the odometry's own where the velocity could not be read.
        outlasted: whether responses take longer than the robot holds a velocity: the pose then cannot be predicted.
    """

    begun: float
    commands: tuple[Command, ...] = ()
    turns: tuple[Turn, ...] = ()
    odometry: tuple[Odometry, ...] = ()
    measured: tuple[Velocity, ...] = ()
    reaches: tuple[Reach, ...] = ()
    sightings: tuple[tuple[str, Case], ...] = ()
    outlasted: bool = False

    def with_command(self, command: Command) -> Trace:
        """Return the trace with one more command."""
        return replace(self, commands=(*self.commands, command))

    def with_look(self, turn: Turn) -> Trace:
        """Return the trace with one more look."""
        longer = replace(self, turns=(*self.turns, replace(turn, commands=len(self.commands))))
        if turn.odometry is None:
            return longer
        velocity = turn.odometry.velocity if turn.velocity is None else turn.velocity
        return replace(longer, odometry=(*self.odometry, turn.odometry), measured=(*self.measured, velocity))

    def upto(self, turns: int) -> Trace:
        """Return the trace up to a number of looks."""
        seen = self.turns[:turns]
        return replace(self, turns=seen, commands=self.commands[: seen[-1].commands] if seen else ())

    @property
    def last_sent_s(self) -> float:
        """Return the time at which the last command was sent."""
        return self.commands[-1].sent if self.commands else self.begun

    @property
    def last_full(self) -> Command | None:
        """Return the last command of all components."""
        return next((command for command in reversed(self.commands) if not command.linear_only), None)

    @property
    def full_sent(self) -> float:
        """Return the time at which the last command of all components was sent."""
        return self.last_full.sent if self.last_full else self.begun

    @property
    def last_command(self) -> Command | None:
        """Return the last command that was no renewal; None before the first."""
        return next((command for command in reversed(self.commands) if not command.renewal), None)

    @property
    def last_answered_s(self) -> float:
        """Return the time of the response to the last command that was no renewal."""
        return self.last_command.answered if self.last_command else self.begun


# Longest time between two odometry samples, s, if stamps do not advance.
LONGEST_SAMPLE_S: Final = 0.25
# A distance that is still this share of the first has not become shorter.
_NO_NEARER: Final = 0.8


def newest(turns: Sequence[Turn], count: int = SEVERAL) -> list[Turn]:
    """Return the last reading of each of the newest ``count`` samples that have a velocity, oldest first."""
    found: list[Turn] = []
    for turn in reversed(turns):
        if turn.velocity is None:
            continue
        if not found or _is_another(turn, found[-1]):
            if len(found) == count:
                break
            found.append(turn)
    return found[::-1]


def _is_another(turn: Turn, later: Turn) -> bool:
    if turn.odometry is not None and later.odometry is not None and turn.odometry.stamp != later.odometry.stamp:
        return True
    return later.at - turn.at > LONGEST_SAMPLE_S


def velocities(turns: Sequence[Turn]) -> list[Velocity]:
    """Return the velocities of the readings."""
    return [turn.velocity for turn in turns if turn.velocity is not None]


def middle(readings: Sequence[Velocity]) -> Velocity:
    """Return the median of each component."""
    return Velocity(*measures.middle(readings))


def part_of(velocity: Velocity, part: slice) -> Velocity:
    """Return a velocity with zeros in the components that do not count."""
    chosen = set(range(len(velocity))[part])
    return Velocity(*(value if index in chosen else 0.0 for index, value in enumerate(velocity)))


def is_stuck(turns: Sequence[Turn], wanted: Velocity, part: slice = ALL) -> bool:
    """Return whether several readings show a velocity that does not approach the wanted one."""
    seen = velocities(turns)
    if len(seen) < SEVERAL:
        return False
    return _apart(seen[-1], wanted, part) > _NO_NEARER * _apart(seen[0], wanted, part)


def _apart(one: Velocity, other: Velocity, part: slice) -> float:
    return max(abs(a - b) for a, b in zip(part_of(one, part), part_of(other, part), strict=True))


def verdict(
    limits: Limits, turns: Sequence[Turn], wanted: Velocity, factor: float = 1.0, part: slice = ALL
) -> bool | None:
    """Return whether readings show a velocity: the newest one does, or the median of the newest samples.

    Returns:
        None where the newest reading does not and there are too few samples for a median.
    """
    samples = velocities(newest(turns))
    if samples and is_near(limits, part_of(samples[-1], part), part_of(wanted, part), factor):
        return True
    return is_shown(limits, turns, wanted, factor, part)


def is_shown(
    limits: Limits,
    turns: Sequence[Turn],
    wanted: Velocity,
    factor: float = 1.0,
    part: slice = ALL,
    count: int = SEVERAL,
) -> bool | None:
    """Return whether the median of the newest samples is the velocity, within ``factor`` times the tolerance.

    Returns:
        None where there are too few samples.
    """
    samples = velocities(newest(turns, count))
    if len(samples) < count:
        return None
    return is_near(limits, part_of(middle(samples), part), part_of(wanted, part), factor, len(samples))
