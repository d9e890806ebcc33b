"""List the mutants of a device of which only its description is known: members, answers, requests and HTTP itself."""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from conformance.api.rest.samples import sample
from conformance.contract.pack import Contract
from conformance.documents.json_schema import Schema
from conformance.documents.openapi import Operation, is_json, operations_of
from conformance.documents.representation import flat
from proof.mutation.messages import Change, Request, Response
from proof.selftest.generated import described_collections, described_http, described_promises, described_requests
from proof.selftest.generated import described_http as failures
from proof.selftest.generated.described_requests import breaks, undeclared_status, undeclared_type
from proof.selftest.generated.mutant import MODES, Alter, GeneratedMutant, Tally, answers, in_mode
from proof.selftest.generated.operators import OPERATORS
from proof.selftest.generated.places import Exchange, Place, fields_of, rest_exchange
from proof.selftest.generated.responses import BODIES, cross_responses
from proof.selftest.generated.slots import Edit, Slot, edit_message, same

_STATUSES = (200, 202, 204, 299, 400, 404, 409, 418, 422, 500, 502)
_TYPES = ("text/html", "text/plain", "application/xml", "application/octet-stream")
_SUCCESS, _ERRORS = range(200, 300), range(400, 500)
# Wrong bodies for any device: a number that JSON lacks, and an HTML page.
_MORE = {
    "body-nan": lambda body: re.sub(rb"(?<=[:\[,] )-?\d+(?:\.\d+)?|(?<=[:\[,])-?\d+(?:\.\d+)?", b"NaN", body, count=1),
    "body-html": lambda _: b"<html><body>It works</body></html>",
    "body-invalid-utf8": lambda body: body.replace(b'"', b'"\xe9', 1) if b'"' in body else body,
    "body-null": lambda _: b"null",
}
# The responses that a mutant alters, by the last part of its name.
_KINDS = {"answer": _SUCCESS, "error": _ERRORS}


@cache
def described_mutants(contract: Contract, base: str = "") -> tuple[GeneratedMutant, ...]:
    """Return all mutants of a described device.

    Args:
        contract: its description.
        base: path below which the operations are.
    """
    found: list[GeneratedMutant] = []
    for operation in operations_of(contract):
        exchange = replace(rest_exchange(contract, operation, base), name=operation.label)
        found += _of_operation(operation, exchange)
    return tuple({mutant.name: mutant for mutant in found}.values())


