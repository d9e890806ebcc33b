"""List all generated mutants of a contract pack, in an order that depends on the pack's descriptions alone."""

import json
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from conformance.contract.pack import Contract
from proof.mutation.messages import Change, Request
from proof.mutation.self_test import OpenPlace, self_test_of
from proof.selftest.generated import responses
from proof.selftest.generated.described import described_mutants
from proof.selftest.generated.mutant import (
    MODES,
    GeneratedMutant,
    Tally,
    altering_requests,
    classes_of_answers,
    of_answer,
    of_request,
)
from proof.selftest.generated.operators import NUMERIC, OPERATORS, Operator
from proof.selftest.generated.places import ITEM, Exchange, Place, exchanges, places


def _objects(value: Any, steps: tuple[str, ...]) -> list[dict[str, Any]]:
    found = [value]
    for step in steps:
        found = [item[step] for item in found if isinstance(item, dict) and step in item]
    return [item for item in found if isinstance(item, dict)]


def _rewritten(place: Place, edit: Callable[[dict[str, Any], str], bool]) -> Callable[[Tally], Change]:
    """Return a change that edits the JSON object that contains the field, before the robot reads the request."""
    *steps, name = place.steps

    def alter(request: Request) -> Request | None:
        try:
            value = json.loads(request.body) if place.exchange.concerns(request) else None
        except (ValueError, RecursionError):
            return None
        altered = [edit(item, name) for item in _objects(value, tuple(steps))]
        return request.copy(body=json.dumps(value).encode()) if any(altered) else None

    return altering_requests(alter)


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
        says = f"{place.exchange.name} takes a {place.label} that it must refuse ({operator})."
        make = _rewritten(place, edit)
        yield GeneratedMutant.of(operator, place.exchange, f"{place.label}:json", says, make, ("strict-input",))


_NULL = next(operator for operator in OPERATORS if operator.name == "null")
# Changes of whole responses that strike now and then.
_WHOLE = {"crossed": responses.cross_responses, "failing": responses.failing, "cut": responses.cut}
_UNSAFE = ("PUT", "POST", "PATCH", "DELETE")
#: Changes that no norm forbids, whatever the contract says.
BY_NORM = (
    OpenPlace(
        r"body-bom:[^:]+:body:xml",
        "A document of XML may begin with a byte order mark (XML 1.0 4.3.3), and every receiver has to take it "
        "(BP R4001); what forbids one is RFC 8259 8.1, of JSON.",
    ),
    OpenPlace(
        r"body-bom:[^:]+:body:text",
        "A stream of YAML may begin with a byte order mark, which is no part of its content (YAML 1.2.2 5.2); what "
        "forbids one is RFC 8259 8.1, of JSON.",
    ),
    OpenPlace(
        r"header-(drop|change):[^:]+:Vary",
        "Vary tells caches which clients a response is fit for: a response that may be cached needs it "
        "(RFC 9110 12.5.5), and the response to an unsafe method may not (9.2.3).",
        side="rest",
        methods=_UNSAFE,
    ),
    OpenPlace(
        r"header-more:[^:]+:Allow",
        "A method that Allow names in every response is the vendor's own (RFC 9110 10.2.1). The suite does not send "
        "it, as it may do anything.",
    ),
)


@cache
def every_change(contract: Contract) -> tuple[GeneratedMutant, ...]:
    """Return all generated changes, including those that break no clause of the contract."""
    found = [*_of_fields(contract), *_of_exchanges(contract)]
    return tuple({mutant.name: mutant for mutant in found}.values())


@cache
def generated_mutants(contract: Contract) -> tuple[GeneratedMutant, ...]:
    """Return the generated mutants: the changes that break a clause of the contract."""
    if not contract.is_claimed:
        return described_mutants(contract)
    return tuple(change for change in every_change(contract) if open_place(contract, change) is None)


def _of_fields(contract: Contract) -> Iterator[GeneratedMutant]:
    there = places(contract)
    members: dict[tuple[object, ...], set[str]] = defaultdict(set)
    for place in there:
        members[place.exchange, place.part, place.medium, place.steps[:-1]].add(place.steps[-1])
    for place in there:
        for operator in OPERATORS:
            if operator.fits(place):
                yield _at(operator, place)
        if place.part == "answer" and place.medium in {"json", "soap"} and place.kind not in {"object", "array"}:
            for mode in MODES:
                yield _at(_NULL, place, mode)
        if place.part == "request" and place.medium == "json":
            known = members[place.exchange, place.part, place.medium, place.steps]
            yield from of_lenience(place, frozenset(known))


def _at(operator: Operator, place: Place, mode: str = "") -> GeneratedMutant:
    name = f"{operator.name}@{mode}" if mode else operator.name
    when = f", {MODES[mode]}" if mode else ""
    says = f"{place.label} of {place.exchange.name} ({place.medium}) {operator.says}{when}."
    make = of_answer(operator, place, mode) if place.part == "answer" else of_request(operator, place)
    return GeneratedMutant.of(name, place.exchange, f"{place.label}:{place.medium}", says, make, _classes(place))


def _classes(place: Place) -> tuple[str, ...]:
    """Return the conformance classes whose checks read a field, most likely killer first."""
    own = place.exchange.classes
    if place.medium == "xml":
        return ("rest-formats", "strict-input", *own) if place.part == "request" else ("rest-formats", "http")
    if place.part == "request":
        return (*own, "strict-input")
    if place.medium == "soap":
        return (*own, "soap-basic-profile")
    return (*own, "rest-formats", "http")


def _of_exchanges(contract: Contract) -> Iterator[GeneratedMutant]:
    numeric = {place.exchange.name for place in places(contract) if place.part == "answer" and place.kind in NUMERIC}
    for exchange in exchanges(contract):
        yield from responses.of_statuses(exchange)
        yield from responses.of_headers(exchange)
        yield from responses.of_bodies(exchange, numbers=exchange.name in numeric)
        for what, make in _WHOLE.items():
            if what == "cut" and not exchange.formats:
                continue
            for mode, when in {"": "every time", **MODES}.items():
                yield _whole(exchange, what, mode, when, make)


def _whole(exchange: Exchange, what: str, mode: str, when: str, make: responses.Whole) -> GeneratedMutant:
    name = f"{what}@{mode}" if mode else what
    says, classes = f"{exchange.name}'s answer is {what}, {when}.", classes_of_answers(exchange)
    return GeneratedMutant.of(name, exchange, "answer", says, make(exchange, mode), classes)


def open_places(contract: Contract) -> tuple[OpenPlace, ...]:
    """Return the patterns of changes that break no clause of the norms or of the pack's contract."""
    return (*self_test_of(contract).open_places, *BY_NORM)


def open_place(contract: Contract, change: GeneratedMutant) -> OpenPlace | None:
    """Return the pattern that says why a change breaks no client; None if it breaks one."""
    exchange = change.exchange
    covering = (one for one in open_places(contract) if one.covers(change.name, exchange.side, exchange.method))
    return next(covering, None)
