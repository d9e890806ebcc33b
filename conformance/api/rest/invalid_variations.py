"""Requests for one operation that its description forbids: each breaks one rule."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

from conformance.api.rest.inputs import FORM, MULTIPART, NOTHING, Inputs, body_verdict, parameter_verdict
from conformance.api.rest.samples import alike_and_apart, beside_pattern, fits, sample
from conformance.api.rest.validity import INVALID
from conformance.api.rest.variations import (
    ACCEPT,
    DEPTH,
    LONG,
    NO_FORMAT,
    UNKNOWN,
    Kind,
    Steps,
    Variation,
    clip,
    place_of,
    with_member,
)
from conformance.documents.json_schema import Schema, is_number, kinds_of
from conformance.documents.openapi import Operation, is_json
from conformance.documents.representation import flat

# Media types that hardly any API accepts.
_OTHER_TYPES: Final = ("text/plain", "application/xml")
# Longest array that is sent: a longer one would test load.
_MOST_ITEMS: Final = 100
# Lists in each other, which parsers that call themselves for each do not survive.
_NESTED: Final = 20_000
_LISTS: Final = f"{_NESTED:,} lists in each other"
_LIST: Final = "a list instead of an object"
#: What the bodies that are no object say of themselves.
NO_OBJECT: Final = frozenset({_LIST, _LISTS})
# Response formats that are requested together with a wrong value, at most.
_FORMATS: Final = 3
# Why a value is wrong, for the two faults that frameworks refuse for every parameter.
_OTHER_TYPE: Final = "which has another type"
NO_WHOLE_NUMBER: Final = "which is no whole number"
_NOT_ASCII: Final = "which is none of its values, and beyond ASCII"
_BOUNDS: Final = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
_BEYOND: Final = frozenset({"beyond its maximum", "at its exclusiveMaximum"})
_COMMON: Final = frozenset({_OTHER_TYPE, _NOT_ASCII})


def invalid_variations(operation: Operation, usual: Inputs) -> Iterator[Variation]:
    """Yield requests that the description forbids: each breaks one rule, however its text is read."""
    yield from _invalid_parameters(operation, usual)
    if usual.media_type in {FORM, MULTIPART} and isinstance(usual.body, dict):
        found = _invalid_fields(usual, usual.body, flat(operation.bodies[usual.media_type].schema))
        yield from (variation for variation in found if body_verdict(operation, variation.inputs) == INVALID)
    if not is_json(usual.media_type) or usual.media_type not in operation.bodies:
        return
    body = operation.bodies[usual.media_type]
    if operation.body_required:
        yield Variation(Kind.MISSING, "no body", "body", replace(usual, body=b""))
    yield Variation(Kind.MALFORMED, "a body that is not JSON", "body", replace(usual, body=b'{"roaas": '))
    # RFC 8259 8.1: JSON is UTF-8.
    not_utf8 = replace(usual, body=b'{"roaas": "\xff\xfe"}')
    yield Variation(Kind.MALFORMED, "a body that is not UTF-8", "body", not_utf8)
    if "object" in kinds_of(body.schema) and len(kinds_of(body.schema)) == 1:
        yield Variation(Kind.INVALID, _LIST, "body", replace(usual, body=[]))
        nested = replace(usual, body=b"[" * _NESTED + b"]" * _NESTED)
        yield Variation(Kind.INVALID, _LISTS, "body", nested)
    # A value that one alternative of a union forbids may be allowed by another alternative.
    found = _invalid_parts(usual, usual.body, body.schema, ())
    # A merge patch leaves out what it does not change (RFC 7396).
    is_whole = "merge-patch" not in usual.media_type
    yield from (
        variation
        for variation in found
        if not fits(body.schema, variation.inputs.body) and (is_whole or variation.kind is Kind.INVALID)
    )


def _invalid_parameters(operation: Operation, usual: Inputs) -> Iterator[Variation]:
    """Yield requests without a required parameter, and with a wrong value of one."""
    for item in operation.parameters:
        place = f"{item.where} {item.name}"
        if item.required and item.where != "path" and parameter_verdict(operation, item, NOTHING) == INVALID:
            without = usual.having(item.where, item.name, NOTHING)
            yield Variation(Kind.MISSING, f"no {place}", place, without)
        formats = operation.formats[1:_FORMATS]
        for value, why in _wrong_values(item.schema, usual.at(item.where).get(item.name)):
            if parameter_verdict(operation, item, value) == INVALID:
                changed = usual.having(item.where, item.name, value)
                says = f"{clip(value)} as {place}, {why}"
                yield Variation(Kind.INVALID, says, place, changed, is_common=why in _COMMON)
                if item.where == "query" and why in _BEYOND:
                    beside = _beside(operation, changed)
                    yield from (Variation(Kind.INVALID, f"{says}, with {name}", place, one) for name, one in beside)
                # Request other response formats too: a device may handle them by another path through its code.
                for name in formats:
                    other = replace(changed, accept=name)
                    yield Variation(Kind.INVALID, f"{says}, with Accept: {name}", place, other)
                formats = ()


def _beside(operation: Operation, inputs: Inputs) -> Iterator[tuple[str, Inputs]]:
    """Yield inputs with a value of one more parameter: a filter may have a path of its own through the code."""
    for item in operation.parameter("query"):
        values = [True] if kinds_of(item.schema) == {"boolean"} else flat(item.schema).get("enum", ())
        if item.name not in inputs.query and values:
            yield item.name, inputs.having("query", item.name, values[0])
            break


def _invalid_parts(usual: Inputs, value: Any, schema: Schema, steps: Steps) -> Iterator[Variation]:
    """Yield bodies in which one member or item within ``value`` is missing or wrong; optional ones are added first."""
    if isinstance(value, dict):
        yield from _invalid_members(usual, value, schema, steps)
    items = flat(schema).get("items")
    if isinstance(value, list) and isinstance(items, dict) and not flat(schema).get("prefixItems"):
        first = value[0] if value else sample(items, whole=True)
        filled = replace(usual, body=with_member(usual.body, steps, [first, *value[1:]]) if steps else [first])
        yield from _invalid_part(filled, first, items, (*steps, 0))


def _invalid_part(usual: Inputs, value: Any, schema: Schema, here: Steps) -> Iterator[Variation]:
    """Yield bodies with a forbidden value in one place, then with one inside the value in that place."""
    place = place_of(here)
    for wrong, why in _invalid_values(schema):
        body = with_member(usual.body, here, wrong)
        says, changed = f"{clip(wrong)} as {place}, {why}", replace(usual, body=body)
        yield Variation(Kind.INVALID, says, place, changed, is_common=why in _COMMON)
    if len(here) <= DEPTH:
        yield from _invalid_parts(usual, value, schema, here)


def _invalid_members(usual: Inputs, value: dict[str, Any], schema: Schema, steps: Steps) -> Iterator[Variation]:
    """Yield bodies in which one member is missing or wrong."""
    flatter = flat(schema)
    for name, part in list(flatter.get("properties", {}).items()):
        here = (*steps, name)
        place = place_of(here)
        if part.get("readOnly"):
            continue
        if name in flatter.get("required", ()):
            body = with_member(usual.body, here, NOTHING)
            yield Variation(Kind.MISSING, f"no {place}", place, replace(usual, body=body))
        inner, filled = value.get(name), usual
        if inner is None and kinds_of(part) & {"object", "array"}:
            inner = sample(part, whole=True)
            filled = replace(usual, body=with_member(usual.body, here, inner))
        yield from _invalid_part(filled, inner, part, here)
    if flatter.get("additionalProperties") is False:
        here = (*steps, "roaas_unknown")
        body = with_member(usual.body, here, 1)
        yield Variation(Kind.INVALID, "a member that the schema excludes", place_of(here), replace(usual, body=body))


def _invalid_values(schema: Schema) -> Iterator[tuple[Any, str]]:
    """Yield JSON values that a schema forbids, with the rule that each breaks."""
    kinds = kinds_of(schema)
    merged = flat(schema)
    if not kinds:
        return
    for value, why in _beyond(merged):
        if not fits(schema, value):
            yield value, why
    # An enumeration may have no type. A program that takes texts may take any number as one.
    bounds = {key: merged[key] for key in _BOUNDS if isinstance(merged.get(key), int | float)}
    fraction = math.floor(sample({**bounds, "type": "integer"})) + 0.5
    if "integer" in kinds and "string" not in kinds and not fits(schema, fraction):
        yield fraction, NO_WHOLE_NUMBER
    # Every framework refuses an object in place of a scalar, and a word in place of a number; many take 1 for "1".
    for value in ({"roaas": 1}, UNKNOWN, 17):
        is_plain = isinstance(value, str) or (isinstance(value, int) and kinds <= {"object", "array", "boolean"})
        if not fits(schema, value) and (is_plain or isinstance(value, dict)):
            yield value, _OTHER_TYPE if "enum" not in merged else "which is none of its values"
            break
    if kinds & {"number", "integer"} and "string" not in kinds and not fits(schema, value=False):
        yield from ((False, _OTHER_TYPE), (str(math.floor(fraction)), _OTHER_TYPE))
    elif "boolean" in kinds and not fits(schema, "true"):
        yield "true", _OTHER_TYPE


def _beyond(schema: Schema) -> Iterator[tuple[Any, str]]:
    """Yield values just outside a schema's bounds."""
    for key, step in (("minimum", -1), ("maximum", 1), ("exclusiveMinimum", 0), ("exclusiveMaximum", 0)):
        bound = schema.get(key)
        if isinstance(bound, int | float) and not isinstance(bound, bool):
            yield bound + step, f"beyond its {key}" if step else f"at its {key}"
    factor, made = schema.get("multipleOf"), sample(schema)
    if isinstance(factor, int | float) and is_number(made) and factor not in (0, 1):
        between = made + (1 if kinds_of(schema) == {"integer"} else factor / 2)
        yield between, "which is no multiple of its multipleOf"
    yield from _beyond_texts(schema)
    if isinstance(schema.get("enum"), list) and schema["enum"]:
        yield UNKNOWN, "which is none of its values"
        if all(isinstance(item, str) for item in schema["enum"]):
            yield f"{UNKNOWN}é", _NOT_ASCII
    if isinstance(schema.get("maxItems"), int) and schema["maxItems"] <= _MOST_ITEMS:
        items, count = schema.get("items"), schema["maxItems"] + 1
        one = sample(items if isinstance(items, dict) else {})
        # Equal items may be refused for that.
        apart = alike_and_apart({**schema, "minItems": count})[1]
        yield apart or [copy.deepcopy(one) for _ in range(count)], "with more items than its maxItems"
    if isinstance(schema.get("minItems"), int) and 0 < schema["minItems"] <= _MOST_ITEMS:
        items = schema.get("items")
        one = sample(items if isinstance(items, dict) else {})
        yield [copy.deepcopy(one) for _ in range(schema["minItems"] - 1)], "with fewer items than its minItems"
    if schema.get("uniqueItems") is True and (alike := alike_and_apart(schema)[0]):
        yield alike, "with equal items, although they are to be unique"


