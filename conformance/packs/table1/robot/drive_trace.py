"""What was commanded and what was seen along one drive, as a value that can be judged without a robot."""

from __future__ import annotations

from dataclasses import dataclass, replace

from conformance.packs.table1.robot.robot import Odometry, Velocity
from conformance.transport.exchange import Exchange

#: All components of a velocity, its linear part, its angular part.
ALL, LINEAR_PART, ANGULAR_PART = slice(None), slice(0, 3), slice(3, 6)


@dataclass(frozen=True)
class Command:
    """One PUT of a velocity.

    Attributes:
        velocity: the velocity that was sent.
        sent, answered: s of the run's clock.
        exchange: the evidence.
        linear_only: whether only the linear part was put: the angular one need not last the longer for it.
        integers: whether whole numbers were written without a fraction.
        renewal: whether it only repeats the one before, so that its velocity goes on.
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
    """One reading of all resources that show the velocity, one after another.

    Attributes:
        odometry: read first; None where it cannot be read.
        at: when the velocity was requested, s of the run's clock.
        velocity, linear: of their resources; None where they cannot be read.
        velocity_exchange, linear_exchange: the evidence.
        commands: how many commands had been given before.
    """

    odometry: Odometry | None
    at: float
    velocity: Velocity | None
    velocity_exchange: Exchange
    linear: Velocity | None
    linear_exchange: Exchange
    commands: int = 0


@dataclass(frozen=True)
class Reach:
    """A wait until the velocity is the commanded one.

    Attributes:
        shows: ids of the requirements that say that it has to come to this.
        wanted: the velocity.
        part: the components that count.
        since: readings before that do not count, s of the run's clock.
        turns: how many turns there were at the end of the wait.
        there: whether it was reached.
        outlasted: whether a response takes longer than a velocity holds, so that nothing can be said where it was not.
    """

    shows: tuple[str, ...]
    wanted: Velocity
    part: slice
    since: float
    turns: int
    there: bool
    outlasted: bool = False


@dataclass(frozen=True)
class Sighting:
    """A look whether the robot does what a requirement says.

    Attributes:
        shows: id of the requirement.
        holds: whether it does; None: the readings came too late to say.
        exchange: the last reading.
        expected: what the requirement asks for here.
        observed: what was seen.
        cause: sightings of one cause are one finding.
    """

    shows: str
    holds: bool | None
    exchange: Exchange
    expected: str
    observed: str = ""
    cause: str = ""


@dataclass(frozen=True)
class Trace:
    """One drive so far.

    Attributes:
        begun: when, s of the run's clock.
        commands, turns, reaches, sightings: in their order.
        odometry: of all turns in which it could be read.
        measured: the velocity beside each of them; its own where the velocity's resource could not be read.
        outlasted: whether a response takes longer than a velocity holds: then no way can be summed up.
    """

    begun: float
    commands: tuple[Command, ...] = ()
    turns: tuple[Turn, ...] = ()
    odometry: tuple[Odometry, ...] = ()
    measured: tuple[Velocity, ...] = ()
    reaches: tuple[Reach, ...] = ()
    sightings: tuple[Sighting, ...] = ()
    outlasted: bool = False

    def commanded(self, command: Command) -> Trace:
        """Return the trace with one command more."""
        return replace(self, commands=(*self.commands, command))

    def looked(self, turn: Turn) -> Trace:
        """Return the trace with one turn more."""
        longer = replace(self, turns=(*self.turns, replace(turn, commands=len(self.commands))))
        if turn.odometry is None:
            return longer
        velocity = turn.odometry.velocity if turn.velocity is None else turn.velocity
        return replace(longer, odometry=(*self.odometry, turn.odometry), measured=(*self.measured, velocity))

    def upto(self, turns: int) -> Trace:
        """Return the trace as it was after so many turns."""
        seen = self.turns[:turns]
        return replace(self, turns=seen, commands=self.commands[: seen[-1].commands] if seen else ())

    @property
    def sent(self) -> float:
        """When the last command was sent."""
        return self.commands[-1].sent if self.commands else self.begun

    @property
    def last_full(self) -> Command | None:
        """The last command of all components."""
        return next((one for one in reversed(self.commands) if not one.linear_only), None)

    @property
    def full_sent(self) -> float:
        """When the last command of all components was sent."""
        return self.last_full.sent if self.last_full else self.begun

    @property
    def last_command(self) -> Command | None:
        """The last one that was no renewal; None before the first."""
        return next((one for one in reversed(self.commands) if not one.renewal), None)

    @property
    def answered(self) -> float:
        """When the last command that was no renewal was answered."""
        return self.last_command.answered if self.last_command else self.begun
