"""Read and copy the schemas of an OpenAPI description, converted to Draft 2020-12; long ones have lazy references."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any, Final
from urllib.parse import unquote

Schema = dict[str, Any]
MOST_NODES: Final = 2_000  # nodes of a schema that are copied
_DEEPEST: Final = 8  # references in a chain; deeper ones stay lazy references
#: Scheme of lazy references.
LAZY_SCHEME: Final = "roaas-lazy:"
_LAZY: Final[list[tuple[Schema, str]]] = []
_LAZY_NUMBERS: Final[dict[tuple[int, str], int]] = {}
#: Keywords whose values are data, not schemas.
VALUE_KEYWORDS: Final = frozenset({"example", "examples", "default", "enum", "const"})
_DATA: Final = frozenset({"enum", "const"})
_NAMING: Final = frozenset({"properties", "patternProperties", "dependentSchemas", "$defs", "definitions", "schemas"})
_CONSTRAINTS: Final = frozenset(
    {
        "type", "enum", "const", "properties", "required", "items", "prefixItems", "additionalProperties", "allOf",
        "anyOf", "oneOf", "not", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "multipleOf", "pattern",
        "format", "minLength", "maxLength", "minItems", "maxItems", "uniqueItems", "minProperties", "maxProperties",
        "if", "then", "else", "contains", "patternProperties", "dependentSchemas", "dependentRequired",
    }
)  # fmt: skip
_SCHEMA_WORDS: Final = _CONSTRAINTS - {"required"} | {"$ref"}
_OTHERS: Final = frozenset({"in", "content", "responses", "schema"})


class UnresolvedError(Exception):
    """Raised for a $ref without a target; the message names it."""


def target_of(document: Schema, reference: str) -> Any:
    """Return the target of a local ``#/...`` reference.

    Raises:
        UnresolvedError: the reference is not local, or has no target.
    """
    if reference == "#":
        return document
    if not reference.startswith("#/"):
        raise UnresolvedError(f"$ref {reference!r} is not local")
    value: Any = document
    for part in unquote(reference[2:]).split("/"):
        name = part.replace("~1", "/").replace("~0", "~")
        try:
            value = value[int(name)] if isinstance(value, list) else value[name]
        except (KeyError, IndexError, ValueError, TypeError) as error:
            raise UnresolvedError(f"$ref {reference!r} leads nowhere") from error
    return value


def resolved(document: Schema, value: Any, most: int = MOST_NODES) -> Any:
    """Return a copy of ``value`` with each ``$ref`` replaced by its target.

    A schema inside itself, or far down, stays a reference: to a lazily read schema, which `whole` and `Shape` follow.
    So does one with which the copy would have more than ``most`` nodes.

    Raises:
        UnresolvedError: a reference has no target.
    """
    return _Resolver(document, most=most).copy(value, ())


class _Resolver:
    """Copies parts of a document, with the targets of references in their places as far as a budget reaches."""

    def __init__(self, document: Schema, deepest: int = _DEEPEST, most: int = MOST_NODES) -> None:
        self._document = document
        self._deepest = deepest
        self._most = most
        self._nodes = 0
        self._alone = str(document.get("openapi", "")).startswith("3.0")

    def copy(self, value: Any, trail: tuple[str, ...], *, names: bool = False) -> Any:
        """Copy a part; ``names``: its keys are names that the author gave, and no words of JSON Schema."""
        self._nodes += 1
        if isinstance(value, list):
            return [self.copy(item, trail) for item in value]
        if not isinstance(value, dict):
            return value
        if isinstance(value.get("$ref"), str):
            return self._copy_target(value, value["$ref"], trail)
        # Values of enum and const are data, even if they look like schemas.
        return {
            key: item if key in _DATA and not names else self.copy(item, trail, names=key in _NAMING and not names)
            for key, item in value.items()
        }

    def _copy_target(self, value: Schema, reference: str, trail: tuple[str, ...]) -> Any:
        if reference.startswith(f"{LAZY_SCHEME}/"):
            return value  # a circular reference that was resolved before
        found = target_of(self._document, reference)
        # OpenAPI 3.0 ignores keywords beside a $ref, but authors mean `nullable` there.
        beside = {
            key: self.copy(item, trail)
            for key, item in value.items()
            if key != "$ref" and not (self._alone and key in _CONSTRAINTS)
        }
        if reference in trail or (isinstance(found, dict) and self._is_far(found, trail)):
            return {**beside, "$ref": lazy_reference(self._document, reference)}
        target = self.copy(found, (*trail, reference))
        if not isinstance(target, dict):
            return target
        if beside.keys() & target.keys() & _CONSTRAINTS:
            return {"allOf": [target, beside]}
        return {**target, **beside}

    def _is_far(self, target: Schema, trail: tuple[str, ...]) -> bool:
        is_schema = not _SCHEMA_WORDS.isdisjoint(target) and _OTHERS.isdisjoint(target)
        return is_schema and (len(trail) > self._deepest or _is_larger(target, self._most - self._nodes))


def _is_larger(value: Any, most: int) -> bool:
    """Return whether a part of a document has more nodes, without following references."""
    waiting = [value]
    while waiting and most >= 0:
        part = waiting.pop()
        most -= 1
        waiting += part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    return most < 0


def lazy_reference(document: Schema, reference: str) -> str:
    """Return the URI of a part of a document that is resolved where it is needed."""
    key = id(document), reference
    if key not in _LAZY_NUMBERS:
        _LAZY_NUMBERS[key] = len(_LAZY)
        _LAZY.append((document, reference))
    return f"{LAZY_SCHEME}/{_LAZY_NUMBERS[key]}"


def changed_alike(schema: Schema, change: str) -> Schema:
    """Return a changed schema whose lazy references lead to schemas with the same change.

    Args:
        schema: the schema after the change.
        change: the key of the change in `CHANGES`.
    """
    reference = schema.get("$ref")
    if not isinstance(reference, str) or not reference.startswith(LAZY_SCHEME) or reference.endswith(f",{change}"):
        return schema
    return {**schema, "$ref": f"{reference},{change}"}


@lru_cache(maxsize=4096)
def target_of_lazy(uri: str) -> Any:
    """Return the schema that the URI of a lazy reference leads to.

    Raises:
        UnresolvedError: it is another URI. Nothing is fetched for a schema.
    """
    if not uri.startswith(f"{LAZY_SCHEME}/"):
        raise UnresolvedError(f"$ref {uri!r} is not local")
    number, *changes = uri.removeprefix(f"{LAZY_SCHEME}/").split(",")
    document, reference = _LAZY[int(number)]
    schema = _Resolver(document, deepest=0).copy(target_of(document, reference), (reference,))
    for change in changes:
        schema = CHANGES[change](schema)
    return schema


def whole(schema: Schema) -> Schema:
    """Return a schema together with the keywords of its lazy reference's target, or the schema itself."""
    reference = schema.get("$ref")
    if reference is None:
        return schema
    seen: set[str] = set()
    while isinstance(reference, str) and reference.startswith(LAZY_SCHEME) and reference not in seen:
        seen.add(reference)
        target = target_of_lazy(reference)
        schema = {**target, **{key: item for key, item in schema.items() if key != "$ref"}}
        reference = schema.get("$ref")
    return schema


