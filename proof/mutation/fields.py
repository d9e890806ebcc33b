"""Edits of one member of a JSON value, which is named by its path, as ``pose.pose.position.x`` or ``0.type``.

They are for ``Row.json``, ``changes.values`` and ``changes.inputs``. An edit of a member that does not exist raises
KeyError, IndexError or TypeError; ``changes.guarded`` catches them for values that a client sends.
"""

import re
from collections.abc import Callable
from typing import Any


def _holder(value: Any, path: str) -> tuple[Any, Any]:
    """Return the object or list that holds the member, and the member's name or index in it."""
    *parents, last = path.split(".")
    for name in parents:
        value = value[int(name) if isinstance(value, list) else name]
    return value, int(last) if isinstance(value, list) else last


def value_at(value: Any, path: str) -> Any:
    """Return the member's value."""
    holder, name = _holder(value, path)
    return holder[name]


def field(path: str, by: Any) -> Callable[[Any], None]:
    """Return an edit that sets the member to ``by``, or to ``by(value)`` if that is a function."""

    def edit(value: Any) -> None:
        holder, name = _holder(value, path)
        holder[name] = by(holder[name]) if callable(by) else by

    return edit


def without(path: str) -> Callable[[Any], None]:
    """Return an edit that removes the member."""

    def edit(value: Any) -> None:
        holder, name = _holder(value, path)
        del holder[name]

    return edit


def swapped(one: str, other: str) -> Callable[[Any], None]:
    """Return an edit that swaps the values of two members."""

    def edit(value: Any) -> None:
        first, second = value_at(value, one), value_at(value, other)
        field(one, second)(value)
        field(other, first)(value)

    return edit


def each(*edits: Callable[[Any], Any]) -> Callable[[Any], None]:
    """Return an edit that makes several edits one after another."""

    def edit(value: Any) -> None:
        for one in edits:
            one(value)

    return edit


def scaled(factor: float) -> Callable[[float], float]:
    """Return a function that multiplies a number by ``factor``."""
    return lambda number: number * factor


def plus(by: float) -> Callable[[float], float]:
    """Return a function that adds ``by`` to a number."""
    return lambda number: number + by


def sliced(*bounds: int | None) -> Callable[[Any], Any]:
    """Return a function that returns a slice of a list."""
    return lambda items: items[slice(*bounds)]


def first_twice(items: list[Any]) -> list[Any]:
    """Return a list with its first item twice."""
    return [*items, *items[:1]]


def wrapped(name: str) -> Callable[[Any], Any]:
    """Return a function that puts a value into an object."""
    return lambda value: {name: value}


def each_with(**members: Any) -> Callable[[Any], Any]:
    """Return a function that sets members of each object in a list."""
    return lambda items: [{**item, **members} for item in items]


def replaced(pattern: str, by: str) -> Callable[[str], str]:
    """Return a function that replaces a pattern in a text."""
    return lambda text: re.sub(pattern, by, text)
