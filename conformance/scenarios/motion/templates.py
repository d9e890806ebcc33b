"""Fill the templates of a motion map, and read values at JSON pointers."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import Any

from conformance.statement.motion_map import NAME


class NoValueError(LookupError):
    """Raised when a template names something that is not known; the message says what."""


def filled(template: Any, values: Mapping[str, Any], answer: Any = None) -> Any:
    """Return a template with its values.

    Args:
        template: JSON; a text that is nothing but "{name}" becomes the value, in any other text the value is inserted.
        values: by name.
        answer: JSON that the device sent, for "{goto:POINTER}".

    Raises:
        NoValueError: a value is not known.
    """
    if isinstance(template, Mapping):
        return {key: filled(item, values, answer) for key, item in template.items()}
    if isinstance(template, list | tuple):
        return [filled(item, values, answer) for item in template]
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
    try:
        return {name: float(at(document, pointer)) for name, pointer in pointers.items()}
    except (NoValueError, TypeError, ValueError):
        return {}


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
