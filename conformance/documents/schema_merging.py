"""Write a prepared schema as alternatives without parts: what allOf demands in one schema, a schema for each shape."""

from __future__ import annotations

from typing import Any, Final

from conformance.documents.json_schema import Schema
from conformance.documents.schema_sides import Side

_DEPTH: Final = 8
_MOST: Final = 40
# Words that speak of what other words of the same schema leave.
_RELATIVE: Final = frozenset(
    {"additionalProperties", "patternProperties", "unevaluatedProperties", "unevaluatedItems", "prefixItems", "items"}
)
_BOUNDS: Final = {
    "minimum": max, "exclusiveMinimum": max, "minLength": max, "minItems": max, "minProperties": max,
    "maximum": min, "exclusiveMaximum": min, "maxLength": min, "maxItems": min, "maxProperties": min,
}  # fmt: skip


def alternatives(schema: Any, side: Side, depth: int = 0) -> list[Any]:
    """Return schemas of which a value has at least one: those of anyOf, oneOf and several types."""
    given = plain(schema, side)
    if not isinstance(given, dict) or depth > _DEPTH:
        return [given]
    key = next((key for key in ("anyOf", "oneOf") if given.get(key)), None)
    found = [given]
    if key is not None and not ({"anyOf", "oneOf", "allOf", "$ref"} - {key}) & given.keys():
        base = {word: value for word, value in given.items() if word != key}
        parts = [plain({"allOf": [base, part]} if base else part, side) for part in given[key]]
        found = [one for part in parts for one in alternatives(part, side, depth + 1)]
        found = found if len(found) <= _MOST else [given]
    return [
        {**one, "type": kind} if kind else one
        for one in found
        for kind in (one["type"] if isinstance(one, dict) and isinstance(one.get("type"), list) else ("",))
    ]


def plain(schema: Any, side: Side, depth: int = 0) -> Any:
    """Return a schema without allOf and references, where that can be written as one schema."""
    schema = side.target(schema)
    if not isinstance(schema, dict) or not {"allOf", "$ref"} & schema.keys() or depth > _DEPTH:
        return schema
    base: Any = {key: value for key, value in schema.items() if key not in {"allOf", "$ref"}}
    parts = [*schema.get("allOf", ()), *([{"$ref": schema["$ref"]}] if "$ref" in schema else ())]
    for part in parts:
        base = _merged(base, plain(part, side, depth + 1))
        if base is None:
            return schema
    return base


def _merged(one: Any, other: Any) -> Any:
    """Return a schema that demands what both do; None if the two cannot be written as one."""
    if one in (True, {}) or other in (True, {}):
        return other if one in (True, {}) else one
    if one is False or other is False:
        return False
    if {"allOf", "$ref"} & (one.keys() | other.keys()) or (_RELATIVE & one.keys()) or (_RELATIVE & other.keys()):
        return None
    found: Schema = {**one, **other}
    for key in one.keys() & other.keys():
        if one[key] == other[key]:
            continue
        if key == "properties":
            both = {name: {"allOf": [one[key][name], other[key][name]]} for name in one[key] if name in other[key]}
            found[key] = {**one[key], **other[key], **both}
        elif key == "required":
            found[key] = sorted({*one[key], *other[key]})
        elif key in _BOUNDS:
            found[key] = _BOUNDS[key](one[key], other[key])
        elif key == "type" and {str(one[key]), str(other[key])} == {"integer", "number"}:
            found[key] = "integer"
        else:
            return None
    return found


def types_in(schema: Schema) -> tuple[str, ...]:
    """Return the types of a schema in the order of the alphabet; empty if it has any."""
    given = schema.get("type", ())
    return (given,) if isinstance(given, str) else tuple(sorted(given))


def are_related(one: tuple[str, ...], other: tuple[str, ...]) -> bool:
    """Return whether a value may be of both."""
    return bool({*one} & {*other}) or {*one, *other} >= {"integer", "number"}


def common_types(old: Schema, new: Schema) -> list[str]:
    """Return types that values of both schemas may have."""
    before, after = types_in(old), types_in(new)
    both = [kind for kind in before if kind in after]
    return both or (["integer"] if before and after else list(before or after))


def kind_in(schema: Any) -> str:
    """Return the type of a shape, in which an integer is a number; empty if it has any."""
    kind = str(schema.get("type", "")) if isinstance(schema, dict) else ""
    return "number" if kind == "integer" else kind
