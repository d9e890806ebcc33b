"""The order of two values, where every reasonable way to sort agrees about it."""

import re
from collections.abc import Callable
from datetime import datetime
from typing import Any, Final

from conformance.documents.json_schema import is_number

# Texts that may be sorted by what they mean: numbers with units, durations, addresses, levels, days and months.
_MEANING: Final = re.compile(
    r"[\d+\-.].*|P[\dT].*|(?:off|none|low|minor|medium|moderate|high|major|severe|critical|urgent|fatal|emergency|trace"
    r"|debug|info|notice|warn|warning|error|alert|ok|good|bad|small|large|[sml]|x+[sl]"
    r"|(?:mon|tues?|wed(?:nes)?|thu(?:rs)?|fri|sat(?:ur)?|sun)(?:day)?|(?:jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)[a-z]*)",
    re.IGNORECASE | re.DOTALL,
)


def is_before(one: Any, other: Any) -> bool | None:
    """Return whether a value is less than another one; None where they are equal, or where that depends on the way.

    Numbers and times are compared by value, and texts only where all collations agree.
    """
    if is_number(one) and is_number(other):
        return None if one == other else bool(one < other)
    if not (isinstance(one, str) and isinstance(other, str)) or one == other:
        return None
    first, second = _instant(one), _instant(other)
    if first is not None and second is not None:
        is_comparable = (first.tzinfo is None) == (second.tzinfo is None) and first != second
        return first < second if is_comparable else None
    if not (one.isascii() and other.isascii()) or _MEANING.fullmatch(one) or _MEANING.fullmatch(other):
        return None
    said = {key(one) < key(other) for key in _KEYS} | {not key(other) < key(one) for key in _KEYS}
    return said.pop() if len(said) == 1 else None


def _natural(text: str) -> list[tuple[int, int, str]]:
    parts = re.findall(r"\d+|\D+", text.casefold())
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts]


def _without_punctuation(text: str) -> str:
    return "".join(one for one in text.casefold() if one.isalnum())


def _punctuation_first(text: str) -> str:
    return "".join(one if one.isalnum() else "\x00" for one in text.casefold())


_KEYS: Final[tuple[Callable[[str], Any], ...]] = (str, str.casefold, _natural, _without_punctuation, _punctuation_first)


def _instant(text: str) -> datetime | None:
    try:
        return datetime.fromisoformat(text) if re.match(r"\d{4}-\d\d", text) else None
    except ValueError:
        return None
