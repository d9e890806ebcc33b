"""Robots that mistreat the delivery PUT."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from conformance.selftest.mutants.changes import (
    altered,
    becomes,
    deliveries,
    instead,
    plain,
    problem,
    remembering,
    rewritten,
)
from conformance.selftest.mutants.mutant import Fault
from conformance.selftest.proxy import HangUpError

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Answer, Ask

_NUMBER = re.compile(r"[+-]?(\d+(\.\d+)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NON_FINITE = re.compile(r"[+-]?(nan|inf|infinity|1e400|\d+e\d{3,})", re.IGNORECASE)
# Where the values are among a delivery path's segments: /robot/app/delivery/CODE/depot_x/VALUE/...
_CODE, _VALUES = 4, range(6, 17, 2)


def segments(edit: Callable[[int, str], str]) -> Callable[[Ask], None]:
    """Alter the values in a delivery's path; ``edit`` gets a value's place and its text."""

    def apply(ask: Ask) -> None:
        parts = ask.path.split("/")
        for place in (_CODE, *_VALUES):
            if place < len(parts):
                parts[place] = edit(place, parts[place])
        ask.target = "/".join(parts)

    return apply


def lenient(place: int, text: str) -> str:
    """A value that is no number becomes 0, or code 3."""
    if _NUMBER.fullmatch(text) or _NON_FINITE.fullmatch(text):
        return text
    return "3" if place == _CODE else "0"


def finite(place: int, text: str) -> str:
    """A value that is not finite becomes 0."""
    return "0" if _NON_FINITE.fullmatch(text) and place != _CODE else text


def any_code(place: int, text: str) -> str:
    """Every code becomes one that there is."""
    return (
        "3" if place == _CODE and re.fullmatch(r"[+-]?\d{1,40}", text) and text.lstrip("+0") not in {"3", "4"} else text
    )


def _written(pattern: str) -> Callable[[Ask], bool]:
    compiled = re.compile(pattern)

    def where(ask: Ask) -> bool:
        parts = ask.path.split("/") if deliveries(ask) else []
        return any(compiled.fullmatch(parts[place]) for place in _VALUES if place < len(parts))

    return where


class _OnlyOnce:
    """The same delivery again is refused."""

    def __init__(self) -> None:
        self._seen: set[str] = set()

    def __call__(self, ask: Ask, forward: Callable[[Ask], Answer]) -> Answer:
        if deliveries(ask):
            if ask.target in self._seen:
                return problem(409, "code: this delivery was accepted before")(ask)
            self._seen.add(ask.target)
        return forward(ask)


def _hung_up(ask: Ask, forward: Callable[[Ask], Answer]) -> Answer:
    if deliveries(ask):
        raise HangUpError
    return forward(ask)


def _fault(name: str, says: str, id_: str, make: Any) -> Fault:
    return Fault(name, says, (f"rest-delivery/{id_}",), "rest", make)


def _page(answer: Answer) -> None:
    answer.status, answer.reason, answer.body = 200, "", b'{"accepted":true}'
    answer.put("Content-Type", "application/json")


FAULTS = (
    _fault("delivery-crashes", "A delivery is answered 500.", "put", altered(deliveries, becomes(500))),
    _fault(
        "delivery-coffee-unknown",
        "There is no coffee: code 4 is 404.",
        "put",
        instead(
            lambda ask: deliveries(ask) and ask.path.split("/")[_CODE] == "4", problem(404, "code: 4 is not known")
        ),
    ),
    _fault("delivery-silent", "A delivery is accepted by closing the connection.", "put", lambda: _hung_up),
    _fault(
        "delivery-sometimes-lost",
        "One delivery in 50 is answered 500.",
        "put-range",
        altered(deliveries, becomes(500), nth=50),
    ),
    _fault(
        "delivery-talks",
        "A delivery is answered 200 with a page.",
        "put-no-content",
        altered(deliveries, _page),
    ),
    _fault(
        "delivery-positive-only",
        "Negative coordinates are refused.",
        "put-range",
        instead(_written(r"-.*"), problem(422, "depot_x: negative")),
    ),
    _fault(
        "delivery-no-exponents",
        "Numbers with an exponent are refused.",
        "put-range",
        instead(_written(r"[+-]?[\d.]+[eE].*"), problem(422, "depot_x: no number")),
    ),
    _fault(
        "delivery-wants-no-body",
        "A body on the delivery is refused.",
        "put-body",
        instead(lambda ask: deliveries(ask) and bool(ask.body), problem(415, "a body is not expected")),
    ),
    _fault("delivery-only-once", "The same delivery again is 409.", "put-repeated", remembering(_OnlyOnce)),
    _fault(
        "delivery-text-is-zero",
        "Letters in place of a number count as 0.",
        "refuses-text",
        rewritten(deliveries, segments(lenient)),
    ),
    _fault(
        "delivery-takes-nan",
        "NaN and Infinity are accepted.",
        "refuses-non-finite",
        rewritten(deliveries, segments(finite)),
    ),
    _fault(
        "delivery-takes-any-code", "Any code is accepted.", "refuses-code", rewritten(deliveries, segments(any_code))
    ),
    _fault(
        "delivery-swallows",
        "Whatever stands in a delivery's path is accepted.",
        "refuses-text",
        instead(deliveries, plain(204)),
    ),
)
