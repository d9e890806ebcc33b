"""Decide whether one schema allows every value that another does: yes, no, or not known.

A proof says yes. A value that the one allows and the other does not says no. Without either, it is not known.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, Final

import jsonschema_rs
from jsonschema_rs.canonical import Containment, Satisfiability

from conformance.documents.json_schema import Schema, opened
from conformance.documents.schema_sides import MANY, NAMED, ONE, Side

_TRIED: Final = 4000
# Exceptions of the libraries: ValueError for an invalid schema, the others for values that they do not support.
_UNUSABLE: Final = (ValueError, TypeError, OverflowError, RecursionError, jsonschema_rs.ReferencingError)


# A prepared schema with its side.
Placed = tuple[Any, Side]


def is_covered(inner: Placed, outer: Placed, barred: frozenset[str] | None) -> bool:
    """Return whether it is proven that the outer schema allows every value of the inner one.

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
    """Return the shortest found value of the inner schema that the outer one forbids, as JSON, or None."""
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
        objects = (whole for whole in wholes if isinstance(whole, dict))
        found = {name: part for whole in objects for name, part in whole.get("$defs", {}).items()}
        both = jsonschema_rs.canonicalize({"allOf": wholes, "$defs": found}, **_options())
        return bool(both.satisfiability() == Satisfiability.NO)
    except _UNUSABLE:
        return False


def are_apart(schemas: list[Placed]) -> bool:
    """Return whether each two of several schemas are known to have no value in common."""
    return all(apart(one, other) for number, one in enumerate(schemas) for other in schemas[:number])


def _options() -> dict[str, Any]:
    return {"draft": jsonschema_rs.Draft202012, "validate_formats": True, "offline": True}


def new_members(inner: Placed, outer: Placed) -> frozenset[str]:
    """Return the names of members that only the outer schema describes."""
    return frozenset(_members(_whole(*outer)) - _members(_whole(*inner)))


def _pair(inner: Placed, outer: Placed, barred: frozenset[str] | None) -> tuple[Any, Any]:
    small, large = _whole(*inner), _whole(*outer)
    return (small, _open(large)) if barred is None else (_without(small, barred), large)


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


def _without(schema: Any, names: frozenset[str]) -> Any:
    """Return a schema whose objects lack these members, unless a schema for undescribed members covers them."""
    if not names or not isinstance(schema, dict):
        return schema
    found: Schema = {
        key: _without(value, names) if key in ONE and key not in {"not", "if"}
        else [_without(part, names) for part in value] if key in MANY
        else {name: _without(part, names) for name, part in value.items()} if key in NAMED or key == "$defs"
        else value
        for key, value in schema.items()
    }  # fmt: skip
    explicit = "patternProperties" in found or isinstance(found.get("additionalProperties"), dict)
    if not explicit and ("properties" in found or "required" in found or found.get("type") == "object"):
        found["properties"] = {**dict.fromkeys(sorted(names), False), **found.get("properties", {})}
    return found


def _open(schema: Any) -> Any:
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


_MOST: Final = 48
_FEW: Final = 6
_DEPTH: Final = 5
_FORMATS: Final = (
    "2024-02-29", "2024-02-29T10:00:00Z", "10:00:00Z", "P1D", "a@b.example", "b.example", "192.0.2.1", "2001:db8::1",
    "http://b.example/a", "/a", "0f8fad5b-d9cb-469f-a165-70867728950e",
)  # fmt: skip


