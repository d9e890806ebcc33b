"""Write regular expressions of ECMA-262 as Python reads them, for generating texts that they match."""

from __future__ import annotations

import re
from functools import lru_cache
from itertools import groupby
from typing import Any, Final

from conformance.documents import patterns

# The letters of these many code points stand for those of a class that Python does not have.
_LAST: Final = 0x2000
_MOST_RANGES: Final = 40
_PART: Final = re.compile(
    r"\\[pP]\{[^}]*\}|\\u\{[0-9a-fA-F]+\}|\\u[dD][89abAB][0-9a-fA-F]{2}\\u[dD][c-fC-F][0-9a-fA-F]{2}"
    r"|\\u[0-9a-fA-F]{4}|\\x[0-9a-fA-F]{2}|\\c[A-Za-z]|\\k<[^>]*>|\(\?<(?![=!])[^>]*>|\\.|\[\^\]|\[\]|\(\?|.",
    re.DOTALL,
)
_CLASSES: Final = {r"\d": "0-9", r"\w": "A-Za-z0-9_"}
_OTHERS: Final = {r"\D": "[^0-9]", r"\W": "[^A-Za-z0-9_]", "[^]": r"[\s\S]", "[]": "(?!)", r"\-": r"\-", r"\/": "/"}


@lru_cache(maxsize=1024)
def for_python(pattern: str) -> str | None:
    """Return a pattern that Python reads; its texts match the given one, if not all of them. None: there is none."""
    try:
        patterns.check(pattern)
        written = _Writer(pattern).text()
        re.compile(written)
    except (patterns.PatternError, re.error, OverflowError, RecursionError):
        return None
    return written


class _Writer:
    """Writes one pattern."""

    def __init__(self, pattern: str) -> None:
        self._parts: list[str] = _PART.findall(pattern)
        opening = [part for part in self._parts if part == "(" or part.startswith("(?<")]
        self._groups = {part[3:-1]: number for number, part in enumerate(opening, 1) if part != "("}

    def text(self) -> str:
        written, in_class = "", False
        for part in self._parts:
            if in_class and part in {"[]", "[^]"}:  # a bracket in the class, and the end of the class
                written += rf"\{part}"
                in_class = False
                continue
            written += self._written(part, in_class=in_class)
            if part in {"[", "]"}:
                in_class = part == "["
        return written

    def _written(self, part: str, *, in_class: bool) -> str:
        if part in _OTHERS and not in_class:
            return _OTHERS[part]
        if part in _CLASSES or part[:2] in {r"\p", r"\P"}:
            members = _CLASSES.get(part) or _members(part)
            return members if in_class else f"[{members}]"
        if part.startswith("(?<"):
            return "("
        if part.startswith(r"\k<"):
            return f"(?:\\{self._groups[part[3:-1]]})"
        if part.startswith((r"\u", r"\x", r"\c")) and len(part) > 2:  # noqa: PLR2004 - more than the letter
            return re.escape(_character(part))
        return r"\[" if part == "[" and in_class else part


def _character(part: str) -> str:
    """Return the character of an escape."""
    if part.startswith(r"\c"):
        return chr(ord(part[2]) % 32)
    codes = [int(code, 16) for code in re.findall(r"\\[ux]\{?([0-9a-fA-F]+)", part)]
    return "".join(map(chr, codes)).encode("utf-16", "surrogatepass").decode("utf-16", "replace")


@lru_cache(maxsize=64)
def _members(escape: str) -> str:
    """Return characters of a Unicode property, as the content of a class."""
    found = [code for code in range(0x20, _LAST) if patterns.matches(escape, chr(code))]
    runs = [[code for _, code in run] for _, run in groupby(enumerate(found), lambda pair: pair[1] - pair[0])]
    if not runs:
        raise patterns.PatternError(f"no characters of {escape}")
    return "".join(f"{re.escape(chr(run[0]))}-{re.escape(chr(run[-1]))}" for run in runs[:_MOST_RANGES])


def with_python_patterns(value: Any) -> Any:
    """Return a copy of a description with patterns that Python reads; those that it cannot read are left out."""
    if isinstance(value, list):
        return [with_python_patterns(item) for item in value]
    if not isinstance(value, dict):
        return value
    result: dict[str, Any] = {}
    for key, item in value.items():
        if key == "pattern" and isinstance(item, str):
            written = item if patterns.is_plain(item) else for_python(item)
            result |= {} if written is None else {key: written}
        elif key == "patternProperties" and isinstance(item, dict):
            names = {name: name if patterns.is_plain(name) else for_python(name) for name in item}
            result[key] = {new: with_python_patterns(item[name]) for name, new in names.items() if new is not None}
        else:
            result[key] = with_python_patterns(item)
    return result
