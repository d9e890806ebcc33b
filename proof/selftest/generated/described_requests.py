"""Mutants that treat requests otherwise than described: they accept, refuse or crash at some values.

A mutant of a described device alters a message only where one of these functions says that the altered message is a
breach. So nothing that norms and description leave open is ever counted, whatever the device sends.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import Any

import jsonschema_rs

from conformance.api.rest.samples import sample
from conformance.documents.json_schema import Schema, kinds_of, target_of_lazy
from conformance.documents.json_shape import Kept, validator_of
from conformance.documents.openapi import Operation, is_json
from proof.mutation.messages import Change, Forward, Request, Response
from proof.selftest.generated.described_collections import NOTHING, Input, inputs_of
from proof.selftest.generated.mutant import SUCCESS, GeneratedMutant, Tally, altering_requests
from proof.selftest.generated.places import Exchange

# Statuses that any HTTP server may send without a declaration (RFC 9110 15, OpenAPI 3.1 4.8.16).
ANY_SERVER = frozenset(
    {206, 304, 401, 403, 405, 406, 407, 408, 411, 412, 413, 414, 415, 416, 417, 421, 426, 428, 429, 431, 501, 503}
)


def valid(schema: Schema, value: Any) -> bool:
    """Return whether a value is valid by a schema and its formats; an unusable schema allows everything."""
    validator = _VALIDATORS.of(schema)
    try:
        return validator is None or bool(validator.is_valid(value))
    except (ValueError, TypeError, OverflowError):
        return False


def _validator(schema: Schema) -> Any:
    try:
        return validator_of(schema, lambda uri, value: valid(target_of_lazy(uri), value), validate_formats=True)
    except (ValueError, jsonschema_rs.ValidationError):
        return None


_VALIDATORS = Kept(_validator)


@lru_cache(maxsize=4096)
def _json(body: bytes) -> tuple[bool, Any]:
    try:
        return True, json.loads(body.decode("utf-8"), parse_constant=_no_constant)
    except (ValueError, RecursionError):
        return False, None


def _no_constant(name: str) -> Any:
    raise ValueError(name)


def undeclared_status(operation: Operation, answer: Response) -> bool:
    """Return whether the description declares statuses but not this one, which no web server sends by itself."""
    return (
        bool(operation.responses) and operation.response_key(answer.status) is None and answer.status not in ANY_SERVER
    )


def undeclared_type(operation: Operation, answer: Response) -> bool:
    """Return whether a body has another media type than those that are declared for its status."""
    content = operation.schemas_for(answer.status)
    return bool(content and answer.body) and not any(_names(name, answer.media_type) for name in content or ())


def _names(declared: str, given: str) -> bool:
    return declared in {given, "*/*"} or (declared.endswith("/*") and given.startswith(declared[:-1]))


def schema_of(operation: Operation, answer: Response) -> Schema | None:
    """Return the schema that is declared for a response's status and JSON media type, or None."""
    content = operation.schemas_for(answer.status) or {}
    if not is_json(answer.media_type):
        return None
    return next((schema for name, schema in content.items() if _names(name, answer.media_type)), None)


def broken_body(operation: Operation, answer: Response) -> bool:
    """Return whether a body that claims to be JSON is malformed (RFC 8259 2, 8.1), or invalid by its schema."""
    if answer.method == "HEAD" or not is_json(answer.media_type):
        return False
    is_read, value = _json(answer.body)
    schema = schema_of(operation, answer)
    if not is_read:
        return bool(answer.body) or schema is not None
    return schema is not None and not valid(schema, value)


def breaks(operation: Operation, answer: Response) -> bool:
    """Return whether a response breaks the description, or is JSON that is none."""
    return undeclared_status(operation, answer) or undeclared_type(operation, answer) or broken_body(operation, answer)


_LONG, _BIG = 1000, 10**9


