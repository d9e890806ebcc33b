"""Mutants that mishandle PUT of a delivery."""

import re
from collections.abc import Callable

from proof.mutation.changes import problem, rest
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.paths import DELIVERIES, deliveries

MUTANTS = Table()
_mutant = MUTANTS.of_class("rest-delivery", "rest")

_NUMBER = re.compile(r"[+-]?(\d+(\.\d+)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NON_FINITE = re.compile(r"[+-]?(nan|inf|infinity|1e400|\d+e\d{3,})", re.IGNORECASE)
_LIST = rest("GET", DELIVERIES)
# Where the values are among a delivery path's segments: /robot/app/delivery/CODE/depot_x/VALUE/...
_CODE, _VALUES = 4, range(6, 17, 2)


def segments(edit: Callable[[int, str], str]) -> Callable[[Request], None]:
    """Return an edit of the values in a delivery's path; ``edit(index, text)`` returns the new text."""

    def apply(request: Request) -> None:
        parts = request.path.split("/")
        for place in (_CODE, *_VALUES):
            if place < len(parts):
                parts[place] = edit(place, parts[place])
        request.target = "/".join(parts)

    return apply


def lenient(place: int, text: str) -> str:
    """Return a valid value in place of one that is not a number: 0, or 3 for the message code."""
    if _NUMBER.fullmatch(text) or _NON_FINITE.fullmatch(text):
        return text
    return "3" if place == _CODE else "0"


def finite(place: int, text: str) -> str:
    """Return 0 in place of NaN or Infinity."""
    return "0" if _NON_FINITE.fullmatch(text) and place != _CODE else text


def any_code(place: int, text: str) -> str:
    """Return 3 in place of a message code that does not exist."""
    return (
        "3" if place == _CODE and re.fullmatch(r"[+-]?\d{1,40}", text) and text.lstrip("+0") not in {"3", "4"} else text
    )


def _value_like(pattern: str) -> Callable[[Request], bool]:
    compiled = re.compile(pattern)

    def where(request: Request) -> bool:
        parts = request.path.split("/") if deliveries(request) else []
        return any(compiled.fullmatch(parts[place]) for place in _VALUES if place < len(parts))

    return where


class OnlyOnce:
    """A change that answers a repeated delivery itself; if ``keyed``, only one with an Idempotency-Key."""

    def __init__(self, response: Callable[[Request], Response], *, keyed: bool = False) -> None:
        self._answer, self._keyed = response, keyed
        self._seen: set[str] = set()

    def __call__(self, request: Request, forward: Forward) -> Response:
        """Forward the request, unless it is such a delivery."""
        if deliveries(request) and (not self._keyed or request.field("Idempotency-Key")):
            if request.target in self._seen:
                return self._answer(request)
            self._seen.add(request.target)
        return forward(request)


_mutant("delivery-coffee-unknown", "put", "PUT of a coffee (code 4) returns 404.").instead(
    lambda request: deliveries(request) and request.path.split("/")[_CODE] == "4", problem(404, "code: 4 is not known")
)
