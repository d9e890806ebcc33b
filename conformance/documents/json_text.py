"""Read JSON more strictly than most parsers (RFC 8259)."""

import codecs
import json
import math
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

_SHOWN: Final = 60
_BYTE_ORDER_MARK: Final = "a byte order mark before the JSON"
# Most digits of an integer: a longer one exceeds every double, and Python refuses to read 5,000 digits.
_DIGITS_READ = 400


@dataclass(frozen=True)
class JsonText:
    """The value of a JSON text, and its faults.

    Attributes:
        value: the value; None if the text is not JSON.
        malformed: why the text is not JSON, or empty.
        encoding: why the text is not UTF-8 without a byte order mark, or empty.
        non_finite: the first NaN, Infinity or number too large for a double, or empty.
        twice: the first name that occurs twice in one object, or empty.
    """

    value: Any = None
    malformed: str = ""
    encoding: str = ""
    non_finite: str = ""
    twice: str = ""

    @property
    def problem(self) -> str:
        """The first fault, or empty."""
        if self.non_finite:
            return f"the number {self.non_finite}"
        return self.malformed or self.encoding or (f"the name {self.twice!r} twice" if self.twice else "")

    @property
    def unreadable(self) -> str:
        """Why a usual parser cannot read the text, or empty; most accept a byte order mark and duplicate names."""
        if self.non_finite:
            return f"the number {self.non_finite}"
        return self.malformed or (self.encoding if self.encoding != _BYTE_ORDER_MARK else "")


class _Reader:
    """Hooks for ``json.loads`` that record faults which it tolerates."""

    def __init__(self) -> None:
        self.non_finite = ""
        self.twice = ""

    def constant(self, name: str) -> float:
        """Return NaN or Infinity, and record it as a fault."""
        self.non_finite = self.non_finite or name
        return {"NaN": math.nan, "Infinity": math.inf}.get(name, -math.inf)

    def real(self, lexeme: str) -> float:
        """Return a number with a fraction or exponent; record it if it is infinite."""
        number = float(lexeme)
        if math.isinf(number):
            self.non_finite = self.non_finite or lexeme[:40]
        return number

    def whole(self, lexeme: str) -> int | float:
        """Return an integer of any length; record it if it is too large for a double."""
        if len(lexeme) <= _DIGITS_READ:
            return int(lexeme)
        self.non_finite = self.non_finite or f"{lexeme[:12]}... ({len(lexeme)} digits)"
        return -math.inf if lexeme.startswith("-") else math.inf

    def members(self, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        """Return an object, and record the first duplicate name."""
        result = dict(pairs)
        if len(result) < len(pairs):
            counts = Counter(name for name, _ in pairs)
            self.twice = self.twice or next(name for name, count in counts.items() if count > 1)
        return result


@lru_cache(maxsize=4)
def read_json(body: bytes) -> JsonText:
    """Read a JSON text. Never raises.

    The result is cached for a moment, because several checks read the same body; it must not be changed.
    """
    encoding = ""
    if body.startswith(codecs.BOM_UTF8):
        encoding = _BYTE_ORDER_MARK
        body = body[3:]
    try:
        text = body.decode("utf-8")
    except UnicodeDecodeError as error:
        encoding = f"octets that are not UTF-8 at position {error.start}"
        text = body.decode("utf-8", "replace")
    reader = _Reader()
    value = None
    malformed = ""
    try:
        value = json.loads(
            text,
            object_pairs_hook=reader.members,
            parse_constant=reader.constant,
            parse_float=reader.real,
            parse_int=reader.whole,
        )
    except json.JSONDecodeError as error:
        malformed = f"not JSON: {error.msg} at line {error.lineno} column {error.colno}"
    except RecursionError:
        malformed = "JSON that is nested too deeply to be read"
    return JsonText(value, malformed, encoding, reader.non_finite, reader.twice)


def clip(value: Any) -> str:
    """Return a value as JSON text, truncated if it is long."""
    try:
        text = json.dumps(value)
    except (ValueError, RecursionError):
        text = type(value).__name__
    return text if len(text) <= _SHOWN else text[:_SHOWN] + "..."
