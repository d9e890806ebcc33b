"""What was commanded and what was seen along one drive, as a value that can be judged without a robot."""

from __future__ import annotations

from dataclasses import dataclass, replace

from conformance.packs.table1.robot.robot import Odometry, Velocity
from conformance.transport.exchange import Exchange


@dataclass(frozen=True)
class Command:
    """One PUT of a velocity.

    Attributes:
        velocity: what was asked for.
        sent, answered: s of the monotonic clock.
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
    """One reading of all resources that tell the velocity, one after another.

    Attributes:
        odometry: read first; None where it cannot be read.
        at: when the velocity was asked for, s of the monotonic clock.
        velocity, linear: of their resources; None where they cannot be read.
        velocity_exchange, linear_exchange: the evidence.
    """

    odometry: Odometry | None
    at: float
    velocity: Velocity | None
    velocity_exchange: Exchange
    linear: Velocity | None
    linear_exchange: Exchange


@dataclass(frozen=True)
class Trace:
    """One drive so far.

    Attributes:
        begun: when, s of the monotonic clock.
        commands, turns: in their order.
        odometry: of all turns in which it could be read.
        measured: the velocity beside each of them; its own where the velocity's resource could not be read.
    """

    begun: float
    commands: tuple[Command, ...] = ()
    turns: tuple[Turn, ...] = ()
    odometry: tuple[Odometry, ...] = ()
    measured: tuple[Velocity, ...] = ()

    def commanded(self, command: Command) -> Trace:
        """The same with one command more."""
        return replace(self, commands=(*self.commands, command))

    def looked(self, turn: Turn) -> Trace:
        """The same with one turn more."""
        longer = replace(self, turns=(*self.turns, turn))
        if turn.odometry is None:
            return longer
        velocity = turn.odometry.velocity if turn.velocity is None else turn.velocity
        return replace(longer, odometry=(*self.odometry, turn.odometry), measured=(*self.measured, velocity))

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
