"""Shapes: the types and value ranges of fields in JSON and XML, most of them derived from ROS message classes."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Final

from rosidl_parser.definition import AbstractNestedType, AbstractString, Array, BasicType, NamespacedType


@dataclass(frozen=True)
class Real:
    """The type of a field that holds a finite IEEE 754 double (ROS float32 and float64)."""


@dataclass(frozen=True)
class Whole:
    """The type of a field that holds an integer between the bounds of its ROS type, both inclusive."""

    lowest: int
    highest: int


@dataclass(frozen=True)
class Text:
    """The type of a field that holds a string; the bounds of its length in characters are inclusive."""

    shortest: int = 0
    longest: int | None = None


@dataclass(frozen=True)
class Truth:
    """The type of a field that holds a boolean."""


@dataclass(frozen=True)
class Series:
    """The type of a field that holds a list of items; ``length`` is set for ROS arrays of fixed size."""

    item: Shape
    length: int | None = None


@dataclass(frozen=True)
class Record:
    """The type of an object with named fields, in the order of the ROS definition.

    ``optional`` names the fields that input may omit; ``message`` is the ROS class, if there is one.
    """

    name: str
    fields: tuple[tuple[str, Shape], ...]
    optional: frozenset[str] = frozenset()
    message: Any = field(default=None, compare=False)

    def field(self, name: str) -> Shape | None:
        """Return the type of a field; None if the record has no such field."""
        return dict(self.fields).get(name)


Shape = Real | Whole | Text | Truth | Series | Record

_WHOLE_NUMBERS: Final = {
    f"{sign}int{bits}": Whole(0, 2**bits - 1) if sign else Whole(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    for sign in ("", "u")
    for bits in (8, 16, 32, 64)
} | {"octet": Whole(0, 255)}

# The contract's fine print: input may omit every stamp; the present time is used instead.
_OPTIONAL: Final = {"std_msgs/Header": frozenset({"stamp"})}


@cache
def shape_of(message: Any) -> Record:
    """Return the types of the fields of a ROS message class that rosidl generated.

    Raises:
        TypeError: A field has a type that the web services do not support (wide characters, long double).
    """
    names = tuple(message.get_fields_and_field_types())
    shapes = tuple(_shape(slot) for slot in message.SLOT_TYPES)
    package = message.__module__.partition(".")[0]
    return Record(
        name=message.__name__,
        fields=tuple(zip(names, shapes, strict=True)),
        optional=_OPTIONAL.get(f"{package}/{message.__name__}", frozenset()),
        message=message,
    )


def _shape(slot: Any) -> Shape:
    if isinstance(slot, AbstractNestedType):
        return Series(_shape(slot.value_type), slot.size if isinstance(slot, Array) else None)
    if isinstance(slot, NamespacedType):
        return shape_of(getattr(importlib.import_module(".".join(slot.namespaces)), slot.name))
    if isinstance(slot, AbstractString):
        return Text(longest=getattr(slot, "maximum_size", None))
    if isinstance(slot, BasicType):
        if slot.typename in {"double", "float"}:
            return Real()
        if slot.typename == "boolean":
            return Truth()
        if slot.typename in _WHOLE_NUMBERS:
            return _WHOLE_NUMBERS[slot.typename]
    raise TypeError(f"no web representation of the ROS type {slot!r}")
