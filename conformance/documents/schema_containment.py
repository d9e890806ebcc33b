"""Decide whether one schema allows every value that another does: yes, no, or not known.

A proof says yes. A value that the one allows and the other does not says no. Without either, it is not known.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import islice
from typing import Any, Final

import jsonschema_rs
from jsonschema_rs.canonical import Containment, Satisfiability

from conformance.documents.json_schema import Schema, opened
from conformance.documents.schema_sides import MANY, NAMED, ONE, Side
from conformance.documents.schema_witnesses import Witnesses

_TRIED: Final = 4000
# What the libraries raise: ValueError for a schema that is none, the others for values that they do not take.
_UNUSABLE: Final = (ValueError, TypeError, OverflowError, RecursionError, jsonschema_rs.ReferencingError)


# A prepared schema with its side.
Placed = tuple[Any, Side]


def is_covered(inner: Placed, outer: Placed, barred: frozenset[str] | None) -> bool:
    """Return whether it is proven that the outer schema allows whatever the inner one does.

    Args:
        inner: schema of what is sent.
        outer: schema of what the receiver takes.
        barred: members that clients do not send, because only the outer schema describes them. None if clients receive
            the value: they take members that are not described.
    """
    small, large = _pair(inner, outer, barred)
    try:
        one, other = (jsonschema_rs.canonicalize(schema, **_options()) for schema in (large, small))
        return bool(one.covers(other) == Containment.YES)
    except _UNUSABLE:
        return False


def witness(inner: Placed, outer: Placed, barred: frozenset[str] | None) -> str | None:
    """Return a value of the inner schema that is none of the outer, as JSON: the shortest found, or None."""
    small, large = _pair(inner, outer, barred)
    try:
        allows, refuses = (
            jsonschema_rs.validator_for(schema, validate_formats=True, offline=True) for schema in (small, large)
        )
        values = Witnesses((small, large))
    except _UNUSABLE:
        return None
    found = ""
    for source in (small, large):
        for value in islice(values.of(source, source), _TRIED):
            try:
                shows = allows.is_valid(value) and not refuses.is_valid(value)
                text = json.dumps(value, ensure_ascii=False) if shows else ""
            except _UNUSABLE:
                continue
            if text and (not found or len(text) < len(found)):
                found = text
    return found or None


def apart(one: Placed, other: Placed) -> bool:
    """Return whether two schemas are known to have no value in common."""
    try:
        wholes = [_whole(*one), _whole(*other)]
        found = {name: part for whole in wholes for name, part in _definitions(whole).items()}
        both = jsonschema_rs.canonicalize({"allOf": wholes, "$defs": found}, **_options())
        return bool(both.satisfiability() == Satisfiability.NO)
    except _UNUSABLE:
        return False


def are_apart(schemas: list[Placed]) -> bool:
    """Return whether each two of several schemas are known to have no value in common."""
    return all(apart(one, other) for number, one in enumerate(schemas) for other in schemas[:number])


def _options() -> dict[str, Any]:
    return {"draft": jsonschema_rs.Draft202012, "validate_formats": True, "offline": True}


def introduced(inner: Placed, outer: Placed) -> frozenset[str]:
    """Return the names of members that only the outer schema describes."""
    return frozenset(_members(_whole(*outer)) - _members(_whole(*inner)))


def _pair(inner: Placed, outer: Placed, barred: frozenset[str] | None) -> tuple[Any, Any]:
    small, large = _whole(*inner), _whole(*outer)
    return (small, _opened(large)) if barred is None else (_barred(small, barred), large)


def _whole(schema: Any, side: Side) -> Any:
    """Return a schema with the definitions that it needs."""
    if not isinstance(schema, dict):
        return schema
    needed: dict[str, Any] = {}
    waiting = list(_references(schema))
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed[name] = side.definitions[name]
            waiting += _references(needed[name])
    found = {name.rpartition("/")[2]: target for name, target in needed.items()}
    whole: Schema = dict(schema)
    return whole | {"$defs": found} if found else whole


def _definitions(whole: Any) -> Schema:
    return whole.get("$defs", {}) if isinstance(whole, dict) else {}


def _parts(schema: Schema) -> Iterator[Any]:
    for key, value in schema.items():
        if key in ONE:
            yield value
        elif key in MANY:
            yield from value
        elif key in NAMED or key == "$defs":
            yield from value.values()


def _references(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        if "$ref" in schema:
            yield schema["$ref"]
        for part in _parts(schema):
            yield from _references(part)


def _members(schema: Any) -> set[str]:
    if not isinstance(schema, dict):
        return set()
    return set(schema.get("properties", ())).union(*map(_members, _parts(schema)))


def _barred(schema: Any, names: frozenset[str]) -> Any:
    """Return a schema whose objects have none of these members, unless they have a schema for undescribed ones."""
    if not names or not isinstance(schema, dict):
        return schema
    found: Schema = {
        key: _barred(value, names) if key in ONE and key not in {"not", "if"}
        else [_barred(part, names) for part in value] if key in MANY
        else {name: _barred(part, names) for name, part in value.items()} if key in NAMED or key == "$defs"
        else value
        for key, value in schema.items()
    }  # fmt: skip
    explicit = "patternProperties" in found or isinstance(found.get("additionalProperties"), dict)
    if not explicit and ("properties" in found or "required" in found or found.get("type") == "object"):
        found["properties"] = {**dict.fromkeys(sorted(names), False), **found.get("properties", {})}
    return found


def _opened(schema: Any) -> Any:
    """Return a schema that allows members that are not described; alternatives that were apart may then overlap."""
    found = opened(schema)
    return schema if found == schema else _any_of(found)


def _any_of(schema: Any) -> Any:
    if isinstance(schema, list):
        return [_any_of(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    found = {key: _any_of(part) for key, part in schema.items()}
    if isinstance(found.get("oneOf"), list) and "anyOf" not in found:
        found["anyOf"] = found.pop("oneOf")
    return found