def modern(schema: Any) -> Any:
    """Return an OpenAPI 3.0 schema converted to Draft 2020-12, with whole numbers for integers."""
    if isinstance(schema, list):
        return [modern(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    result = {key: item if key in VALUE_KEYWORDS else modern(item) for key, item in schema.items()}
    if isinstance(result.get("nullable"), bool) and result.pop("nullable"):
        result = _with_null(result)
    if (
        isinstance(result.get("discriminator"), dict)
        and isinstance(result.get("oneOf"), list)
        and "anyOf" not in result
    ):
        # The discriminator names the alternative, even if others allow the value too (OpenAPI 3.1, 4.8.25).
        result["anyOf"] = result.pop("oneOf")
    for bound, exclusive in (("minimum", "exclusiveMinimum"), ("maximum", "exclusiveMaximum")):
        if isinstance(result.get(exclusive), bool) and result.pop(exclusive) and bound in result:
            result[exclusive] = result.pop(bound)
    if isinstance(result.get("items"), list):  # before 2020-12, a list in `items` described a tuple
        result["prefixItems"] = result.pop("items")
        if "additionalItems" in result:
            result["items"] = result.pop("additionalItems")
    if result.get("type") in ("integer", ["integer"], ["integer", "null"]):
        # Frameworks write an integer's bound 1 as 1.0, a form that some devices refuse in a request.
        result = {key: _as_integer(item) for key, item in result.items()}
    return changed_alike(result, "modern")


def _as_integer(value: Any) -> Any:
    if isinstance(value, list):
        return [_as_integer(item) for item in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _with_null(schema: Schema) -> Schema:
    """Return a schema that allows null as well: by its type and its enum, or as a further alternative."""
    if not isinstance(schema.get("type"), str):
        # OpenAPI 3.0.3 leaves it open what `nullable` beside `allOf` means; authors mean that null is allowed.
        return {"anyOf": [schema, {"type": "null"}]} if schema else schema
    enum = {"enum": [*schema["enum"], None]} if isinstance(schema.get("enum"), list) else {}
    return {**schema, "type": [schema["type"], "null"], **enum}


def opened(schema: Any) -> Any:
    """Return the schema without ``additionalProperties: false``, because responses may have further members."""
    if isinstance(schema, list):
        return [opened(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    found = {
        key: item if key in VALUE_KEYWORDS else opened(item)
        for key, item in schema.items()
        if not (key in {"additionalProperties", "unevaluatedProperties"} and item is False)
    }
    return changed_alike(found, "opened")


#: Functions that change the schema behind a lazy reference, by the name that the reference gives.
CHANGES: Final[dict[str, Callable[[Any], Any]]] = {"modern": modern, "opened": opened}


def types_of(schema: Schema) -> tuple[str, ...]:
    """Return the JSON types in a schema's ``type``; empty if it has none."""
    schema = whole(schema)
    given = schema.get("type", ())
    if isinstance(given, str):
        return (given,)
    if given:
        return tuple(given)
    if "properties" in schema:
        return ("object",)
    return ("array",) if "items" in schema else ()


def kind_of(schema: Schema) -> str:
    """Return the JSON type of a schema, null aside; ``string`` if the schema does not restrict it to one."""
    return next((name for name in types_of(schema) if name != "null"), "string")


def kinds_of(schema: Schema) -> frozenset[str]:
    """Return the JSON types that a value may have in any alternative, null aside; empty if not restricted."""
    schema = whole(schema)
    named = types_of(schema)
    if not named and ("enum" in schema or "const" in schema):
        named = tuple(_type_of(value) for value in schema.get("enum", [schema.get("const")]))
    if named:
        return frozenset(named) - {"null"}
    for key in ("anyOf", "oneOf"):
        alternatives = [kinds_of(part) for part in schema.get(key, ()) if types_of(part) != ("null",)]
        if alternatives:
            return frozenset().union(*alternatives) if all(alternatives) else frozenset()
    return next(filter(None, map(kinds_of, schema.get("allOf", ()))), frozenset())


def is_numeric(schema: Schema) -> bool:
    """Return whether every value of a schema is a number, or null."""
    return bool(kinds_of(schema)) and kinds_of(schema) <= {"number", "integer"}


def _type_of(value: Any) -> str:
    """Return the JSON type of a value."""
    for kind, name in ((bool, "boolean"), (int, "integer"), (float, "number"), (str, "string"), (list, "array")):
        if isinstance(value, kind):
            return name
    return "null" if value is None else "object"


def is_number(value: Any) -> bool:
    """Return whether a JSON value is a number that a double can represent; integers count too."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(as_double(value))


def bundled(schema: Schema) -> Schema:
    """Return a schema with the targets of its lazy references below ``$defs``, or the schema itself."""
    waiting: list[str] = []
    result: Schema = bundled_into(schema, waiting)
    found: dict[str, Any] = {}
    while waiting:
        uri = waiting.pop()
        if (name := uri.removeprefix(f"{LAZY_SCHEME}/")) not in found:
            found[name], more = bundled_part(uri)
            waiting += more
    return {**result, "$defs": found} if found else schema


def bundled_into(value: Any, uris: list[str]) -> Any:
    """Return a copy of a schema whose lazy references lead below ``$defs``, and add their URIs to a list."""
    if isinstance(value, list):
        return [bundled_into(item, uris) for item in value]
    if not isinstance(value, dict):
        return value
    result = {key: bundled_into(item, uris) for key, item in value.items()}
    uri = value.get("$ref")
    if isinstance(uri, str) and uri.startswith(LAZY_SCHEME):
        uris.append(uri)
        result["$ref"] = f"#/$defs/{uri.removeprefix(f'{LAZY_SCHEME}/')}"
    return result


@lru_cache(maxsize=4096)
def bundled_part(uri: str) -> tuple[Any, tuple[str, ...]]:
    """Return the schema of a lazy reference as `bundled` has it, and the URIs that it refers to; many share it."""
    uris: list[str] = []
    return bundled_into(target_of_lazy(uri), uris), tuple(uris)


def numbers_in(value: Any) -> Iterator[float]:
    """Yield all numbers in a JSON value as doubles."""
    if isinstance(value, bool):
        return
    if isinstance(value, int | float):
        yield as_double(value)
    elif isinstance(value, list):
        for item in value:
            yield from numbers_in(item)
    elif isinstance(value, dict):
        for item in value.values():
            yield from numbers_in(item)


def as_double(value: float) -> float:
    """Return a JSON number as a double; an integer too large for a double becomes infinite."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
