"""Edits of one field of a JSON value, for ``Row.json``, ``values`` and ``inputs``; a field is named by its path.

The names in a path are separated by dots: ``pose.pose.position.x``, ``0.type``. An edit of a field that is not there
raises KeyError, IndexError or TypeError: ``guarded`` is for values that a client sends.
"""

from collections.abc import Callable
from typing import Any


def _holder(value: Any, path: str) -> tuple[Any, Any]:
    """Return the object or list that holds a field, and the field's name or index in it."""
    *parents, last = path.split(".")
    for name in parents:
        value = value[int(name) if isinstance(value, list) else name]
    return value, int(last) if isinstance(value, list) else last


def found(value: Any, path: str) -> Any:
    """Return the field's value."""
    holder, name = _holder(value, path)
    return holder[name]


def field(path: str, by: Any) -> Callable[[Any], None]:
    """Give the field another value, or the one that ``by`` returns for the value that it has."""

    def edit(value: Any) -> None:
        holder, name = _holder(value, path)
        holder[name] = by(holder[name]) if callable(by) else by

    return edit


def without(path: str) -> Callable[[Any], None]:
    """Remove the field."""

    def edit(value: Any) -> None:
        holder, name = _holder(value, path)
        del holder[name]

    return edit


def swapped(one: str, other: str) -> Callable[[Any], None]:
    """Exchange the values of two fields."""

    def edit(value: Any) -> None:
        first, second = found(value, one), found(value, other)
        field(one, second)(value)
        field(other, first)(value)

    return edit


def each(*edits: Callable[[Any], Any]) -> Callable[[Any], None]:
    """Make several edits, one after the other."""

    def edit(value: Any) -> None:
        for one in edits:
            one(value)

    return edit


def scaled(factor: float) -> Callable[[float], float]:
    """Return a change of a number: so many times as great."""
    return lambda number: number * factor


def plus(by: float) -> Callable[[float], float]:
    """Return a change of a number: so much greater."""
    return lambda number: number + by