def _of_operation(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    description = replace(exchange, classes=("description",))
    yield from _of_fields(operation, description)
    yield from _of_statuses(operation, description)
    yield from _of_types(operation, description)
    yield from _of_bodies(operation, description)
    yield from _whole(operation, replace(exchange, classes=("robustness",)))
    yield from described_collections.of_lists(operation, description)
    yield from described_collections.of_things(operation, description)
    yield from described_promises.of_promises(operation, description)
    yield from described_requests.lenient(operation, description)
    yield from described_requests.strict(operation, description)
    yield from described_requests.crashing(operation, replace(exchange, classes=("robustness",)))
    yield from described_http.of_resource(operation, description)
    yield from described_http.of_http(operation, replace(exchange, classes=("http",)))


def _mutant(
    operator: str, exchange: Exchange, place: str, says: str, make: Callable[[Tally], Change]
) -> GeneratedMutant:
    return GeneratedMutant.of(operator, exchange, place, f"{exchange.name}: {says}.", make)


def _breaching(operation: Operation, exchange: Exchange, alter: Alter, mode: str = "") -> Callable[[Tally], Change]:
    """Return a change that alters a response only where the altered one breaks the description or JSON."""

    def alter_checked(request: Any, response: Response) -> Response | None:
        if not exchange.concerns(request) or breaks(operation, response):
            return None
        altered = alter(request, response)
        return altered if altered is not None and breaks(operation, altered) else None

    return in_mode(mode, alter_checked)


def _of_fields(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants of each member of JSON responses, successful ones and errors."""
    for status, content in operation.responses.items():
        schema = next((schema for name, schema in content.items() if is_json(name)), None)
        if schema is None:
            continue
        media_type = next(name for name in content if is_json(name))
        code = int(status) if status.isdigit() else {"2": 200, "4": 400}.get(status[0], 400)
        whole = Response(code, [("Content-Type", media_type)], json.dumps(sample(schema, whole=True)).encode())
        for place, part in fields_of(exchange, schema):
            for operator in FIELD_OPERATORS:
                for mode in ("", *MODES) if operator.name == "null" and code in _SUCCESS else ("",):
                    alter = _field_alter(operator, place, part, code)
                    tried = alter(Request("rest"), whole)
                    if tried is None or not breaks(operation, tried):
                        continue  # the schema leaves this open
                    name = f"{operator.name}@{mode}" if mode else operator.name
                    when = f", {MODES[mode]}" if mode else ""
                    where = f"{'.'.join(place.steps)} of {status}"
                    make = _breaching(operation, exchange, alter, mode)
                    yield _mutant(
                        name, exchange, f"{status}.{'.'.join(place.steps)}", f"{where} {operator.says}{when}", make
                    )


def _field_alter(operator: Any, place: Place, schema: Any, code: int) -> Alter:
    edit = operator.make(place, schema)

    def alter(_request: Any, response: Response) -> Response | None:
        if response.status != code:
            return None
        altered = response.copy()
        return altered if edit_message(place, altered, edit) else None

    return alter


def _kinds(operation: Operation) -> dict[str, range]:
    """Return the kinds of responses; an operation without inputs and declared errors has no errors to alter."""
    errs = operation.parameters or operation.bodies or any(status.startswith("4") for status in operation.responses)
    return _KINDS if errs else {"answer": _SUCCESS}


def _of_statuses(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants that answer with a status that is not declared."""
    for kind, within in _kinds(operation).items():
        for other in _STATUSES:
            if not undeclared_status(operation, Response(other)):
                continue

            def alter(_: Any, response: Response, other: int = other, within: range = within) -> Response | None:
                if response.status not in within:
                    return None
                altered = response.copy()
                altered.status, altered.reason = other, ""
                return altered

            make = _breaching(operation, exchange, alter)
            yield _mutant("status", exchange, f"{kind}-{other}", f"{kind} has the undeclared status {other}", make)


def _of_types(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants that send another media type than the declared ones."""
    for kind, within in _kinds(operation).items():
        for other in _TYPES:

            def alter(_: Any, response: Response, other: str = other, within: range = within) -> Response | None:
                altered = response.copy()
                altered.put("Content-Type", other)
                return altered if response.status in within and undeclared_type(operation, altered) else None

            make = _breaching(operation, exchange, alter)
            yield _mutant("type", exchange, f"{kind}-{other}", f"{kind} has the undeclared media type {other}", make)


def _of_bodies(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants whose whole body is no JSON, or an undeclared value."""
    for kind, within in _kinds(operation).items():
        for name, edit in {**BODIES, **_MORE}.items():

            def alter(_: Any, response: Response, edit: Any = edit, within: range = within) -> Response | None:
                altered = response.copy()
                altered.body = edit(altered.body)
                return altered if response.status in within and is_json(response.media_type) else None

            make = _breaching(operation, exchange, alter)
            yield _mutant(name, exchange, kind, f"the body of an {kind} is altered ({name})", make)


def _whole(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants that fail, cut, cross or refuse whole responses, always or now and then."""
    for mode, when in {"": "every time", **MODES}.items():
        suffix = f"@{mode}" if mode else ""
        fail = in_mode(mode, answers(exchange, lambda answer: answer.status in _SUCCESS, failures.make_failed))
        yield _mutant(f"failing{suffix}", exchange, "answer", f"fails with 500, {when}", fail)
        half = _breaching(operation, exchange, _halve, mode)
        yield _mutant(f"cut{suffix}", exchange, "answer", f"sends half of the body, {when}", half)
        lost = failures.hanging_up(exchange, mode)
        yield _mutant(f"hang-up{suffix}", exchange, "answer", f"closes the connection, {when}", lost)
        cross = cross_responses(exchange, mode, lambda answer: breaks(operation, answer))
        yield _mutant(f"crossed{suffix}", exchange, "answer", f"sends the answer before, {when}", cross)
    yield _mutant("hang", exchange, "answer", "does not answer", failures.hanging(exchange))
    yield _mutant("slower", exchange, "answer", "answers later every time", failures.slower(exchange))
    if "error" in _kinds(operation):
        yield _mutant("insides", exchange, "error", "shows a traceback in errors", failures.showing_insides(exchange))


def _halve(_: Any, response: Response) -> Response | None:
    altered = response.copy()
    altered.body = altered.body[: len(altered.body) // 2]
    return altered if response.status in _SUCCESS else None


@dataclass(frozen=True)
class FieldOperator:
    """One way to alter a member.

    Attributes:
        name: first part of the names of its mutants.
        says: the effect, as a clause about the member.
        make: makes the edit of a place with a schema.
    """

    name: str
    says: str
    make: Callable[[Place, Schema], Edit]


def _put(value_of: Callable[[Schema, Any], Any]) -> Callable[[Place, Schema], Edit]:
    """Return an edit that inserts a value made from the schema and the present value; None alters nothing."""

    def make(_place: Place, schema: Schema) -> Edit:
        flatter = flat(schema)

        def edit(slots: list[Slot]) -> bool:
            altered = False
            for slot in slots:
                before = slot.value()
                after = value_of(flatter, before)
                if after is not None and not same(before, after):
                    slot.put(after)
                    altered = True
            return altered

        return edit

    return make


def _above(schema: Schema, _value: Any) -> Any:
    bound = schema.get("maximum", schema.get("exclusiveMaximum"))
    return bound + 1 if isinstance(bound, int | float) and not isinstance(bound, bool) else None


def _below(schema: Schema, _value: Any) -> Any:
    bound = schema.get("minimum", schema.get("exclusiveMinimum"))
    return bound - 1 if isinstance(bound, int | float) and not isinstance(bound, bool) else None


def _long(schema: Schema, value: Any) -> Any:
    if isinstance(schema.get("maxLength"), int) and schema["maxLength"] <= 1 << 16:
        return "a" * (schema["maxLength"] + 1)
    if isinstance(schema.get("maxItems"), int) and isinstance(value, list) and value:
        return [value[0]] * (schema["maxItems"] + 1)
    return None


def _empty(schema: Schema, value: Any) -> Any:
    if isinstance(value, str) and (schema.get("minLength") or "pattern" in schema or "format" in schema):
        return ""
    return [] if isinstance(value, list) and schema.get("minItems") else None


def _item(_schema: Schema, value: Any) -> Any:
    return [*value[:-1], {"roaas": "x"}] if isinstance(value, list) and value else None


def _usual(name: str) -> FieldOperator:
    found = next(operator for operator in OPERATORS if operator.name == name and "json" in operator.media)
    return FieldOperator(name, found.says, lambda place, _schema: found.make(place))


FIELD_OPERATORS = (
    *(_usual(name) for name in ("drop", "null", "retype", "rename", "comma")),
    FieldOperator(
        "enum", "is none of the declared values", _put(lambda schema, _: "roaas" if "enum" in schema else None)
    ),
    FieldOperator(
        "format",
        "has not the declared format",
        _put(lambda schema, _: "roaas 17" if {"format", "pattern"} & schema.keys() else None),
    ),
    FieldOperator("above", "is above its maximum", _put(_above)),
    FieldOperator("below", "is below its minimum", _put(_below)),
    FieldOperator("long", "is longer than its maximum", _put(_long)),
    FieldOperator("empty", "is empty", _put(_empty)),
    FieldOperator("fraction", "is no whole number", _put(lambda _, value: value + 0.5 if type(value) is int else None)),
    FieldOperator("wrap", "is in a list", _put(lambda _, value: [value])),
    FieldOperator("item", "has an item of another type", _put(_item)),
)
