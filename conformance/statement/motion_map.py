"""The motion map: how any device is read, commanded and stopped (tables ``[motion.*]`` of a statement).

Operations are written as in ``--call``: "METHOD PATH", the path as the description has it, or "POST /PORT/OPERATION" of
a WSDL. Positions in responses are JSON pointers (RFC 6901); in XML they go by local names, with "@name" for an
attribute. Bodies and paths are templates: "{yaw}" is the target of the axis yaw, "{yaw:/z}" a component of that turn's
quaternion, "{seconds}" the duration of a move, "{value}" the value of a switch, and "{goto:/uuid}" a value in the
response to the last accepted move.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal

import msgspec

from conformance.contract.toml_file import Finite, NotNegative, Positive
from conformance.statement.motion_calls import NAME, SIGNED, SIZE

_NO_NAMES: Final[Mapping[str, str]] = MappingProxyType({})
Pointer = Annotated[str, msgspec.Meta(pattern=r"^(/.*)?$")]
Call = Annotated[str, msgspec.Meta(pattern=r"^[A-Z]+ /\S*$")]
Angle = Literal["roll", "pitch", "yaw"]
#: A whole turn in units of angles.
_TURNS: Final = {"": math.tau, "rad": math.tau, "deg": 360.0, "degrees": 360.0, "°": 360.0, "h": 24.0}


class Axis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One axis of a device.

    Attributes:
        at: where its position is in the response.
        limits: least and greatest target, in ``unit``.
        unit: for readers, such as rad, m or %.
        speed: the greatest speed on the way to a target, units per second; None if not declared.
        tolerance: how far from its target it may rest; None means that of the move.
        noise: standard deviation of its position as it is read; what a reading shows at rest counts as well.
        rest: how fast it may seem to move at rest, units per second; None means a fifth of its tolerance.
        angle: it turns freely, in rad, or in deg or h by its unit: the angle of this name, of a quaternion or as a
            number; empty if it does not. Its limits say which targets are tried.
        read: the operation that says where it is; empty means that of the state.
        bound: whether it must stay within its limits on its ways; else they only say which targets are tried.
        accepts: least and greatest target that the device accepts, where ``limits`` only say which are tried.
    """

    at: Pointer
    limits: tuple[Finite, Finite]
    unit: str = ""
    speed: Positive | None = None
    tolerance: Positive | None = None
    noise: NotNegative = 0.0
    rest: Positive | None = None
    angle: Angle | Literal[""] = ""
    read: Call | Literal[""] = ""
    bound: bool = True
    accepts: tuple[Finite, Finite] | None = None

    def __post_init__(self) -> None:
        """Check the limits, and the unit of an angle.

        Raises:
            ValueError: the first limit is not below the second, or a whole turn is not known in this unit.
        """
        if self.limits[0] >= self.limits[1]:
            raise ValueError(f"limits = {list(self.limits)} must be two numbers, the lesser one first")
        if self.angle and self.unit not in _TURNS:
            raise ValueError(f"unit = {self.unit!r} of what turns must be one of {', '.join(filter(None, _TURNS))}")

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the greatest target that the device accepts."""
        return self.accepts or self.limits

    def well_inside(self, position: float) -> float:
        """Return the position, or the nearest one that is a quarter of the range away from both limits."""
        return self.within(position, margin=(self.limits[1] - self.limits[0]) / 4)

    def within(self, position: float, margin: float = 0.0) -> float:
        """Return the position, or the nearest one between the limits, with a margin."""
        return min(max(position, self.limits[0] + margin), self.limits[1] - margin)

    def apart(self, one: float, other: float) -> float:
        """Return the distance of two positions, for angles the shorter way."""
        return math.remainder(one - other, _TURNS[self.unit]) if self.angle else one - other

    def distance(self, one: float, other: float) -> float:
        """Return how far the axis moved between two readings: an angle may begin anew after a whole turn."""
        return abs(math.remainder(one - other, _TURNS.get(self.unit or "none", math.inf)))

    def radians(self, position: float) -> float:
        """Return an angle in rad."""
        return position * math.tau / _TURNS[self.unit]

    def of_radians(self, angle: float) -> float:
        """Return an angle, given in rad, in the axis's unit."""
        return angle * _TURNS[self.unit] / math.tau

    def near(self, position: float, other: float) -> float:
        """Return the position; an angle gets whole turns added to be near another one."""
        return other + self.apart(position, other) if self.angle else position


