"""Query parameters that bound a member of the items of a list, such as ``min_volume``, ``since`` or ``price[lte]``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final, NamedTuple

from conformance.documents.json_schema import Schema, is_number, kinds_of
from conformance.documents.parameters import Parameter
from conformance.documents.representation import flat

_LEAST: Final = frozenset(
    {"min", "minimum", "from", "since", "after", "gte", "ge", "gt", "start", "newer", "lower", "begin", "above", "over"}
)
_MOST: Final = frozenset(
    {"max", "maximum", "to", "until", "till", "before", "lte", "le", "lt", "end", "older", "upper", "below", "under"}
)
# What a description says of one.
_SAYS_LEAST: Final = re.compile(
    r"at least|or more|or (?:later|after|newer|above|greater|higher)|not (?:before|below|less)|minimum|lower bound"
    r"|greater than|more than|later than|newer than|higher than|since|\bfrom\b|>=?",
    re.IGNORECASE,
)
_SAYS_MOST: Final = re.compile(
    r"at most|or less|or (?:earlier|before|older|below|fewer|lower)|not (?:after|above|more)|maximum|upper bound"
    r"|less than|fewer than|earlier than|older than|lower than|\bbefore\b|until|up to|<=?",
    re.IGNORECASE,
)
_WORD: Final = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_FREE: Final = frozenset({"", "date", "time", "datetime", "timestamp"})
_DATES: Final = ("date-time", "date")
_DAY: Final = re.compile(r"\d{4}-\d\d-\d\d")


class Bound(NamedTuple):
    """One such parameter.

    Attributes:
        parameter: the parameter.
        member: plain name of the member.
        is_least: whether items below it are left out; else those above.
        is_said: whether the description says so; else only its effect shows that.
    """

    parameter: Parameter
    member: str
    is_least: bool
    is_said: bool

    @staticmethod
    def rank(text: str) -> float | None:
        """Return the place of the parameter's text in its order; None if it has none."""
        found = _rank(text)
        return None if found is None else found[1]

    def excludes(self, text: str, value: Any) -> bool:
        """Return whether a value of the member lies on the wrong side of the parameter's text."""
        bound, own = _rank(text), _rank(value)
        if bound is None or own is None or bound[0] != own[0]:
            return False
        return own[1] < bound[1] - bound[2] if self.is_least else own[1] > bound[1] + bound[2]


def bound_of(parameter: Parameter, members: Mapping[str, Schema]) -> Bound | None:
    """Return what a parameter bounds, by its name, its type and its description; None where it is no bound."""
    words = [one.lower() for one in _WORD.findall(parameter.name)]
    kind = _kind(parameter.schema)
    for index in (0, -1) if words and kind else ():
        if words[index] not in _LEAST | _MOST:
            continue
        rest = "".join(words[1:] if index == 0 else words[:-1])
        named = [name for name in members if name == rest]
        dated = [name for name, one in members.items() if _kind(one) == "date-time"]
        found = named or (dated if rest in _FREE and kind in _DATES and len(dated) == 1 else [])
        if found and (kind in _DATES) is (_kind(members[found[0]]) in _DATES) and _kind(members[found[0]]):
            is_least = words[index] in _LEAST
            says = _SAYS_LEAST if is_least else _SAYS_MOST
            return Bound(parameter, found[0], is_least, bool(says.search(parameter.says)))
    return None


def _kind(schema: Schema) -> str:
    """Return "number", or the format of a date; empty for what has no order that everybody knows."""
    given = flat(schema)
    if kinds_of(schema) - {"null"} and kinds_of(schema) <= {"number", "integer", "null"} and "enum" not in given:
        return "number"
    return str(given.get("format")) if given.get("format") in _DATES else ""


def _rank(value: Any) -> tuple[str, float, float] | None:
    """Return the kind of a value, its place in its order, and how far another one may be from it; None without order.

    A time is shown in whole seconds, whatever a device compares.
    """
    if is_number(value):
        return "number", float(value), 0.0
    text = str(value)
    try:
        return "number", float(text), 0.0
    except ValueError:
        pass
    try:
        found = datetime.fromisoformat(text.upper())
    except ValueError:
        return None
    if _DAY.fullmatch(text):
        return "date", float(found.toordinal()), 0.0
    return ("time", found.timestamp(), 1.0) if found.tzinfo else None
