"""Compare two schemas of the same place: what breaks who sends or reads by the older one."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any, Final

from conformance.documents.json_schema import Schema, types_of

_DEPTH: Final = 12
_MOST_ALTERNATIVES: Final = 40
# Each keyword that bounds a value, with 1 for a lower bound and -1 for an upper one, and the bound without it.
_BOUNDS: Final = {
    "minimum": (1, -math.inf), "exclusiveMinimum": (1, -math.inf), "minLength": (1, 0), "minItems": (1, 0),
    "minProperties": (1, 0), "maximum": (-1, math.inf), "exclusiveMaximum": (-1, math.inf), "maxLength": (-1, math.inf),
    "maxItems": (-1, math.inf), "maxProperties": (-1, math.inf),
}  # fmt: skip
# Keywords that allow less where they are there, and something else where they have another value.
_LIMITS: Final = ("pattern", "format", "multipleOf")
_WIDER_FORMATS: Final = {("int32", "int64"), ("float", "double")}
_WITHOUT: Final = "none"
# Whether it breaks a client, and what changed: where, and how.
_Found = tuple[bool, str]


def schema_changes(old: Any, new: Any, *, request: bool, depth: int = 0) -> Iterator[_Found]:
    """Yield what changed, and whether it breaks a client, as text that follows the name of the place.

    A client of the older schema fails if what it sends is no longer taken, or if it reads what it did not expect.

    Args:
        old: schema without references, Draft 2020-12.
        new: likewise.
        request: whether clients send the value; otherwise they read it.
        depth: how deep the schema is within that of the body.
    """
    if old == new or depth > _DEPTH:
        return
    before, after = _alternatives(old), _alternatives(new)
    if len(before) == len(after) == 1:
        yield from _alike(before[0], after[0], request=request, depth=depth)
        return
    # Each alternative that was sent must still be taken; each that is read now must have been known.
    asked, given = (before, after) if request else (after, before)
    for one in asked:
        like = [other for other in given if _kind(one) == _kind(other)]
        like = [other for other in like if other.get("title", "") == one.get("title")] or like
        pairs = [(one, other) if request else (other, one) for other in like]
        found = [list(_alike(*pair, request=request, depth=depth)) for pair in pairs]
        if any(not any(breaking for breaking, _ in changes) for changes in found):
            continue
        if len(found) == 1:
            yield from (change for change in found[0] if change[0])
        else:
            yield True, f" may {'no longer' if request else 'now'} be {_name(one)}"
    for one in given:
        if not any(_kind(one) == _kind(other) for other in asked):
            yield False, f" may {'now' if request else 'no longer'} be {_name(one)}"


def _alternatives(schema: Any, depth: int = 0) -> list[Schema]:
    """Return the alternatives of a schema: of anyOf and oneOf and of several types, with what holds for all of them."""
    if not isinstance(schema, dict):
        return [{} if schema is not False else {"enum": []}]
    base = {key: value for key, value in schema.items() if key not in {"anyOf", "oneOf", "allOf"}}
    found = [base]
    for part in schema.get("allOf", ()):
        found = [_merged(one, other) for one in found for other in _alternatives(part, depth + 1)]
    for key in ("anyOf", "oneOf"):
        parts = schema.get(key)
        if parts and depth <= _DEPTH:
            inner = [other for part in parts for other in _alternatives(part, depth + 1)]
            found = [_merged(one, other) for one in found for other in inner][:_MOST_ALTERNATIVES]
    return [{**one, "type": kind} if kind else one for one in found for kind in types_of(one) or ("",)]


def _merged(one: Schema, other: Schema) -> Schema:
    """Return a schema that demands what both do."""
    found = {**one, **other}
    if "properties" in one and "properties" in other:
        found["properties"] = {**one["properties"], **other["properties"]}
    if "required" in one and "required" in other:
        found["required"] = [*one["required"], *other["required"]]
    return found


def _kind(schema: Schema) -> str:
    kind = str(schema.get("type", ""))
    return "number" if kind == "integer" else kind


def _name(schema: Schema) -> str:
    if "const" in schema or "enum" in schema:
        return _shown(schema.get("enum", [schema.get("const")]))
    return str(schema.get("title") or schema.get("type") or "anything")


def _alike(old: Schema, new: Schema, *, request: bool, depth: int) -> Iterator[_Found]:
    """Yield the changes between two schemas without alternatives."""
    before, after = old.get("type", ""), new.get("type", "")
    if before != after and (before or after):
        wider = not after or (before, after) == ("integer", "number")
        tighter = not before or (after, before) == ("integer", "number")
        yield not (wider if request else tighter), f": type {before or 'any'} → {after or 'any'}"
        if not (wider or tighter):
            return
    yield from _values(old, new, request=request)
    yield from _limits(old, new, request=request)
    yield from _members(old, new, request=request, depth=depth)
    if "items" in old or "items" in new:
        for breaking, text in schema_changes(
            old.get("items", {}), new.get("items", {}), request=request, depth=depth + 1
        ):
            yield breaking, f"[]{text}"


def _values(old: Schema, new: Schema, *, request: bool) -> Iterator[_Found]:
    """Yield changes of enum and const."""
    before, after = (
        one.get("enum", [one["const"]] if "const" in one else None) for one in (old, new)
    )  # fmt: skip
    if before is None or after is None:
        if before is not after:
            yield (before is None) == request, f": values {_shown(before)} → {_shown(after)}"
        return
    for word, breaking, these, those in (("no longer", request, before, after), ("now", not request, after, before)):
        other = [one for one in these if one not in those]
        if other:
            yield breaking, f" may {word} be {_shown(other)}"


def _limits(old: Schema, new: Schema, *, request: bool) -> Iterator[_Found]:
    """Yield changes of bounds; who reads a value is not harmed by other bounds."""
    for key, (sign, default) in _BOUNDS.items():
        before, after = old.get(key, default), new.get(key, default)
        if before != after and not isinstance(before, bool) and not isinstance(after, bool):
            yield request and sign * after > sign * before, f": {key} {_bound(before)} → {_bound(after)}"
    for key in _LIMITS:
        before, after = old.get(key), new.get(key)
        if before != after:
            tighter = after is not None and (before, after) not in _WIDER_FORMATS
            yield request and tighter, f": {key} {_shown(before)} → {_shown(after)}"
    if bool(old.get("uniqueItems")) != bool(new.get("uniqueItems")):
        yield request and bool(new.get("uniqueItems")), f": items must {'' if new.get('uniqueItems') else 'not '}differ"


def _bound(value: float) -> str:
    return _WITHOUT if math.isinf(value) else f"{value:g}"


def _members(old: Schema, new: Schema, *, request: bool, depth: int) -> Iterator[_Found]:
    """Yield changes of an object's members."""
    before, after = (_sent(one, request=request) for one in (old, new))
    needed, needs = (set(one.get("required", ())) for one in (old, new))
    for name in after:
        if name not in before:
            required = request and name in needs
            yield required, f", member {name} is new{', and required' if required else ''}"
    for name, schema in before.items():
        if name not in after:
            yield True, f", member {name} is gone"
            continue
        if (name in needed) != (name in needs):
            yield (name in needs) == request, f", member {name} is {'required' if name in needs else 'optional'} now"
        for breaking, text in schema_changes(schema, after[name], request=request, depth=depth + 1):
            yield breaking, _below(name, text)
    closed, closes = (one.get("additionalProperties") is False for one in (old, new))
    if closed != closes:
        yield request and closes, f": members that are not described are {'refused' if closes else 'allowed'} now"
    rest, others = (one.get("additionalProperties") for one in (old, new))
    if isinstance(rest, dict) and isinstance(others, dict):
        for breaking, text in schema_changes(rest, others, request=request, depth=depth + 1):
            yield breaking, _below("*", text)


def _sent(schema: Schema, *, request: bool) -> Schema:
    """Return the members that are sent in this direction (OpenAPI 3.0, 4.7.24.2)."""
    other = "readOnly" if request else "writeOnly"
    properties = schema.get("properties", {})
    return {name: one for name, one in properties.items() if not (isinstance(one, dict) and one.get(other) is True)}


def _below(name: str, text: str) -> str:
    """Return what changed in a member: its name before that of its own member."""
    if text.startswith(", member "):
        return f", member {name}.{text.removeprefix(', member ')}"
    return f", member {name}{text}"


def _shown(value: Any) -> str:
    if value is None:
        return _WITHOUT
    values = value if isinstance(value, list) else [value]
    return ", ".join(one if isinstance(one, str) else json.dumps(one) for one in values) or _WITHOUT