def _beyond_texts(schema: Schema) -> Iterator[tuple[Any, str]]:
    """Yield texts just outside a schema's bounds."""
    if isinstance(schema.get("maxLength"), int) and schema["maxLength"] <= LONG:
        yield "a" * (schema["maxLength"] + 1), "longer than its maxLength"
    if isinstance(schema.get("minLength"), int) and 0 < schema["minLength"] <= LONG:
        yield "a" * (schema["minLength"] - 1), "shorter than its minLength"
    if isinstance(schema.get("pattern"), str):
        yield from ((one, "which its pattern excludes") for one in beside_pattern(schema) or ["~ roaas ~"])


def _invalid_fields(usual: Inputs, body: dict[str, Any], schema: Schema) -> Iterator[Variation]:
    """Yield forms without a required field, and with a wrong value of a field."""
    for name, part in schema.get("properties", {}).items():
        place = place_of((name,))
        if name in schema.get("required", ()):
            less = {key: item for key, item in body.items() if key != name}
            yield Variation(Kind.MISSING, f"no field {name}", place, replace(usual, body=less))
        for value, why in _wrong_values(part, body.get(name)):
            changed = replace(usual, body={**body, name: value})
            yield Variation(Kind.INVALID, f"{clip(value)} as {place}, {why}", place, changed)


