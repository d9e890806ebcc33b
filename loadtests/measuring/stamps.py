"""Stamps in messages: Unix time as a number, as ISO 8601, or as ROS writes it, and to which digit they are known."""

from datetime import UTC, datetime
from typing import Any, NamedTuple

import msgspec
from jsonpath import JSONPointer

#: Numbers from these on are Unix time in nanoseconds, microseconds and milliseconds: as seconds they lie after 5000.
_UNITS = ((1e17, 1e9), (1e14, 1e6), (1e11, 1e3))
_FLOAT_S = 1e-6  # what a 64-bit number can tell of today's Unix time, and what Python's `datetime` can


class Stamp(NamedTuple):
    """A stamp: Unix time, and the value of its last digit, in s."""

    seconds: float
    digit_s: float


def stamp_of(message: bytes, pointer: JSONPointer) -> Stamp | None:
    """Return the stamp in a JSON message: a number, an ISO 8601 text, or ROS's sec and nanosec; None without one."""
    try:
        value: Any = pointer.resolve(msgspec.json.decode(message), default=None)
        if isinstance(value, dict):
            whole: Any = value.get("sec", value.get("secs"))
            part: Any = value.get("nanosec", value.get("nsecs", 0))
            return Stamp(float(whole) + float(part) / 1e9, _FLOAT_S if part else 1.0)
        if isinstance(value, str) and not value.replace(".", "", 1).isdigit():
            moment = datetime.fromisoformat(value)
            seconds = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
            return Stamp(seconds, _digit(value.partition("T")[2].partition("+")[0].rstrip("Z")))
        number = float(value)
    except (msgspec.DecodeError, ValueError, TypeError, OverflowError, RecursionError):
        return None
    unit = next((unit for least, unit in _UNITS if number >= least), 1.0)
    return Stamp(number / unit, max(_digit(str(value)) / unit, _FLOAT_S))


def _digit(text: str) -> float:
    """Return the value of the last digit of a decimal number."""
    return float(max(10.0 ** -len(text.partition(".")[2]), _FLOAT_S))
