"""Records of a device that moves by its map: readings, commands and attempts at rest.

Times are s of the run's monotonic clock; positions are in the units of the map's axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from conformance.measures.samples import LATE, Noise, usual_s
from conformance.transport.exchange import Exchange

# A response is late if it takes at least this long, s.
_LATE_S = 0.1


@dataclass(frozen=True)
class Reading:
    """One reading of the state.

    Attributes:
        sent, received: when it was requested, and when the response had arrived.
        values: positions by axis; empty if the response has not all of them.
        stamp: the device's time, s; None if there is none.
        exchange: request and response.
        speeds: measured velocities by their names, of those that the response has.
        action: what the last accepted move said of itself just after; empty if not read.
    """

    sent: float
    received: float
    values: dict[str, float]
    stamp: float | None
    exchange: Exchange
    speeds: dict[str, float] = field(default_factory=dict)
    action: str = ""


@dataclass(frozen=True)
class Resting:
    """Noise of a device at rest before any move, by axis and by velocity."""

    axes: dict[str, Noise] = field(default_factory=dict)
    speeds: dict[str, Noise] = field(default_factory=dict)


@dataclass(frozen=True)
class Command:
    """A move or a velocity that was sent, or a stop.

    Attributes:
        sent, answered: when.
        targets: positions, or velocities, by axis; empty for a stop.
        exchange: request and response.
        failed: whether the content of a 2xx says that it failed.
    """

    sent: float
    answered: float
    targets: dict[str, float]
    exchange: Exchange
    failed: bool = False

    @property
    def is_ok(self) -> bool:
        """Whether it was answered 2xx, and did not fail by its content."""
        return self.exchange.response.ok and not self.failed

    @property
    def is_refused(self) -> bool:
        """Whether the device refused it."""
        return self.failed or is_refusal(self.exchange)

    def was_late(self, readings: Sequence[Reading]) -> bool:
        """Return whether its response came late, compared with readings: link or device held it back."""
        return self.answered - self.sent > max(_LATE_S, LATE * usual_s(readings))


@dataclass(frozen=True)
class Leg:
    """One or more commands, and the readings after them.

    Attributes:
        what: as a noun phrase.
        start: where the device was, by axis.
        commands: in order.
        readings: from the first command on.
        due: when the last accepted target must have been reached.
        resting: what it shows at rest.
    """

    what: str
    start: dict[str, float]
    commands: tuple[Command, ...]
    readings: tuple[Reading, ...]
    due: float
    resting: Resting = Resting()

    def after(self, moment: float) -> tuple[Reading, ...]:
        """Return the usable readings that were requested after a moment."""
        return tuple(reading for reading in self.readings if reading.sent >= moment and reading.values)

    def was_under_way(self, axis: str, tolerance: float, until: float | None = None) -> bool:
        """Return whether the second command met the device between start and target of the first, along an axis.

        Over a slow link it reaches a fast device after that has arrived; and a device may need as much way to brake as
        it needed to speed up. ``until``: when it met the device at the latest, if not when it was answered.
        """
        goal, order = self.commands[:2]
        before = [reading for reading in self.readings if reading.values and reading.received <= order.sent]
        if not before:
            return False
        last = before[-1]
        left, done = abs(goal.targets[axis] - last.values[axis]), abs(last.values[axis] - self.start[axis])
        since_s = last.sent - goal.answered
        comes = done / since_s * ((until or order.answered) - last.sent) if since_s > 0 else left
        return left >= comes + max(4 * tolerance, done + comes + tolerance) and done >= tolerance


@dataclass(frozen=True)
class Drive:
    """A velocity that is commanded repeatedly, and the readings after it.

    Attributes:
        what: as a noun phrase.
        wanted: velocities by name, as the device must take them.
        commands: in order; all of them command the same.
        under_way: the readings until the last of them.
        end: the command of velocity zero; None if nothing was sent any more, or another velocity.
        after: the readings after that.
        refused: a command after the last one that the device must refuse; None if none was sent.
        slowed: that it was slower than planned, as the limits leave no room; empty if it was not.
        resting: what the device shows at rest.
        since: when it had reached the velocity, or else had to, s; None: the time to settle after the first response.
        rested: since when it was seen at rest, where nobody looked for longer, s; None: until after it had to rest.
        at_end: whether it stood at an end of its travel that nobody declared.
    """

    what: str
    wanted: dict[str, float]
    commands: tuple[Command, ...]
    under_way: tuple[Reading, ...]
    end: Command | None
    after: tuple[Reading, ...]
    refused: Command | None = None
    slowed: str = ""
    resting: Resting = Resting()
    since: float | None = None
    rested: float | None = None
    at_end: bool = False

    @property
    def name(self) -> str:
        """Return the drive as a noun phrase, with the velocity to which it was slowed."""
        return self.what + self.slowed

    @property
    def readings(self) -> tuple[Reading, ...]:
        """All readings."""
        return self.under_way + self.after

    def settled_at(self, settle_s: float) -> float:
        """Return when it had reached its velocity, or else had to, s; ``settle_s``: the device's time to do so."""
        return self.commands[0].answered + settle_s if self.since is None else self.since

    def was_kept(self, hold_s: float | None) -> bool:
        """Return whether each command arrived within the hold time of the one before; without a hold time, True.

        Over a slow link it may rest in between, rightly.
        """
        met = [
            *(command.answered for command in self.commands[1:]),
            *(reading.received for reading in self.under_way[-1:]),
        ]
        return hold_s is None or all(later - one.sent <= hold_s for one, later in zip(self.commands, met, strict=False))


