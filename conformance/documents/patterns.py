"""Match the regular expressions of schemas as ECMA-262 defines them, within a bounded time.

Most patterns of descriptions are plain: Rust's engine, which ``jsonschema_rs`` has, reads them as ECMA-262 does, in
linear time. The others go to ``regress``, which backtracks: in this process if the text is short enough for the
pattern, and else in a worker process that is ended after a deadline. Generators of texts get
them as Python reads them.
"""

from __future__ import annotations

import atexit
import json
import re
import subprocess
import sys
import threading
from functools import lru_cache
from itertools import groupby
from typing import Any, Final

import jsonschema_rs
import regress

_SECONDS: Final = 2.0  # longest time of one match in the worker process
_MOST_STEPS: Final = 200_000  # most steps of a match without the worker process (hundredths of a second)
# Pattern syntax that ECMA-262 and Rust read the same way: literals, groups, quantifiers, classes without brackets or
# &&.
_ESCAPE: Final = r"\\[dDwWntrfv\-.^$*+?()\[\]{}|/\\]"
_CLASS: Final = rf"\[\^?(?:{_ESCAPE}|[^\\\[\]&~\-]|(?<!-)-(?!-))+\]"
_PLAIN: Final = re.compile(
    rf"(?:{_ESCAPE}|{_CLASS}|[^\\\[\](){{}}*+?|.]|\((?:\?:)?(?![?*+])|\)|\|(?![?*+])|(?<![(|^*+?{{])[*+?]|\{{\d{{1,3}}(?:,\d{{0,3}})?\}}\??)*"
)
# Letters without a meaning after a backslash in ECMA-262, although other dialects know some.
_NO_ESCAPE: Final = frozenset("ACEFGHIJKLMNOQRTUVXYZaeghijlmoqyz")
_SYNTAX: Final = frozenset("^$\\.*+?()[]{}|/")
_UNICODE_ONLY: Final = re.compile(r"\\(?:[pP]|u)\{")
_PART: Final = re.compile(r"\\.|\[|\]|.", re.DOTALL)
_VARIABLE: Final = re.compile(r"[*+?|]|\{\d+,\d*\}|\\[1-9k]")
_QUANTIFIED_GROUP: Final = re.compile(r"\)(?:[*+]|\{)")
_WORKER: Final = """
import json, sys, regress
for line in sys.stdin:
    pattern, flags, text = json.loads(line)
    print(int(regress.Regex(pattern, flags).find(text) is not None), flush=True)
"""


class PatternError(ValueError):
    """Raised for a pattern that is no regular expression of ECMA-262; the message explains why."""


class SlowPatternError(PatternError):
    """Raised for a pattern that takes too long for a text."""


def matches(pattern: str, text: str) -> bool:
    """Return whether a pattern matches anywhere in a text.

    Raises:
        PatternError: it is no regular expression of ECMA-262.
        SlowPatternError: it takes too long.
    """
    if not text.isascii():  # JSON may contain half a surrogate pair, but the engines reject it
        text = text.encode("utf-16", "surrogatepass").decode("utf-16", "replace")
    plain = _native(pattern)
    if plain is not None:
        return bool(plain.is_valid(text))
    regex, source, flags = _compile(pattern)
    if _steps(pattern, len(text)) <= _MOST_STEPS:
        return regex.find(text) is not None
    return _matches_in_time(pattern, source, flags, text)


def is_plain(pattern: str) -> bool:
    """Return whether ``jsonschema_rs`` by itself reads a pattern as ECMA-262 does."""
    return _native(pattern) is not None


def check(pattern: str) -> None:
    """Check a pattern.

    Raises:
        PatternError: it is no regular expression of ECMA-262.
    """
    if not is_plain(pattern):
        _compile(pattern)


@lru_cache(maxsize=4096)
def _native(pattern: str) -> Any:
    if not _PLAIN.fullmatch(pattern):
        return None
    try:
        return jsonschema_rs.validator_for({"pattern": pattern})
    except ValueError:
        return None


@lru_cache(maxsize=4096)
def _compile(pattern: str) -> tuple[regress.Regex, str, str]:
    r"""Return a compiled pattern, its text for the engine, and its flags.

    JSON Schema asks for the flag u. Authors who do not know of it write ``\-`` outside of classes, which it forbids.
    """
    source = _without_needless_escapes(pattern)
    try:
        return regress.Regex(source, "u"), source, "u"
    except regress.RegressError as error:
        problem = str(error)
    if not _UNICODE_ONLY.search(source):
        try:
            return regress.Regex(source, ""), source, ""
        except regress.RegressError as error:
            problem = str(error)
    raise PatternError(f"the pattern {pattern[:200]!r} is no regular expression of ECMA-262: {problem}")


def _without_needless_escapes(pattern: str) -> str:
    written, in_class = [], False
    for part in _PART.findall(pattern):
        if len(part) == 1:
            in_class = (in_class or part == "[") and part != "]"
        elif part[1] in _NO_ESCAPE:
            problem = f"{part} has no meaning"
            raise PatternError(f"the pattern {pattern[:200]!r} is no regular expression of ECMA-262: {problem}")
        is_needless = len(part) > 1 and not part[1].isalnum() and part[1] not in _SYNTAX
        written.append(part[1:] if is_needless and not (in_class and part[1] == "-") else part)
    return "".join(written)