class Witnesses:
    """Makes values from the keywords of two schemas, to find one that only one of them allows.

    Args:
        schemas: two schemas with their ``$defs``.
    """

    def __init__(self, schemas: Iterable[Any]) -> None:
        self._numbers: dict[float, None] = dict.fromkeys((0.5, 0, 1, -1, 7, 2**40, 2**70, 1e300))
        self._texts: dict[str, None] = dict.fromkeys(("", "roaas", "0", "a", "A b"))
        self._sizes: dict[int, None] = dict.fromkeys((0, 1, 2))
        self._members: dict[str, None] = {"roaas": None}
        self._values: list[Any] = []
        for schema in schemas:
            self._look(schema)
        for size in list(self._sizes)[:12]:
            self._texts["x" * size] = None

    def _look(self, schema: Any) -> None:
        if not isinstance(schema, dict):
            return
        for key, value in schema.items():
            if key in {"enum", "const"}:
                self._values += value if key == "enum" else [value]
            elif key == "multipleOf":
                self._numbers |= dict.fromkeys((value / 3, 1.5 * value, value, -value, 2 * value, 3 * value, 5 * value))
            elif isinstance(value, int | float) and not isinstance(value, bool):
                if key.startswith(("min", "max")) and key not in {"minimum", "maximum"}:
                    self._sizes |= dict.fromkeys(max(0, min(int(value) + more, 300)) for more in (-1, 0, 1))
                else:
                    self._numbers |= dict.fromkeys((value, value - 1, value + 1, value - 0.5, value + 0.5))
            elif key == "pattern":
                self._texts |= dict.fromkeys(_near(value))
            elif key == "format":
                self._texts |= dict.fromkeys(_FORMATS)
            elif key in {"required", "dependentRequired"}:
                others = value.values() if key == "dependentRequired" else ()
                self._members |= dict.fromkeys([*value, *(name for names in others for name in names)])
            self._look_below(key, value)

    def _look_below(self, key: str, value: Any) -> None:
        if key in ONE:
            self._look(value)
        elif key in MANY:
            for part in value:
                self._look(part)
        elif key in NAMED or key == "$defs":
            if key == "patternProperties":
                self._members |= dict.fromkeys(text for name in value for text in _near(name))
            elif key != "$defs":
                self._members |= dict.fromkeys(value)
            for part in value.values():
                self._look(part)

    def of(self, schema: Any, whole: Any, depth: int = 0) -> Iterator[Any]:
        """Yield values that a schema may allow; ``whole`` has its ``$defs``."""
        if schema is False or depth > _DEPTH:
            return
        given = schema if isinstance(schema, dict) else {}
        if "$ref" in given:
            target = whole.get("$defs", {}).get(given["$ref"].rpartition("/")[2], {})
            yield from self.of(target, whole, depth + 1)
        yield from given.get("enum", ())
        if "const" in given:
            yield given["const"]
        parts = [part for key in ("anyOf", "oneOf", "allOf") for part in given.get(key, ())]
        parts += [given[key] for key in ("if", "then", "else", "not") if key in given]
        inner = [list(islice(self.of(part, whole, depth + 1), _MOST)) for part in parts]
        yield from (value for values in inner for value in values)
        yield from _join(inner)
        yield from self._by_type(given, whole, depth)

    def _by_type(self, given: dict[str, Any], whole: Any, depth: int) -> Iterator[Any]:
        kinds = given.get("type", ["null", "boolean", "number", "string", "array", "object"])
        kinds = [kinds] if isinstance(kinds, str) else kinds
        yield from (value for value in self._values if depth or not isinstance(value, dict | list))
        if "null" in kinds:
            yield None
        if "boolean" in kinds:
            yield from (True, False)
        if {"number", "integer"} & set(kinds):
            yield from self._numbers
        if "string" in kinds:
            yield from self._texts
        if "array" in kinds:
            yield from self._arrays(given, whole, depth)
        if "object" in kinds:
            yield from self._objects(given, whole, depth)

    def _arrays(self, given: dict[str, Any], whole: Any, depth: int) -> Iterator[Any]:
        yield []
        prefix = [self._few(part, whole, depth) for part in given.get("prefixItems", ())]
        rest = self._few(given.get("items", True), whole, depth)
        found = self._few(given["contains"], whole, depth) if "contains" in given else []
        first = [values[0] for values in prefix if values]
        for number, values in enumerate(prefix):
            yield first[: number + 1]
            yield from ([*first[:number], value, *first[number + 1 :]] for value in values)
        for value in (*found, *rest):
            yield [*first, value]
            yield [*first, value, value]
        for size in list(self._sizes)[:12]:
            yield (rest * (size // max(len(rest), 1) + 1))[:size]
            yield [*first, *rest[:1] * size]
            yield [*first, *found[:1] * size]

    def _objects(self, given: dict[str, Any], whole: Any, depth: int) -> Iterator[Any]:
        yield {}
        described = given.get("properties", {})
        required = given.get("required", ())
        others = given.get("additionalProperties", True)
        named = list(dict.fromkeys([*described, *required, *self._members]))[:_MOST]
        values = {
            name: self._few(next(
                (part for pattern, part in given.get("patternProperties", {}).items() if _matches(pattern, name)),
                described.get(name, others),
            ), whole, depth)
            for name in named
        }  # fmt: skip
        least = {name: values[name][0] for name in required if values.get(name)}
        full = {name: values[name][0] for name in described if values[name]} | least
        yield least
        yield full
        for name in named:
            for value in values[name]:
                yield {**least, name: value}
                yield {**full, name: value}
            yield {key: value for key, value in full.items() if key != name}
        for size in list(self._sizes)[:12]:
            yield {**least, **{f"roaas{number}": 1 for number in range(size - len(least))}}
        free = [name for name in named if values[name]]
        for number, name in enumerate(free[:_FEW]):
            for other in free[number + 1 : _FEW]:
                yield from ({**least, name: one, other: two} for one in values[name][:4] for two in values[other][:4])

    def _few(self, schema: Any, whole: Any, depth: int) -> list[Any]:
        """Return a few different values that a schema of a member may allow, of each type some."""
        if depth >= _DEPTH:
            return []
        found: dict[tuple[type, int], Any] = {}
        for value in islice(self.of(schema, whole, depth + 2), 4 * _MOST):
            kind = type(value)
            number = next((at for at in range(_FEW) if (kind, at) not in found), None)
            if number is not None and not any(value == one for (same, _), one in found.items() if same is kind):
                found[kind, number] = value
        return list(found.values())


def _join(parts: list[list[Any]]) -> Iterator[Any]:
    """Yield objects that join those of several schemas."""
    objects = [[value for value in values if isinstance(value, dict)][:_FEW] for values in parts]
    found: list[dict[str, Any]] = [{}]
    for values in objects:
        if values:
            found = [{**item, **other} for item in found for other in values][:_MOST]
    yield from found


def _matches(pattern: str, name: str) -> bool:
    try:
        return re.search(pattern, name) is not None
    except re.error:
        return False


def _near(pattern: str) -> list[str]:
    """Return texts that a pattern may match: its letters, with something before and behind."""
    plain = re.sub(r"\\[dDwWsSbB]|\[[^\]]*\]|\{[^}]*\}|[\^$()?*+.|\\]", "", pattern)
    kinds = {r"\d": "7", r"\w": "b", "a-z": "q", "A-Z": "Q", "0-9": "7"}
    letters = "".join(text for kind, text in kinds.items() if kind in pattern)
    texts = [plain, f"{plain}{letters}", f"{letters}{plain}", *plain.split()[:2], *letters, plain[:1]]
    counts = [int(number) for number in re.findall(r"\d+", pattern)[:4] if int(number) < 100]  # noqa: PLR2004
    texts += [letter * count for letter in letters for count in counts]
    return [part for text in texts for part in (text, f"{text}x", f"x{text}", f"{text}7", f"{text} ", f"{text}X")]