@dataclass(frozen=True)
class Told:
    """Values of one position or velocity that several operations return.

    Attributes:
        when: at rest, or what it drives at.
        values: by operation; empty if it has not all of them.
        exchanges: by operation.
    """

    when: str
    values: dict[str, dict[str, float]]
    exchanges: dict[str, Exchange]


@dataclass(frozen=True)
class Switched:
    """A switch's commanded value, and the readings after it.

    Attributes:
        switch: its name.
        value: what was sent.
        command: request and response.
        shown: what was read last, within its time and a moment later.
        arrived, stayed: whether that was the value then.
    """

    switch: str
    value: Any
    command: Exchange
    shown: Any
    arrived: bool
    stayed: bool


@dataclass(frozen=True)
class Tried:
    """One attempt that must move nothing.

    Attributes:
        kind: beyond, invalid, unactuated, incomplete or unauthorised; a pack may have others.
        what: as a noun phrase.
        exchange: request and response; None if the connection was closed before a response could come.
        failed: whether the content of a 2xx says that it failed.
    """

    kind: str
    what: str
    exchange: Exchange | None
    failed: bool = False


@dataclass(frozen=True)
class Quiet:
    """Attempts at rest that must not move the device, and the readings after them.

    Attributes:
        where: where the device was, by axis.
        tried: the attempts.
        readings: after each of them, and for a while after the last one.
        alone: the same, some attempts at a time up to the one that moved it, if the device moved in all of them.
        idle: the same without any attempt, after those.
        home: the target near which it rests, by axis; empty if it takes no positions.
        beside: what an attempt has changed beside the motion; empty if there is none.
    """

    where: dict[str, float]
    tried: tuple[Tried, ...]
    readings: tuple[Reading, ...]
    alone: tuple[Quiet, ...] = ()
    idle: Quiet | None = None
    home: dict[str, float] = field(default_factory=dict)
    beside: str = ""


def is_refusal(exchange: Exchange) -> bool:
    """Return whether a response refuses a request: 4xx, or for a SOAP message a fault, which may have status 500."""
    status = exchange.response.status
    return 400 <= status < 500 or (is_soap(exchange) and not exchange.response.ok)  # noqa: PLR2004


def is_soap(exchange: Exchange) -> bool:
    """Return whether a request was a SOAP message."""
    fields = {name.lower(): value for name, value in exchange.request.headers}
    return "soapaction" in fields or fields.get("content-type", "").startswith("application/soap+xml")


def middle_of(readings: Sequence[Reading], axis: str) -> float:
    """Return where an axis is by the median of some readings."""
    return median(reading.values[axis] for reading in readings)
