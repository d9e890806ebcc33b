"""Mutants of items of a described device: a request to one item reaches another, or a refused one is performed."""

import re
from collections.abc import Callable, Iterator

from conformance.api.rest.things import collection_of
from conformance.documents.openapi import Operation, is_json
from proof.mutation.messages import Change, Forward, Request, Response
from proof.selftest.generated.mutant import GeneratedMutant, Tally
from proof.selftest.generated.places import Exchange

_SUCCESS, _REFUSED, _NO_TYPE = range(200, 300), range(400, 500), 415
# What a mutant does after a request to an item: request, response, another item, and the way to the device.
_Act = Callable[[Request, Response, str, Forward], Response | None]


def of_things(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants of an operation of an item, each of which needs another item that was read before."""
    rows: list[tuple[str, str, Callable[[], _Act]]] = []
    if operation.method == "GET":
        rows.append(("another-item", "answers with another item once after each refusal", _another))
    elif operation.method in {"PUT", "PATCH", "DELETE"}:
        rows.append(("reaches-another", "does the same to another item", lambda: _reaching))
    if operation.method in {"PUT", "PATCH"} and any(map(is_json, operation.bodies)):
        rows.append(("applies-refused", "writes what it refuses with 415", lambda: _applying))
    for operator, says, begin in rows if collection_of(operation.template) else ():
        name, make = f"{operator}:{exchange.name}:item", _after(exchange, operation, begin)
        yield GeneratedMutant(name, f"{exchange.name} {says}.", operator, exchange, exchange.classes, make)


def _after(exchange: Exchange, operation: Operation, begin: Callable[[], _Act]) -> Callable[[Tally], Change]:
    """Return a change that does something after each request to an item, once another item was read."""

    def make(tally: Tally) -> Change:
        read, act = dict[str, None](), begin()

        def change(request: Request, forward: Forward) -> Response:
            response = forward(request)
            if request.side != "rest" or re.fullmatch(exchange.path, request.path) is None:
                return response
            other = next((one for one in reversed(read) if one != request.path), "")
            if request.method == "GET" and response.status in _SUCCESS:
                read.pop(request.path, None)
                read[request.path] = None
            is_own = operation.method in {request.method, "GET"}
            altered = act(request, response, other, forward) if is_own and other else None
            if altered is None:
                return response
            tally()
            return altered

        return change

    return make


def _another() -> _Act:
    waits = [False]

    def act(request: Request, response: Response, other: str, forward: Forward) -> Response | None:
        waits[0] |= response.status in _REFUSED and request.method != "GET"
        if not waits[0] or request.method != "GET" or response.status not in _SUCCESS:
            return None
        waits[0] = False
        found = forward(request.copy(target=other))
        return found if found.status in _SUCCESS and found.body != response.body else None

    return act


def _reaching(request: Request, response: Response, other: str, forward: Forward) -> Response | None:
    if response.status not in _SUCCESS:
        return None
    return response if forward(request.copy(target=other)).status in _SUCCESS else None


def _applying(request: Request, response: Response, _: str, forward: Forward) -> Response | None:
    again = request.copy()
    again.put("Content-Type", "application/json")
    is_refused = response.status == _NO_TYPE and not is_json(request.media_type)
    return response if is_refused and forward(again).status in _SUCCESS else None
