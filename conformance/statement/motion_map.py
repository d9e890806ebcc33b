"""The motion map: how any device is read, commanded and stopped (tables ``[motion.*]`` of a statement).

Operations are written as in ``--call``: "METHOD PATH", the path as the description has it. Positions in responses are
JSON pointers (RFC 6901). Bodies and paths are templates: "{yaw}" is the target of the axis yaw, "{seconds}" the
duration of a move, and "{goto:/uuid}" a value in the response to the last accepted move.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

import msgspec

from conformance.contract.toml_file import Finite, NotNegative, Positive

NAME: Final = re.compile(r"\{([^{}]+)\}")
"""A name in a template."""
Pointer = Annotated[str, msgspec.Meta(pattern=r"^(/.*)?$")]
Call = Annotated[str, msgspec.Meta(pattern=r"^[A-Z]+ /\S*$")]


class Axis(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One axis of a device.

    Attributes:
        at: where its position is in the response.
        limits: least and greatest target, in ``unit``.
        unit: for readers, such as rad, m or %.
        speed: the greatest speed on the way to a target, units per second; None: not declared.
        tolerance: how far from its target it may rest; None: that of the move.
    """

    at: Pointer
    limits: tuple[Finite, Finite]
    unit: str = ""
    speed: Positive | None = None
    tolerance: Positive | None = None

    def __post_init__(self) -> None:
        """Check the limits.

        Raises:
            ValueError: the first is not below the second.
        """
        if self.limits[0] >= self.limits[1]:
            raise ValueError(f"limits = {list(self.limits)} must be two numbers, the lesser one first")


class State(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where the device is.

    Attributes:
        read: the operation that says it.
        axes: by name, as templates name them.
        stamp: where the time of the reading is in the response, a number or a date (RFC 3339); empty: there is none.
        fresh_s: at least so often the position changes while the device moves, s.
    """

    read: Call
    axes: dict[str, Axis]
    stamp: Pointer = ""
    fresh_s: Positive = 0.5


class Goto(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the device is sent to a position.

    Attributes:
        send: the operation.
        body: its JSON, a template; None: it has no body.
        tolerance: how far from its target an axis may rest, in the axis's unit.
        seconds: the duration that the suite asks for, where a template has "{seconds}".
        within_s: time to reach any target, where no template has "{seconds}".
        settle_s: time beyond either, s.
        beyond_limits: what the device does with a target beyond its limits: "refused", "clamped", or "undefined".
        while_moving: what it does with a second move: it "displaces" the first, or is "refused".
    """

    send: Call
    tolerance: Positive
    body: Any = None
    seconds: Positive = 1.0
    within_s: Positive = 10.0
    settle_s: NotNegative = 0.5
    beyond_limits: Literal["refused", "clamped", "undefined"] = "undefined"
    while_moving: Literal["displaces", "refused"] = "displaces"


class Stop(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the device is stopped.

    Attributes:
        send: the operation.
        body: its JSON, a template; None: it has no body.
        rests_within_s: time from the request until the device rests, s.
    """

    send: Call
    body: Any = None
    rests_within_s: Positive = 0.5


class MotionMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a device moves.

    Attributes:
        state: where it is.
        goto: how it is sent to a position.
        stop: how it is stopped; None: not declared.
    """

    state: State
    goto: Goto
    stop: Stop | None = None

    def __post_init__(self) -> None:
        """Check that the templates name each axis, and nothing that is not known.

        Raises:
            ValueError: they do not.
        """
        axes, moved = set(self.state.axes), names_in([self.goto.send, self.goto.body])
        if missing := axes - moved:
            raise ValueError(f"goto has no {{{min(missing)}}} in send or body, so nothing would move that axis")
        stopped = names_in([self.stop.send, self.stop.body]) if self.stop else set()
        if strange := {name for name in moved - axes - {"seconds"} | stopped if not name.startswith("goto:/")}:
            raise ValueError(f"a template names {{{min(strange)}}}, which is neither an axis nor known")

    @property
    def calls(self) -> tuple[str, ...]:
        """The operations that the map names."""
        return (self.state.read, self.goto.send, *([self.stop.send] if self.stop else ()))

    def tolerance(self, axis: str) -> float:
        """Return how far from its target an axis may rest, in the axis's unit."""
        return self.state.axes[axis].tolerance or self.goto.tolerance


def names_in(template: Any) -> set[str]:
    """Return the names that a template contains."""
    if isinstance(template, Mapping):
        return set().union(*map(names_in, template.values()))
    if isinstance(template, list | tuple):
        return set().union(*map(names_in, template))
    return set(NAME.findall(template)) if isinstance(template, str) else set()


def shape_of(call: str) -> str:
    """Return an operation without the names in its path, which map and description may choose differently."""
    return NAME.sub("{}", call)