def _wrong_values(schema: Schema, usual: Any) -> Iterator[tuple[Any, str]]:
    """Yield values that a schema forbids; not all are wrong as they are written, where each value is a text."""
    kinds, merged = kinds_of(schema), flat(schema)
    if kinds & {"object", "array"} and usual is None:
        usual = sample(schema, whole=True)
    if "object" in kinds and isinstance(usual, dict):
        for name in merged.get("required", ()):
            yield {key: item for key, item in usual.items() if key != name}, f"without {name}"
        for name, part in merged.get("properties", {}).items():
            for value, why in _wrong_scalars(part):
                yield {**usual, name: value}, f"whose {name} is {clip(value)}, {why}"
    elif "array" in kinds:
        yield from ((value, why) for value, why in _beyond(merged) if isinstance(value, list))
        items = merged.get("items")
        for value, why in _wrong_scalars(items) if isinstance(items, dict) else ():
            yield [value, *(usual[1:] if isinstance(usual, list) else ())], f"with {clip(value)}, {why}"
    yield from _wrong_scalars(schema)


def _wrong_scalars(schema: Schema) -> Iterator[tuple[Any, str]]:
    """Yield texts and numbers that a schema forbids in whatever way they are read: at its edge, and of another type."""
    kinds, merged = kinds_of(schema), flat(schema)
    if not kinds or kinds & {"object", "array"}:
        return
    for value, why in _beyond(merged):
        # A number as text is allowed where texts are.
        is_text = isinstance(value, str) or "string" not in kinds
        if is_text and not isinstance(value, list) and not fits(schema, value):
            yield value, why
            if isinstance(value, str):
                break
    if "string" not in kinds and "enum" not in merged:
        yield UNKNOWN, _OTHER_TYPE


def undeclared_types(operation: Operation, effort: str) -> list[str]:
    """Return media types that few APIs accept, at quick one, if an operation declares 415 and requires a body."""
    is_judged = operation.body_required and "415" in operation.responses
    types = [one for one in _OTHER_TYPES if is_judged and not {one, "text/*", "*/*"} & operation.bodies.keys()]
    return types[:1] if effort == "quick" else types


def unacceptable(operation: Operation, usual: Inputs) -> Iterator[Variation]:
    """Yield reads in a format that the device does not have, and in none of its own, if the operation declares 406."""
    own = operation.formats if operation.method == "GET" and "406" in operation.responses else ()
    for accept in (NO_FORMAT, ", ".join(f"{name};q=0" for name in own)):
        if own and not any("*" in name for name in own):
            yield Variation(Kind.MISSING, f"Accept: {accept}", ACCEPT, replace(usual, accept=accept))