def _mutant(
    operator: str, exchange: Exchange, item: Input, says: str, make: Callable[[Tally], Change]
) -> GeneratedMutant:
    return GeneratedMutant.of(operator, exchange, item.label, f"{exchange.name} {says} {item.label}.", make)


# The keywords that each mutant ignores. A format is only a remark (JSON Schema 2020-12, Validation 7.2.1).
_LOOSE: dict[str, tuple[str, ...]] = {
    "takes-type": ("type",),
    "takes-any-text": ("enum", "const"),
    "takes-below": ("minimum", "exclusiveMinimum"),
    "takes-above": ("maximum", "exclusiveMaximum"),
    "takes-short": ("minLength", "minItems"),
    "takes-long": ("maxLength", "maxItems"),
    "takes-form": ("pattern",),
}


def lenient(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants that ignore one rule of an input: values that break only that rule are accepted."""
    for item in inputs_of(operation):
        good = sample(item.schema)
        for operator, keys in _LOOSE.items():
            rules = [key for key in keys if key in item.schema]
            # In a path or query, everything is text: null has no meaning there.
            textual = "string" in kinds_of(item.schema)
            if rules and not (operator == "takes-type" and item.where != "body" and textual):
                yield _mutant(
                    operator, exchange, item, "does not look at a rule of", _taking(exchange, item, rules, good)
                )
        if item.required and item.where != "path":
            yield _mutant("takes-missing", exchange, item, "does not need", _filling(exchange, item, good))


def _taking(exchange: Exchange, item: Input, rules: list[str], good: Any) -> Callable[[Tally], Change]:
    free = {key: value for key, value in item.schema.items() if key not in rules}

    def forbidden(value: Any) -> bool:
        # Values that other keywords forbid too are left to the mutants of those.
        if value is NOTHING or valid(item.schema, value):
            return False
        return valid(free, value) or "type" in rules

    return _forwarding(
        exchange,
        lambda request: forbidden(item.read(exchange, request)),
        lambda request: item.write(exchange, request, good),
    )


def _filling(exchange: Exchange, item: Input, good: Any) -> Callable[[Tally], Change]:
    def missing(request: Request) -> bool:
        return item.there(request) and item.read(exchange, request) is NOTHING

    return _forwarding(exchange, missing, lambda request: item.write(exchange, request, good))


def _forwarding(
    exchange: Exchange, when: Callable[[Request], bool], edit: Callable[[Request], Request]
) -> Callable[[Tally], Change]:
    """Return a change that edits some requests of an operation."""
    return altering_requests(lambda request: edit(request) if exchange.concerns(request) and when(request) else None)


def strict(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants that refuse values that the description allows."""
    refusal = _refusal(operation)
    for item in inputs_of(operation):
        schema = item.schema
        values = [value for value in schema.get("enum", ()) if value is not None][:6]
        if kinds_of(schema) == {"boolean"}:
            values = [True, False]
        for value in values:
            yield _refusing("refuses-value", exchange, item, json.dumps(value), refusal, value)
        for key in ("minimum", "maximum", "default"):
            if key in schema and schema[key] is not None:
                yield _refusing(f"refuses-{key}", exchange, item, key, refusal, schema[key])
        for key in ("minLength", "maxLength"):
            if (
                isinstance(schema.get(key), int)
                and "pattern" not in schema
                and "format" not in schema
                and "enum" not in schema
            ):
                yield _refusing(f"refuses-{key}", exchange, item, key, refusal, None, schema[key])
        if not item.required:
            yield _refusing("refuses-optional", exchange, item, "any value", refusal)
            yield _needing(exchange, item, refusal)


Answer = Callable[[Response], Response]


def _refusal(operation: Operation) -> Answer:
    """Return the refusal that the description declares: 422 or 400."""
    status = next((code for code in (422, 400) if operation.response_key(code) is not None), 422)
    content = operation.schemas_for(status) or {}
    name, schema = next(((name, schema) for name, schema in content.items() if is_json(name)), ("application/json", {}))
    return _instead(status, name, json.dumps(sample(schema, whole=True) if schema else {}).encode())


def _instead(status: int, media_type: str, body: bytes) -> Answer:
    """Return an edit that replaces status and body of a response, and keeps its other fields."""

    def answer(response: Response) -> Response:
        altered = response.copy()
        altered.status, altered.reason, altered.body = status, "", body
        altered.put("Content-Type", media_type)
        return altered

    return answer


def _refusing(
    operator: str, exchange: Exchange, item: Input, says: str, refusal: Answer,
    value: Any = NOTHING, length: int | None = None,
) -> GeneratedMutant:  # fmt: skip
    def fits(given: Any) -> bool:
        if given is NOTHING or not valid(item.schema, given):
            return False
        if length is not None:
            return isinstance(given, str) and len(given) == length
        return value is NOTHING or (given == value and isinstance(given, bool) == isinstance(value, bool))

    made = _mutant(
        operator,
        exchange,
        item,
        f"refuses {says} of",
        _answering(exchange, lambda request: fits(item.read(exchange, request)), refusal),
    )
    return made if says == "any value" else _rename(made, says)


def _rename(mutant: GeneratedMutant, more: str) -> GeneratedMutant:
    return replace(mutant, name=f"{mutant.name}:{more}")


def _needing(exchange: Exchange, item: Input, refusal: Answer) -> GeneratedMutant:
    def missing(request: Request) -> bool:
        return item.there(request) and item.read(exchange, request) is NOTHING

    return _mutant("needs-optional", exchange, item, "needs the optional", _answering(exchange, missing, refusal))


def _answering(
    exchange: Exchange, when: Callable[[Request], bool], answer: Answer, *, anyway: bool = False
) -> Callable[[Tally], Change]:
    """Return a change that answers in the device's place; unless ``anyway``, where the device itself accepts."""

    def make(tally: Tally) -> Change:
        def change(request: Request, forward: Forward) -> Response:
            if not exchange.concerns(request) or not when(request):
                return forward(request)
            response = forward(request)
            if response.status not in SUCCESS and not anyway:
                return response
            tally()
            return answer(response)

        return change

    return make


def crashing(operation: Operation, exchange: Exchange) -> Iterator[GeneratedMutant]:
    """Yield mutants that fail with 500 for a kind of value in one input, or for a missing one."""
    kinds: dict[str, Callable[[Any], bool]] = {
        "crash-empty": lambda value: value == "",
        "crash-letters": lambda value: isinstance(value, str) and not value.isascii(),
        "crash-long": lambda value: isinstance(value, str) and len(value) > _LONG,
        "crash-quote": lambda value: isinstance(value, str) and "'" in value,
        "crash-null-byte": lambda value: isinstance(value, str) and "\x00" in value,
        "crash-big": lambda value: isinstance(value, int | float) and value > _BIG,
        "crash-negative": lambda value: isinstance(value, int | float) and value < 0,
        "crash-null": lambda value: value is None,
        "crash-type": lambda value: isinstance(value, dict | list),
    }

    failed = _instead(500, "text/plain", b"Internal Server Error")
    for item in inputs_of(operation):
        of = kinds_of(item.schema)
        for operator, strikes in kinds.items():
            numeric = operator in {"crash-big", "crash-negative"}
            if numeric and not of & {"integer", "number"}:
                continue
            if not numeric and operator not in {"crash-null", "crash-type"} and "string" not in of:
                continue
            if operator in {"crash-null", "crash-type"} and item.where != "body":
                continue
            if (item.where == "path" and operator == "crash-empty") or (
                operator == "crash-type" and of & {"object", "array"}
            ):
                continue

            def when(request: Request, item: Input = item, strikes: Callable[[Any], bool] = strikes) -> bool:
                value = item.read(exchange, request)
                return value is not NOTHING and strikes(value)

            yield _mutant(
                operator,
                exchange,
                item,
                "fails with 500 at a value of",
                _answering(exchange, when, failed, anyway=True),
            )
