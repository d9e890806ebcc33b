"""The branches of a response's schema, and those that a body shows: members, and alternatives of anyOf and oneOf."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from conformance.documents.json_schema import Schema
from conformance.documents.json_shape import shape_of

_DEPTH: Final = 8
_ITEMS: Final = 20
_ALTERNATIVES: Final = 50


def branches_of(schema: Any, place: str = "", depth: int = 0) -> Iterator[str]:
    """Yield the name of each branch of a schema without references, to a limited depth."""
    if not isinstance(schema, dict) or depth > _DEPTH:
        return
    for part, inner in _parts(schema, place):
        if part:
            yield part
        yield from branches_of(inner, part or place, depth + 1)
    yield from branches_of(schema.get("items"), f"{place}[]", depth + 1)


def branches_in(schema: Any, value: Any, place: str = "", depth: int = 0) -> Iterator[str]:
    """Yield the name of each branch of a schema that a value shows."""
    if not isinstance(schema, dict) or depth > _DEPTH:
        return
    if isinstance(value, list):
        for item in value[:_ITEMS]:
            yield from branches_in(schema.get("items"), item, f"{place}[]", depth + 1)
    for part, inner in _parts(schema, place):
        name = part.removeprefix(f"{place}.")
        if not part:
            yield from branches_in(inner, value, place, depth + 1)
        elif name == part:
            if _fits(inner, value):
                yield part
                yield from branches_in(inner, value, part, depth + 1)
        elif isinstance(value, dict) and name in value:
            yield part
            yield from branches_in(inner, value[name], part, depth + 1)


def _parts(schema: Schema, place: str) -> Iterator[tuple[str, Any]]:
    """Yield the branches of a schema with their schemas, and its parts that always hold with an empty name."""
    properties = schema.get("properties")
    for name, inner in properties.items() if isinstance(properties, dict) else ():
        yield f"{place}.{name}", inner
    for key in ("anyOf", "oneOf"):
        for number, inner in enumerate(schema.get(key, ())[:_ALTERNATIVES]):
            yield f"{place}|{key} {number}", inner
    for inner in schema.get("allOf", ()):
        yield "", inner


def _fits(schema: Any, value: Any) -> bool:
    try:
        return not isinstance(schema, dict) or shape_of(schema).holds(value)
    except (ValueError, TypeError):
        return False  # no schema that a validator can use
