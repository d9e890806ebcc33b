"""Generated mutants that accept bad requests: a missing or misspelt field, or unknown fields."""

import json
from collections.abc import Callable, Iterator
from typing import Any

from proof.mutation.messages import Change, Forward, Request, Response
from proof.selftest.generated.mutant import GeneratedMutant, Tally
from proof.selftest.generated.places import ITEM, Place

_SUCCESS = range(200, 300)


def _objects(value: Any, steps: tuple[str, ...]) -> list[dict[str, Any]]:
    found = [value]
    for step in steps:
        found = [item[step] for item in found if isinstance(item, dict) and step in item]
    return [item for item in found if isinstance(item, dict)]


def _rewritten(place: Place, edit: Callable[[dict[str, Any], str], bool]) -> Callable[[Tally], Change]:
    """Return a change that edits the JSON object that contains the field, before the robot reads the request."""
    *steps, name = place.steps

    def make(tally: Tally) -> Change:
        def change(request: Request, forward: Forward) -> Response:
            if not place.exchange.concerns(request):
                return forward(request)
            try:
                value = json.loads(request.body)
            except (ValueError, RecursionError):
                return forward(request)
            altered = [edit(item, name) for item in _objects(value, tuple(steps))]
            if not any(altered):
                return forward(request)
            response = forward(request.copy(body=json.dumps(value).encode()))
            if response.status in _SUCCESS:
                tally()
            return response

        return change

    return make


_DEFAULTS: dict[str, Any] = {"number": 0.0, "integer": 0, "boolean": False}


def of_lenience(place: Place, known: frozenset[str]) -> Iterator[GeneratedMutant]:
    """Yield mutants that fill in a missing JSON field, accept its name in any case, or ignore unknown fields in it.

    Args:
        place: the field.
        known: names of the fields inside it.
    """

    def fill(item: dict[str, Any], name: str) -> bool:
        if name in item:
            return False
        item[name] = _DEFAULTS.get(place.kind, place.example or "")
        return True

    def fold(item: dict[str, Any], name: str) -> bool:
        other = next((key for key in item if key != name and key.lower() == name.lower()), None)
        if other is None:
            return False
        item[name] = item.pop(other)
        return True

    def strip(item: dict[str, Any], name: str) -> bool:
        inside = item.get(name)
        if not isinstance(inside, dict):
            return False
        strange = [key for key in inside if key not in known]
        for key in strange:
            del inside[key]
        return bool(strange)

    edits = {"strip": strip} if place.kind == "object" else {"fill": fill, "fold": fold}
    if place.kind == "array" or not place.required or ITEM in place.steps:
        return
    for operator, edit in edits.items():
        yield GeneratedMutant(
            f"{operator}:{place.exchange.name}:{place.label}:json",
            f"{place.exchange.name} takes a {place.label} that it must refuse ({operator}).",
            operator,
            place.exchange,
            ("strict-input",),
            _rewritten(place, edit),
        )
