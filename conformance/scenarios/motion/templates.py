"""Fill the templates of a motion map, and read values at JSON pointers."""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Mapping
from typing import Any, Final

from conformance.statement.motion_calls import NAME, SIGNED, SIZE
from conformance.statement.motion_map import Angle, Axis

_PARTS: Final = ("x", "y", "z", "w")
# The axis about which each angle turns.
_ABOUT: Final[dict[Angle, str]] = {"roll": "x", "pitch": "y", "yaw": "z"}


class NoValueError(LookupError):
    """Raised when a template names an unknown value; the message names it."""


def fill(template: Any, values: Mapping[str, Any], answer: Any = None) -> Any:
    """Return a template with its values.

    Args:
        template: JSON; a text that is nothing but "{name}" becomes the value, in any other text the value is inserted.
        values: by name.
        answer: JSON that the device sent, for "{goto:POINTER}".

    Raises:
        NoValueError: a value is not known.
    """
    if isinstance(template, Mapping):
        if template.keys() == SIGNED:
            number = _value(template["sign_of"], values, answer)
            return template["negative" if isinstance(number, int | float) and number < 0 else "positive"]
        return {key: fill(item, values, answer) for key, item in template.items()}
    if isinstance(template, list | tuple):
        return [fill(item, values, answer) for item in template]
    if not isinstance(template, str):
        return template
    whole = NAME.fullmatch(template)
    if whole:
        return _value(whole[1], values, answer)
    return NAME.sub(lambda found: str(_value(found[1], values, answer)), template)


def _value(name: str, values: Mapping[str, Any], answer: Any) -> Any:
    if name in values:
        return values[name]
    source, _, pointer = name.partition(":")
    if pointer == SIZE and source in values:
        return abs(values[source]) if isinstance(values[source], int | float) else values[source]
    if source == "goto" and answer is not None:
        return at(answer, pointer)
    raise NoValueError(f"the template's {{{name}}} is not known")


def at(document: Any, pointer: str) -> Any:
    """Return the value at a JSON pointer (RFC 6901).

    Raises:
        NoValueError: there is none.
    """
    value = document
    for step in pointer.split("/")[1:]:
        key = step.replace("~1", "/").replace("~0", "~")
        try:
            value = value[int(key)] if isinstance(value, list) else value[key]
        except (LookupError, TypeError, ValueError) as error:
            raise NoValueError(f"the response has nothing at {pointer}") from error
    return value


def numbers_at(document: Any, pointers: Mapping[str, str]) -> dict[str, float]:
    """Return the numbers at JSON pointers by name; empty if one is missing."""
    return positions_at(document, pointers, {})


def angle_of(quaternion: Any, angle: Angle) -> float:
    """Return an angle of a quaternion, rad: an object with x, y, z and w, or four numbers in this order.

    Raises:
        NoValueError: it is none.
    """
    named = dict(zip(_PARTS, quaternion, strict=False)) if isinstance(quaternion, list) else quaternion
    parts = numbers_at(named, {part: f"/{part}" for part in _PARTS})
    length = math.hypot(*parts.values())
    if not 0 < length < math.inf:
        raise NoValueError("the response has no quaternion there")
    x, y, z, w = (one / length for one in parts.values())
    if angle == "roll":
        return math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    if angle == "pitch":
        return math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def quaternion_of(name: str, value: Any, axis: Axis) -> dict[str, Any]:
    """Return the components of a quaternion by names of templates; nothing if the axis has no ``angle``.

    What is no number, as a pattern in a body, stands for each of them.
    """
    if not axis.angle:
        return {}
    if not isinstance(value, int | float):
        return {f"{name}:/{part}": value for part in _PARTS}
    half = axis.radians(value) / 2
    turn = {_ABOUT[axis.angle]: math.sin(half), "w": math.cos(half)}
    return {f"{name}:/{part}": turn.get(part, 0.0) for part in _PARTS}


def positions_at(document: Any, pointers: Mapping[str, str], axes: Mapping[str, Axis]) -> dict[str, float]:
    """Return positions at JSON pointers by axis, and other numbers by their names; empty if one is missing."""
    try:
        found = {name: at(document, pointer) for name, pointer in pointers.items()}
        return {name: _position(one, axes.get(name)) for name, one in found.items()}
    except (NoValueError, TypeError, ValueError):
        return {}


def _position(value: Any, axis: Axis | None) -> float:
    if axis is not None and axis.angle and isinstance(value, list | Mapping):
        return axis.of_radians(angle_of(value, axis.angle))
    return float(value)


def seconds_of(stamp: Any) -> float | None:
    """Return a stamp in seconds: a number, a date (RFC 3339), or a ROS time (sec, nanosec); None if it is none."""
    if isinstance(stamp, bool):
        return None
    if isinstance(stamp, Mapping):
        parts = numbers_at(stamp, {"sec": "/sec", "nanosec": "/nanosec"})
        return parts["sec"] + parts["nanosec"] / 1e9 if parts else None
    if isinstance(stamp, int | float):
        return float(stamp)
    try:
        return dt.datetime.fromisoformat(str(stamp)).timestamp()
    except ValueError:
        return None
