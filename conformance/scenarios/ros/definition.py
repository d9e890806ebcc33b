"""Definitions of ROS messages: fields, inner fields, and allowed values (design.ros2.org, IDL and interfaces)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

_ARRAY: Final = re.compile(r"sequence<(?P<items>.+?)(?:, (?P<most>\d+))?>|(?P<item>.+)\[(?P<count>\d+)\]")
_TEXT: Final = re.compile(r"w?string(?:<(\d+)>)?")
#: Least and greatest value of each integer type.
INTEGERS: Final[dict[str, tuple[int, int]]] = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    "octet": (0, 255),
}
FLOATS: Final = frozenset({"float", "double"})
#: Items of arrays that may be written in base64.
OCTETS: Final = frozenset({"uint8", "octet"})
#: Integer types that exceed a web client's double.
LONG: Final = frozenset({"int64", "uint64"})

Types = Mapping[str, Mapping[str, str]]


@dataclass(frozen=True)
class Shape:
    """The type of a field.

    Attributes:
        item: the type of its items, or of itself if it is no array.
        is_array: whether it is one.
        count: of a fixed array, how many items; None if they may be fewer or more.
        most: of a bounded one, at most.
    """

    item: str
    is_array: bool = False
    count: int | None = None
    most: int | None = None

    @property
    def is_message(self) -> bool:
        """Whether the items are messages."""
        return "/" in self.item

    @property
    def is_text(self) -> bool:
        """Whether the items are strings."""
        return _TEXT.fullmatch(self.item) is not None

    @property
    def longest(self) -> int | None:
        """How many characters a string may have at most; None means any number."""
        found = _TEXT.fullmatch(self.item)
        return int(found[1]) if found and found[1] else None

    @property
    def is_octets(self) -> bool:
        """Whether it is an array of octets."""
        return self.is_array and self.item in OCTETS


@lru_cache(4096)
def shape_of(declared: str) -> Shape:
    """Return the shape of a field by its declared type, such as "sequence<double, 3>"."""
    found = _ARRAY.fullmatch(declared)
    if found is None:
        return Shape(declared)
    if found["item"]:
        return Shape(found["item"], is_array=True, count=int(found["count"]), most=int(found["count"]))
    return Shape(found["items"], is_array=True, most=int(found["most"]) if found["most"] else None)


@dataclass(frozen=True)
class Definition:
    """The definition of one type.

    Attributes:
        root: its name.
        types: the fields of it and of all types in it, by type and name.
    """

    root: str
    types: Types

    def fields(self, name: str = "") -> Iterator[tuple[str, Shape]]:
        """Yield the fields of a type of the definition; empty means of the root."""
        for field, declared in self.types[name or self.root].items():
            # C++ and Python add this field to a message without fields.
            if field != "structure_needs_at_least_one_member":
                yield field, shape_of(declared)

    def at(self, pointer: str) -> Shape | None:
        """Return the shape at a JSON pointer, or None if there is no such field."""
        shape = Shape(self.root)
        for step in pointer.split("/")[1:]:
            if shape.is_array and step.isdecimal():
                shape = Shape(shape.item)
            elif shape.is_message and not shape.is_array and step in self.types[shape.item]:
                shape = shape_of(self.types[shape.item][step])
            else:
                return None
        return shape


def value_at(message: Any, pointer: str, missing: Any = None) -> Any:
    """Return the value at a JSON pointer; ``missing`` if there is none."""
    for step in pointer.split("/")[1:]:
        try:
            message = message[int(step)] if isinstance(message, list) else message[step]
        except (LookupError, TypeError, ValueError):
            return missing
    return message


def put_at(message: Any, pointer: str, value: Any) -> Any:
    """Return a message with a value at a JSON pointer; missing objects and array items are created."""
    step, _, rest = pointer[1:].partition("/")
    if not pointer:
        return value
    below = f"/{rest}" if rest else ""
    if step.isdecimal():
        items = list(message) if isinstance(message, list) else []
        items += [None] * (int(step) + 1 - len(items))
        items[int(step)] = put_at(items[int(step)], below, value)
        return items
    made = dict(message) if isinstance(message, dict) else {}
    key = step.replace("~1", "/").replace("~0", "~")
    made[key] = put_at(made.get(key), below, value)
    return made
