"""Conversion between ROS messages and plain data (dicts, lists, str, int, float, bool)."""

import math
from collections.abc import Callable
from operator import attrgetter
from typing import Any

from reference_robot.webservices.representation.problems import not_yet
from reference_robot.webservices.representation.shapes import Record, Series, Shape, shape_of


def reader_of(message: Any) -> Callable[[Any], dict[str, Any]]:
    """Return a function that converts ROS messages of a class to dicts, lists and numbers.

    The function raises the Problem 503 for a value that is not finite, and names its field: such values must not be
    sent to clients (contract, REST).
    """
    shape = shape_of(message)
    read = _reader(shape)

    def to_plain(value: Any) -> dict[str, Any]:
        plain: dict[str, Any] = read(value)
        _require_finite(plain, shape.name)
        return plain

    return to_plain


def _require_finite(plain: Any, where: str) -> None:
    if isinstance(plain, float):
        if not math.isfinite(plain):
            raise not_yet(f"the robot measured a value that is not finite: {where} is {plain}")
    elif isinstance(plain, dict):
        for name, value in plain.items():
            _require_finite(value, f"{where}.{name}")
    elif isinstance(plain, list):
        for index, value in enumerate(plain):
            _require_finite(value, f"{where}[{index}]")


def message_from(shape: Record, plain: dict[str, Any]) -> Any:
    """Return the ROS message for a checked dict of its fields; missing fields keep ROS's defaults."""
    return shape.message(**{name: _value(shape.field(name), value) for name, value in plain.items()})


def _value(shape: Shape | None, plain: Any) -> Any:
    if isinstance(shape, Record):
        return message_from(shape, plain)
    if isinstance(shape, Series):
        return [_value(shape.item, item) for item in plain]
    return plain


def _reader(shape: Shape) -> Callable[[Any], Any]:
    if isinstance(shape, Record):
        parts = [(name, attrgetter(name), _reader(part)) for name, part in shape.fields]
        return lambda message: {name: read(get(message)) for name, get, read in parts}
    if isinstance(shape, Series):
        if isinstance(shape.item, (Record, Series)):
            read_item = _reader(shape.item)
            return lambda items: [read_item(item) for item in items]
        # ROS's numeric arrays are NumPy arrays or array.array; tolist of both returns Python numbers.
        return lambda items: items.tolist() if hasattr(items, "tolist") else list(items)
    return lambda value: value
