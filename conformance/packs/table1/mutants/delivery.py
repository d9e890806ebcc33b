"""Robots that mistreat the delivery PUT."""

import re
from collections.abc import Callable

from conformance.mutation.changes import JSON, altered, becomes, hanging_up, instead, page, plain, problem, rewritten
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.mutant import of_class
from conformance.packs.table1.mutants.paths import deliveries

_NUMBER = re.compile(r"[+-]?(\d+(\.\d+)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NON_FINITE = re.compile(r"[+-]?(nan|inf|infinity|1e400|\d+e\d{3,})", re.IGNORECASE)
# Where the values are among a delivery path's segments: /robot/app/delivery/CODE/depot_x/VALUE/...
_CODE, _VALUES = 4, range(6, 17, 2)


def segments(edit: Callable[[int, str], str]) -> Callable[[Request], None]:
    """Alter the values in a delivery's path; ``edit`` gets a value's place and its text."""

    def apply(request: Request) -> None:
        parts = request.path.split("/")
        for place in (_CODE, *_VALUES):
            if place < len(parts):
                parts[place] = edit(place, parts[place])
        request.target = "/".join(parts)

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


def _written(pattern: str) -> Callable[[Request], bool]:
    compiled = re.compile(pattern)

    def where(request: Request) -> bool:
        parts = request.path.split("/") if deliveries(request) else []
        return any(compiled.fullmatch(parts[place]) for place in _VALUES if place < len(parts))

    return where


class _OnlyOnce:
    """The same delivery again is refused."""

    def __init__(self) -> None:
        self._seen: set[str] = set()

    def __call__(self, request: Request, forward: Forward) -> Response:
        if deliveries(request):
            if request.target in self._seen:
                return problem(409, "code: this delivery was accepted before")(request)
            self._seen.add(request.target)
        return forward(request)


_mutant = of_class("rest-delivery", "rest")


MUTANTS = (
    _mutant("delivery-crashes", "A delivery is answered 500.", "put", altered(deliveries, becomes(500))),
    _mutant(
        "delivery-coffee-unknown",
        "There is no coffee: code 4 is 404.",
        "put",
        instead(
            lambda request: deliveries(request) and request.path.split("/")[_CODE] == "4",
            problem(404, "code: 4 is not known"),
        ),
    ),
    _mutant("delivery-silent", "A delivery is accepted by closing the connection.", "put", hanging_up(deliveries)),
    _mutant(
        "delivery-sometimes-lost",
        "One delivery in 50 is answered 500.",
        "put-range",
        altered(deliveries, becomes(500), nth=50),
    ),
    _mutant(
        "delivery-talks",
        "A delivery is answered 200 with a page.",
        "put-no-content",
        altered(deliveries, page(200, b'{"accepted":true}', JSON)),
    ),
    _mutant(
        "delivery-positive-only",
        "Negative coordinates are refused.",
        "put-range",
        instead(_written(r"-.*"), problem(422, "depot_x: negative")),
    ),
    _mutant(
        "delivery-no-exponents",
        "Numbers with an exponent are refused.",
        "put-range",
        instead(_written(r"[+-]?[\d.]+[eE].*"), problem(422, "depot_x: no number")),
    ),
    _mutant(
        "delivery-wants-no-body",
        "A body on the delivery is refused.",
        "put-body",
        instead(lambda request: deliveries(request) and bool(request.body), problem(415, "a body is not expected")),
    ),
    _mutant("delivery-only-once", "The same delivery again is 409.", "put-repeated", _OnlyOnce),
    _mutant(
        "delivery-text-is-zero",
        "Letters in place of a number count as 0.",
        "refuses-text",
        rewritten(deliveries, segments(lenient)),
    ),
    _mutant(
        "delivery-takes-nan",
        "NaN and Infinity are accepted.",
        "refuses-non-finite",
        rewritten(deliveries, segments(finite)),
    ),
    _mutant(
        "delivery-takes-any-code", "Any code is accepted.", "refuses-code", rewritten(deliveries, segments(any_code))
    ),
    _mutant(
        "delivery-swallows",
        "Whatever stands in a delivery's path is accepted.",
        "refuses-text",
        instead(deliveries, plain(204)),
    ),
)
