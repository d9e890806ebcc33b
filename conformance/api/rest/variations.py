"""Requests for one operation that differ from its usual request in one thing, valid and invalid ones."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Final

from conformance.api.rest.inputs import NOTHING, Inputs, parameter_verdict, whole_body
from conformance.api.rest.references import is_free_text, refers
from conformance.api.rest.samples import alike_and_apart, fits, sample
from conformance.api.rest.validity import VALID
from conformance.api.rest.values import Values
from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import Parameter, plain_name
from conformance.documents.representation import flat

_FEW: Final = 12  # enum values, examples and optional members that are tried in one place
DEPTH: Final = 3  # levels of a body whose members are varied
LONG: Final = 5000
# Names of members that take any text.
_TEXTUAL: Final = frozenset({"name", "title", "label", "text", "note", "description", "comment", "message", "remark"})
_BEYOND: Final = 2**63
#: Path into a body: names of members and indexes of items.
Steps = tuple[str | int, ...]
UNKNOWN: Final = "roaas-unknown"
#: The place of a variation that has other formats.
ACCEPT: Final = "header Accept"
#: The end of what a variation says whose text has as many characters as its bound, and more UTF-16 units.
WIDE: Final = " characters, some beyond U+FFFF"
#: A media type that no device has.
NO_FORMAT: Final = "application/x.roaas-nothing"
_UNKNOWN_NUMBER: Final = 987_654_321
# Texts that programs often mishandle; none of them makes a device act.
_ODD_TEXTS: Final = (
    "",
    " ",
    "\U0001f916é",
    "'\"`;--(*[",
    "../../roaas",
    "\x00",
    "{{7*7}}${7*7}",
    "roaas\r\nroaas: 1",
    "null",
    "x" * LONG,
)
_ODD_NUMBERS: Final = (0, -1, _BEYOND, -_BEYOND - 1, 1e308, 1.5)


class Kind(StrEnum):
    """Kind of a request of the survey, by what its response shows."""

    USUAL = "usual"  # with what is required
    EXAMPLE = "example"  # with an example of the description
    DEFAULT = "default"  # with the default written out
    ENUM = "enum"  # with one value of an enumeration
    OPTIONAL = "optional"  # with an optional parameter or member
    BOUND = "bound"  # with a value at the edge of what is allowed
    FORMAT = "format"  # with another declared media type in Accept or as content
    MISSING = "missing"  # without something required
    INVALID = "invalid"  # with a value that the description forbids
    MALFORMED = "malformed"  # with content that its media type forbids
    UNKNOWN = "unknown"  # with the identifier of something that does not exist
    ODD = "odd"  # with a valid value that programs often mishandle
    ANONYMOUS = "anonymous"  # without credentials, or with wrong ones
    AGAIN = "again"  # the usual request again, after others
    GENERATED = "generated"  # made by Schemathesis
    OTHER = "other"  # sent by another check


@dataclass(frozen=True)
class Variation:
    """One request to be sent.

    Attributes:
        kind: what it shows.
        says: what is special about it, as a noun phrase; empty for the usual request.
        place: the parameter or member that is special ("query limit", "body /a/b"); empty for the whole request.
        inputs: its values.
        parts: the requests that it puts together, each with one of its members.
        is_common: whether it has nothing but another type or text, which frameworks refuse in any place.
    """

    kind: Kind
    says: str
    place: str
    inputs: Inputs
    parts: tuple[Variation, ...] = ()
    is_common: bool = False


def valid_variations(operation: Operation, usual: Inputs, values: Values) -> Iterator[Variation]:
    """Yield requests that the description allows, each with one thing more or other than the usual request."""
    for item in operation.parameters:
        place = f"{item.where} {item.name}"
        for kind, value in _valid_values(item.schema, item.examples, values.of(operation, item), item.required):
            # A path parameter is never left out, so a default says nothing of it.
            if kind is Kind.DEFAULT and item.where == "path":
                continue
            is_new = value != usual.at(item.where).get(item.name, NOTHING) and _sendable(item, value)
            if is_new and parameter_verdict(operation, item, value) == VALID:
                yield Variation(kind, f"{clip(value)} as {place}", place, usual.having(item.where, item.name, value))
    media_type, whole = whole_body(operation, values)
    if is_json(media_type) and isinstance(usual.body, dict):
        schema = operation.bodies[media_type].schema
        for example in operation.bodies[media_type].examples[:_FEW]:
            if example != usual.body and not isinstance(example, str):
                yield Variation(Kind.EXAMPLE, "the example body", "body", replace(usual, body=example))
        yield from (
            _knowing(variation, operation, values) for variation in _valid_members(usual, usual.body, schema, ())
        )
    if whole is not NOTHING and whole != usual.body and media_type == usual.media_type:
        yield Variation(Kind.OPTIONAL, "all members of the body", "body", replace(usual, body=whole))
    for name in operation.formats[:_FEW] if len(operation.formats) > 1 else ():
        yield Variation(Kind.FORMAT, f"Accept: {name}", ACCEPT, replace(usual, accept=name))


def most_references(operation: Operation, usual: Inputs, values: Values) -> Iterator[tuple[Inputs, Variation]]:
    """Yield a request with as many known references as a list may have, and inputs without the first of them."""
    if not is_json(usual.media_type) or not isinstance(usual.body, dict):
        return
    for name, part in flat(operation.bodies[usual.media_type].schema).get("properties", {}).items():
        most = flat(part).get("maxItems")
        if "array" in kinds_of(part) and isinstance(most, int) and 1 < most <= _FEW:
            known = values.references(operation, name, part)[:most] if refers(name, part, values.collections) else []
            if len(known) == most and fits(part, known):
                fewer, whole = (
                    replace(usual, body=with_member(usual.body, (name,), one)) for one in (known[1:], known)
                )
                place = place_of((name,))
                yield fewer, Variation(Kind.BOUND, f"{most} items in {place}", place, whole)


def least_inputs(operation: Operation, usual: Inputs) -> Inputs | None:
    """Return inputs of a creation with only the required members; None if there are no others, or alternatives."""
    if operation.method != "POST" or not is_json(usual.media_type) or not isinstance(usual.body, dict):
        return None
    schema = operation.bodies[usual.media_type].schema
    least = {name: one for name, one in usual.body.items() if name in flat(schema).get("required", ())}
    return replace(usual, body=least) if least != usual.body and fits(schema, least) else None


def together(operation: Operation, usual: Inputs, variations: list[Variation]) -> list[Variation]:
    """Return few requests with the members of many: each has at most one value of each member, and is valid.

    Args:
        operation: takes JSON.
        usual: its usual request.
        variations: valid requests; what differs in no member, or is valid only alone, stays a request of its own.
    """
    alone, groups = list[Variation](), list[tuple[Any, list[Variation]]]()
    schema = operation.bodies[usual.media_type].schema if usual.media_type in operation.bodies else {}
    for variation in variations:
        if not variation.place.startswith("body /") or not isinstance(usual.body, dict):
            alone.append(variation)
            continue
        for index, (body, parts) in enumerate(groups):
            meeting = [other.inputs.body for other in parts if _meet(variation.place, other.place)]
            is_there = meeting == [variation.inputs.body] * len(meeting)
            whole = (body if meeting else _with_part(body, variation)) if is_there else None
            if whole is not None and fits(schema, whole):
                groups[index] = whole, [*parts, variation]
                break
        else:
            groups.append((variation.inputs.body, [variation]))
    for turn, (body, parts) in enumerate(groups, 1):
        fresh = _with_new_texts(body, schema, usual.body, turn) if operation.method == "POST" else body
        says, inputs = f"{len(parts)} members of the body", replace(usual, body=fresh)
        # Two members may exclude each other, so each is also sent alone.
        alone.append(Variation(Kind.ODD, says, "body", inputs, tuple(parts)) if len(parts) > 1 else parts[0])
    return alone


def _meet(place: str, other: str) -> bool:
    return place == other or place.startswith(f"{other}/") or other.startswith(f"{place}/")


def _with_part(body: dict[str, Any], part: Variation) -> Any:
    """Return a body with one part of another body; None if the part is an item of a list."""
    steps, value, there = part.place.removeprefix("body /").split("/"), part.inputs.body, body
    for depth, step in enumerate(steps, 1):
        if not isinstance(value, dict) or step not in value:
            return None
        value = value[step]
        if depth == len(steps) or not isinstance(there.get(step), dict):
            return with_member(body, tuple(steps[:depth]), value)
        there = there[step]
    return None


def _with_new_texts(body: dict[str, Any], schema: Schema, usual: dict[str, Any], turn: int) -> dict[str, Any]:
    """Return a body with unusual free texts, since there may be only one thing of a name."""
    parts, changed = flat(schema).get("properties", {}), dict(body)
    for name, one in body.items():
        text = f"roaas {turn}"
        if isinstance(one, str) and one == usual.get(name) and is_free_text(parts[name]) and fits(parts[name], text):
            changed[name] = text
    return changed if fits(schema, changed) else body


def _knowing(variation: Variation, operation: Operation, values: Values) -> Variation:
    """Return a variation whose optional member refers to things that the device has named."""
    if variation.kind is not Kind.OPTIONAL:
        return variation
    inputs = variation.inputs
    filled = values.fill(inputs.body, operation.bodies[inputs.media_type].schema, operation)
    return replace(variation, inputs=replace(inputs, body=filled))


def _valid_values(schema: Schema, examples: Any, known: list[Any], required: bool) -> Iterator[tuple[Kind, Any]]:  # noqa: FBT001 - a column of the table
    yield from ((Kind.EXAMPLE, value) for value in examples[:_FEW])
    schema = flat(schema)
    if "default" in schema and schema["default"] is not None:
        yield Kind.DEFAULT, schema["default"]
    yield from ((Kind.ENUM, value) for value in schema.get("enum", ())[:_FEW] if value is not None)
    if kinds_of(schema) == {"boolean"}:
        yield from ((Kind.ENUM, value) for value in (True, False))
    elif not required:
        yield from ((Kind.OPTIONAL, value) for value in known[:1])
    for value in _bounds(schema):
        if fits(schema, value):
            yield Kind.BOUND, value


def _bounds(schema: Schema) -> Iterator[Any]:
    """Yield the values at the edges of a schema."""
    for key in ("minimum", "maximum"):
        if isinstance(schema.get(key), int | float) and not isinstance(schema.get(key), bool):
            yield schema[key]
    if "array" in kinds_of(schema) and (apart := alike_and_apart(schema)[1]):
        yield apart  # the separator between items appears only with two items
        yield from _lists(schema)
    if "pattern" in schema or "format" in schema or "enum" in schema:
        return
    for key in ("minLength", "maxLength"):
        if isinstance(schema.get(key), int) and 0 < schema[key] <= LONG:
            yield "a" * schema[key]


def _lists(schema: Schema) -> Iterator[list[Any]]:
    """Yield arrays of the most items, and with each value of an enumeration of their items."""
    most, items = schema.get("maxItems"), flat(schema["items"])
    values = [item for item in items.get("enum", ()) if item is not None][:_FEW]
    if isinstance(most, int) and 0 < most <= _FEW:
        whole = alike_and_apart({**schema, "minItems": most})[1]
        yield whole or values[:most]
        values = [value for value in values if value not in whole]
    yield from ([value] for value in values)


def _valid_members(usual: Inputs, value: Any, schema: Schema, steps: tuple[str, ...]) -> Iterator[Variation]:
    """Yield bodies with one optional member more, or with another value of a member."""
    schema = flat(schema)
    for name, part in list(schema.get("properties", {}).items()):
        place, here = place_of((*steps, name)), (*steps, name)
        if part.get("readOnly"):
            continue
        flatter = flat(part)
        inner, filled = value.get(name), usual
        if name not in value:
            inner = sample(part, whole=True)
            filled = replace(usual, body=with_member(usual.body, here, inner))
            yield Variation(Kind.OPTIONAL, f"the optional member {place}", place, filled)
        for kind, one in _valid_values(flatter, flatter.get("examples", ()) or (), [], required=True):
            wide = kind is Kind.BOUND and plain_name(name) in _TEXTUAL and isinstance(one, str) and len(one) > 1
            if wide:
                # JSON Schema counts characters, not bytes or UTF-16 units (JSON Schema Validation 6.3).
                one = ("\u00e9\U0001f916" * len(one))[: len(one)]  # noqa: PLW2901 - of the same length
            if one != value.get(name, NOTHING):
                body = with_member(usual.body, here, one)
                says = f"{clip(one)} as {place}{f', {len(one)}{WIDE}' if wide else ''}"
                yield Variation(kind, says, place, replace(usual, body=body))
        if isinstance(inner, dict) and len(steps) < DEPTH:
            yield from _valid_members(filled, inner, part, here)


def unknown_variations(operation: Operation, usual: Inputs) -> Iterator[Variation]:
    """Yield requests with the identifier of something that does not exist."""
    for item in operation.parameter("path"):
        values: tuple[Any, ...] = (UNKNOWN, _UNKNOWN_NUMBER, "00000000-0000-4000-8000-000000000000")
        known = next((value for value in values if fits(item.schema, value)), None)
        if known is not None and "enum" not in flat(item.schema):
            place = f"path {item.name}"
            yield Variation(Kind.UNKNOWN, f"{clip(known)} as {place}", place, usual.having("path", item.name, known))


def odd_variations(operation: Operation, usual: Inputs) -> Iterator[Variation]:
    """Yield requests with values that programs stumble over, whether or not the description allows them."""
    for item in operation.parameters:
        kinds, place = kinds_of(item.schema) or {"string"}, f"{item.where} {item.name}"
        texts: tuple[Any, ...] = _ODD_TEXTS if "string" in kinds else ()
        for value in (*texts, *(_ODD_NUMBERS if kinds & {"number", "integer"} else ())):
            if _sendable(item, value):
                yield Variation(
                    Kind.ODD, f"{clip(value)} as {place}", place, usual.having(item.where, item.name, value)
                )
    extra = usual.having("query", "roaas_unknown", "1")
    yield Variation(Kind.ODD, "an unknown query parameter", "query", extra)
    if isinstance(usual.body, bytes):
        cut = usual.body[: len(usual.body) // 2]
        for says, octets in (("an empty file", b""), ("half a file", cut), ("octets that are no such file", b"roaas")):
            yield Variation(Kind.ODD, says, "body", replace(usual, body=octets))
    if is_json(usual.media_type) and isinstance(usual.body, dict):
        for name, part in flat(operation.bodies[usual.media_type].schema).get("properties", {}).items():
            kinds = kinds_of(part) or {"string"}
            texts = (_ODD_TEXTS[2] + _ODD_TEXTS[5], _ODD_TEXTS[3]) if "string" in kinds else ()
            for value in (None, *texts, *(_ODD_NUMBERS[2:5] if kinds & {"number", "integer"} else ())):
                place = place_of((name,))
                body = with_member(usual.body, (name,), value)
                yield Variation(Kind.ODD, f"{clip(value)} as {place}", place, replace(usual, body=body))


def _sendable(parameter: Parameter, value: Any) -> bool:
    """Return whether HTTP carries a value in a parameter's place unchanged."""
    if isinstance(value, list | dict):
        return all(_sendable(parameter, item) for item in (value.values() if isinstance(value, dict) else value))
    text = value if isinstance(value, str) else ""
    if parameter.where == "path":
        return value != "" and "/" not in text and text not in {".", ".."}
    if parameter.where in {"header", "cookie"}:
        return bool(re.fullmatch(r"[!-~](?:[ -~]*[!-~])?", str(value))) and not (set(text) & set(",;"))
    return True


def with_member(body: Any, steps: Steps, value: Any) -> Any:
    """Return a copy of a body with another value of a member or item; NOTHING removes the member."""
    changed = copy.deepcopy(body)
    inner: Any = changed
    for step in steps[:-1]:
        inner = inner[step] if isinstance(step, int) else inner.setdefault(step, {})
    if value is NOTHING:
        inner.pop(steps[-1], None)
    else:
        inner[steps[-1]] = copy.deepcopy(value)
    return changed


def place_of(steps: Steps) -> str:
    """Return the place of a member or item of a body, as variations name it."""
    return "body /" + "/".join(map(str, steps))


def clip(value: Any) -> str:
    """Return a value as a reader sees it, cut to 40 characters."""
    text = repr(value) if not isinstance(value, Mapping) else "an object"
    return text if len(text) <= 40 else f"{text[:36]}…{text[-1]}"  # noqa: PLR2004 - characters of a line