class State(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where the device is.

    Attributes:
        read: the operation that says it.
        axes: by name, as templates name them.
        stamp: where the time of the reading is in the response: a number, a date (RFC 3339) or a ROS time; empty: there
            is none.
        fresh_s: at least so often the position changes while the device moves, s.
        agrees: other operations that say it as well, each with JSON pointers by axis, or by a velocity's name.
    """

    read: Call
    axes: dict[str, Axis]
    stamp: Pointer = ""
    fresh_s: Positive = 0.5
    agrees: dict[Call, dict[str, Pointer]] = {}


Beyond = Literal["refused", "clamped", "undefined"]


class Goto(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the device is sent to a position.

    Attributes:
        send: the operation.
        body: its JSON, a template; None if it has no body.
        relative: whether it takes the way from where the device is, in place of the position.
        tolerance: how far from its target an axis may rest, in the axis's unit.
        seconds: the duration that the suite asks for, where a template has "{seconds}".
        within_s: time to reach any target, where no template has "{seconds}".
        settle_s: time beyond either, s.
        beyond_limits: what the device does with a target beyond its limits: "refused", "clamped", or "undefined".
        while_moving: what a second move does: it "displaces" the first, or is "refused"; None if nobody says it.
    """

    send: Call
    tolerance: Positive
    body: Any = None
    relative: bool = False
    seconds: Positive = 1.0
    within_s: Positive = 10.0
    settle_s: NotNegative = 0.5
    beyond_limits: Beyond = "undefined"
    while_moving: Literal["displaces", "refused"] | None = None


class Action(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A move's own resource, in which a client reads its state.

    Attributes:
        read: the operation, a template.
        at: where the word for its state is in the response.
        running, succeeded, canceled: these words, numbers and truth values as JSON writes them ("true"); an empty
            list: not judged.
    """

    read: Call
    at: Pointer
    running: tuple[str, ...] = ()
    succeeded: tuple[str, ...] = ()
    canceled: tuple[str, ...] = ()


class Speed(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One velocity that can be commanded.

    Attributes:
        limits: least and greatest, in units per second.
        at: where the state's response has the measured velocity; empty if it is the change of the axis ``of``.
        of: the axis that it changes.
        scale: how fast the axis ``of`` changes at velocity 1, in its unit per second.
        tolerance: how far the measured velocity may be off; None means that of the command.
        noise: standard deviation of the measured velocity; what a reading shows at rest counts as well.
        rest: the measured velocity at rest, at most; None means a tenth of its tolerance.
    """

    limits: tuple[Finite, Finite]
    at: Pointer = ""
    of: str = ""
    scale: Positive = 1.0
    tolerance: Positive | None = None
    noise: NotNegative = 0.0
    rest: Positive | None = None

    def __post_init__(self) -> None:
        """Check the limits, and that the velocity can be measured.

        Raises:
            ValueError: the limits do not lie on both sides of 0, or neither ``at`` nor ``of`` is given.
        """
        if not self.limits[0] <= 0 < self.limits[1]:
            raise ValueError(f"limits = {list(self.limits)} must be the least velocity, at most 0, and the greatest")
        if bool(self.at) == bool(self.of):
            raise ValueError('one of at = "/pointer" and of = "axis" must say how the velocity is measured')


class Way(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Another operation that commands a velocity. Axes that its template does not name keep their velocity.

    Attributes:
        send: the operation.
        body: a template; None if it has no body.
        media_type: in which the body is written.
        root: the name of the root element, of XML.
    """

    send: Call
    body: Any = None
    media_type: Literal["application/json", "application/xml", "text/xml", "application/x-www-form-urlencoded"] = (
        "application/json"
    )
    root: str = ""

    def __post_init__(self) -> None:
        """Check that XML has a root.

        Raises:
            ValueError: it has none.
        """
        if self.media_type.endswith("/xml") != bool(self.root):
            raise ValueError("root names the root element of a body that is XML, and of no other")

    @property
    def axes(self) -> set[str]:
        """The velocities that it commands, by name."""
        return names_in([self.send, self.body])


class Velocity(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the device is given a velocity; zero stops it.

    Attributes:
        send: the operation.
        body: its JSON, a template; None if it has no body.
        axes: by name, as templates name them.
        tolerance: how far the measured velocity may be off, in units per second.
        settle_s: time to reach a velocity, and to rest, s.
        hold_s: how long the device goes on after the last command, s; None means until another command comes.
        beyond_limits: what the device does with a velocity beyond its limits: "refused", "clamped", or "undefined".
        ways: other ways to give it a velocity, or a part of one.
    """

    send: Call
    axes: dict[str, Speed]
    tolerance: Positive
    body: Any = None
    settle_s: Positive = 0.5
    hold_s: Positive | None = None
    beyond_limits: Beyond = "undefined"
    ways: tuple[Way, ...] = ()


class Switch(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A device part with a few states and no positions between them, such as a gripper.

    Attributes:
        send: the operation.
        at: where the state's response has its value.
        values: what is sent, in any order.
        read: the operation that says it; empty means that of the state.
        body: JSON of the command, a template with "{value}"; None if it has no body.
        shows: what is read for a value that was sent, where it is another.
        within_s: time until it is there, s.
    """

    send: Call
    at: Pointer
    values: Annotated[tuple[Any, ...], msgspec.Meta(min_length=2)]
    read: Call | Literal[""] = ""
    body: Any = None
    shows: dict[str, Any] = {}
    within_s: Positive = 2.0


class Stop(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the device is stopped.

    Attributes:
        send: the operation.
        body: its JSON, a template; None if it has no body.
        rests_within_s: time from the request until the device rests, s.
    """

    send: Call
    body: Any = None
    rests_within_s: Positive = 0.5


class Lease(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The lease that a client needs to command the device. Its value is {lease} in templates.

    Attributes:
        acquire: the operation that gives it.
        body: JSON of that, or None.
        token: where the response has its value; empty if it has none.
        header: the header in which commands carry it; empty if there is none.
        renew: the operation that keeps it; empty if nothing does.
        renew_body: JSON of that, or None.
        every_s: so often it must be renewed, s.
        release: the operation that gives it back; empty if there is none.
        release_body: JSON of that, or None.
    """

    acquire: Call
    body: Any = None
    token: Pointer = ""
    header: str = ""
    renew: Call | Literal[""] = ""
    renew_body: Any = None
    every_s: Positive = 5.0
    release: Call | Literal[""] = ""
    release_body: Any = None


class Step(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A command before the device can move, such as enable and home, or after it has moved.

    Attributes:
        send: the operation.
        body: JSON, or None.
        read: the operation that says when it is done; empty means at once.
        at: where its response says it.
        shows: what it has there then.
        within_s: time until then, s.
    """

    send: Call
    body: Any = None
    read: Call | Literal[""] = ""
    at: Pointer = ""
    shows: Any = None
    within_s: Positive = 30.0


class Failed(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"is_not": "not"}):
    """The member of a 2xx response that reports a failed request.

    Attributes:
        at: where the response says it.
        is_not: what it has there if the request succeeded.
    """

    at: Pointer
    is_not: Any = 0


class MotionMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a device moves.

    Attributes:
        state: where it is.
        goto: how it is sent to a position; None if not declared.
        velocity: how it is given a velocity; None if not declared.
        stop: how it is stopped; None if not declared, or by a velocity of zero.
        action: what a move says of itself; None if not declared.
        switches: what has a few states, by name.
        failed: how a response of 200 says that its request failed; None if its status says it.
        lease: what a client must hold meanwhile; None if there is none.
        before: what is sent before the device can move, in order.
        after: what is sent last, in order.
    """

    state: State
    goto: Goto | None = None
    velocity: Velocity | None = None
    stop: Stop | None = None
    action: Action | None = None
    switches: dict[str, Switch] = {}
    failed: Failed | None = None
    lease: Lease | None = None
    before: tuple[Step, ...] = ()
    after: tuple[Step, ...] = ()

    def __post_init__(self) -> None:
        """Check that something moves, and that the templates name each axis and nothing that is not known.

        Raises:
            ValueError: they do not.
        """
        if not (self.goto or self.velocity or self.switches):
            raise ValueError("nothing would move: it needs [motion.goto], [motion.velocity] or [motion.switches]")
        axes = set(self.state.axes)
        if self.goto:
            turns = {f"{name}:/{text}": name for name, axis in self.state.axes.items() if axis.angle for text in "xyzw"}
            _check_names("goto", self.goto, axes, {"seconds": "seconds", **turns})
        elif loose := [name for name, axis in self.state.axes.items() if axis.tolerance is None]:
            raise ValueError(f"axis {loose[0]} needs a tolerance, as there is no [motion.goto] that has one")
        if self.velocity:
            _check_names("velocity", self.velocity, set(self.velocity.axes))
            if strange := {one.of for one in self.velocity.axes.values()} - axes - {""}:
                raise ValueError(f"of = {min(strange)!r} is no axis of [motion.state.axes]")
            for way in self.velocity.ways:
                _check_names(
                    "velocity.ways", way, way.axes & set(self.velocity.axes) or {next(iter(self.velocity.axes))}
                )
        for name, switch in self.switches.items():
            _check_names(f"switches.{name}", switch, {"value"})
        for given in filter(None, (self.stop, self.action)):
            _refuse_strange(names_in(list(msgspec.structs.asdict(given).values())))
        if strange := {name for pointers in self.state.agrees.values() for name in pointers} - axes - set(self.speeds):
            raise ValueError(f"agrees names {min(strange)!r}, which neither an axis nor a velocity with at is called")

    @property
    def speeds(self) -> dict[str, Pointer]:
        """Where the state's response has measured velocities, by name."""
        return {name: one.at for name, one in self.velocity.axes.items() if one.at} if self.velocity else {}

    @property
    def bodies(self) -> tuple[tuple[str, Any], ...]:
        """The operations that command the device, with the templates of their bodies."""
        ways = self.velocity.ways if self.velocity else ()
        given = (self.goto, self.velocity, *ways, self.stop, *self.switches.values())
        return tuple((one.send, one.body) for one in given if one)

    @property
    def calls(self) -> tuple[str, ...]:
        """The operations that the map names."""
        sent = [call for call, _ in self.bodies]
        read = [self.state.read, *self.state.agrees, *(switch.read for switch in self.switches.values())]
        read += [axis.read for axis in self.state.axes.values()]
        held = [self.lease.acquire, self.lease.renew, self.lease.release] if self.lease else []
        steps = [call for step in (*self.before, *self.after) for call in (step.send, step.read)]
        return tuple(filter(None, (*read, *sent, *([self.action.read] if self.action else ()), *held, *steps)))

    def tolerance(self, axis: str) -> float:
        """Return how far from its target an axis may rest, in the axis's unit."""
        own = self.state.axes[axis].tolerance
        return own if own is not None else self.goto.tolerance if self.goto else 0.0

    def speed_tolerance(self, name: str) -> float:
        """Return how far a measured velocity may be off, in its unit."""
        return (self.velocity.axes[name].tolerance or self.velocity.tolerance) if self.velocity else 0.0


def _check_names(
    table: str, given: Goto | Velocity | Way | Switch, needed: set[str], more: Mapping[str, str] = _NO_NAMES
) -> None:
    """Check the names in a template; ``more``: others that it may have, each with the axis that it moves."""
    sizes = {f"{name}:{SIZE}": name for name in needed}
    found = {more.get(name, sizes.get(name, name)) for name in names_in([given.send, given.body])}
    if missing := needed - found:
        raise ValueError(f"{table} has no {{{min(missing)}}} in send or body, so nothing would move that axis")
    _refuse_strange(found - needed - more.keys())


def _refuse_strange(names: set[str]) -> None:
    if strange := {name for name in names if not (name.startswith("goto:/") or name == "lease")}:
        raise ValueError(f"a template names {{{min(strange)}}}, which is neither an axis nor known")


def names_in(template: Any) -> set[str]:
    """Return the names that a template contains."""
    if isinstance(template, Mapping):
        if template.keys() == SIGNED:
            return set()
        return set().union(*map(names_in, template.values()))
    if isinstance(template, list | tuple):
        return set().union(*map(names_in, template))
    return set(NAME.findall(template)) if isinstance(template, str) else set()