def _steps(pattern: str, length: int) -> float:
    """Return a bound of the steps that backtracking takes; infinite where a quantifier holds for a group."""
    if _QUANTIFIED_GROUP.search(pattern):
        return float("inf")
    return float(max(length, 2)) ** min(len(_VARIABLE.findall(pattern)) + 1, 100)


class _Worker:
    """A process that matches, and is ended when it takes too long; the next match starts another one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._slow: set[str] = set()

    def matches(self, pattern: str, source: str, flags: str, text: str) -> bool:
        with self._lock:
            if pattern not in self._slow:
                reply = self._reply(source, flags, text)
                if reply:
                    return reply == "1"
                self._slow.add(pattern)
        raise SlowPatternError(f"the pattern {pattern[:200]!r} takes too long")

    def _reply(self, source: str, flags: str, text: str) -> str:
        """Return the worker's reply; empty if none came in time."""
        if self._process is None:
            self._process = subprocess.Popen(  # noqa: S603 - this module's own program
                [sys.executable, "-P", "-c", _WORKER],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
            self._ask(self._process, "", "", "")  # starting the process must not count as time of the pattern
        timer = threading.Timer(_SECONDS, self._process.kill)
        timer.start()
        try:
            reply = self._ask(self._process, source, flags, text)
        except OSError:
            reply = ""
        timer.cancel()
        if not reply:
            self.end()
        return reply

    @staticmethod
    def _ask(process: subprocess.Popen[str], *question: str) -> str:
        if process.stdin is None or process.stdout is None:
            return ""
        process.stdin.write(json.dumps(question) + "\n")
        process.stdin.flush()
        return process.stdout.readline().strip()

    def end(self) -> None:
        """End the worker process, if there is one."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


_THE_WORKER: Final = _Worker()
atexit.register(_THE_WORKER.end)


@lru_cache(maxsize=4096)
def _matches_in_time(pattern: str, source: str, flags: str, text: str) -> bool:
    return _THE_WORKER.matches(pattern, source, flags, text)


_LAST: Final = 0x2000  # code points from here on are not listed when Python lacks a class
_MOST_RANGES: Final = 40  # most ranges of a class for which Python has none
_PYTHON_PART: Final = re.compile(
    r"\\[pP]\{[^}]*\}|\\u\{[0-9a-fA-F]+\}|\\u[dD][89abAB][0-9a-fA-F]{2}\\u[dD][c-fC-F][0-9a-fA-F]{2}"
    r"|\\u[0-9a-fA-F]{4}|\\x[0-9a-fA-F]{2}|\\c[A-Za-z]|\\k<[^>]*>|\(\?<(?![=!])[^>]*>|\\.|\[\^\]|\[\]|\(\?|.",
    re.DOTALL,
)
_CLASSES: Final = {r"\d": "0-9", r"\w": "A-Za-z0-9_"}
_OTHERS: Final = {r"\D": "[^0-9]", r"\W": "[^A-Za-z0-9_]", "[^]": r"[\s\S]", "[]": "(?!)", r"\-": r"\-", r"\/": "/"}


@lru_cache(maxsize=1024)
def for_python(pattern: str) -> str | None:
    """Return a pattern for Python that matches a subset of the given pattern's texts, or None."""
    try:
        check(pattern)
        written = _Writer(pattern).text()
        re.compile(written)
    except (PatternError, re.error, OverflowError, RecursionError):
        return None
    return written


class _Writer:
    """Writes one pattern."""

    def __init__(self, pattern: str) -> None:
        self._parts: list[str] = _PYTHON_PART.findall(pattern)
        opening = [part for part in self._parts if part == "(" or part.startswith("(?<")]
        self._groups = {part[3:-1]: number for number, part in enumerate(opening, 1) if part != "("}

    def text(self) -> str:
        written, in_class = "", False
        for part in self._parts:
            if in_class and part in {"[]", "[^]"}:  # the closing bracket of a class, or a bracket inside it
                written += rf"\{part}"
                in_class = False
                continue
            written += self._write(part, in_class=in_class)
            if part in {"[", "]"}:
                in_class = part == "["
        return written

    def _write(self, part: str, *, in_class: bool) -> str:
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
    found = [code for code in range(0x20, _LAST) if matches(escape, chr(code))]
    runs = [[code for _, code in run] for _, run in groupby(enumerate(found), lambda pair: pair[1] - pair[0])]
    if not runs:
        raise PatternError(f"no characters of {escape}")
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
            written = item if is_plain(item) else for_python(item)
            result |= {} if written is None else {key: written}
        elif key == "patternProperties" and isinstance(item, dict):
            names = {name: name if is_plain(name) else for_python(name) for name in item}
            result[key] = {new: with_python_patterns(item[name]) for name, new in names.items() if new is not None}
        else:
            result[key] = with_python_patterns(item)
    return result
