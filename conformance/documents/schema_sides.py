"""Prepare the schemas of a description for a comparison: only the words that decide which values are valid.

References become those to ``#/$defs/…``, so recursion stays as it is. Formats of numbers become bounds, a discriminator
becomes the values that choose each alternative, and members that are not sent in a direction may have any value.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from conformance.documents.json_schema import Schema, UnresolvedError, modern, target_of

#: Keywords with one schema, then those with a list of schemas, and those with an object of schemas.
ONE: Final = (
    "items", "additionalProperties", "contains", "propertyNames", "not", "if", "then", "else", "unevaluatedItems",
    "unevaluatedProperties",
)  # fmt: skip
MANY: Final = ("allOf", "anyOf", "oneOf", "prefixItems")
NAMED: Final = ("properties", "patternProperties", "dependentSchemas")
#: Keywords that no validator judges, although they say what a value means.
OPAQUE: Final = ("contentMediaType", "contentEncoding", "contentSchema", "xml")
#: Schema of a member that is not sent in this direction, which allows any value.
UNSENT: Final[Schema] = {"readOnly": True}
_PLAIN: Final = frozenset(
    {
        "type", "enum", "const", "multipleOf", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum",
        "minLength", "maxLength", "pattern", "format", "minItems", "maxItems", "uniqueItems", "minContains",
        "maxContains", "minProperties", "maxProperties", "required", "dependentRequired",
    }
)  # fmt: skip
_FLOAT: Final = 3.4028234663852886e38
_RANGES: Final = {
    "int32": (-(2**31), 2**31 - 1), "int64": (-(2**63), 2**63 - 1), "float": (-_FLOAT, _FLOAT),
    "int8": (-128, 127), "uint8": (0, 255), "int16": (-(2**15), 2**15 - 1), "uint16": (0, 2**16 - 1),
    "uint32": (0, 2**32 - 1), "uint64": (0, 2**64 - 1),
}  # fmt: skip
# Formats that allow every value of the type; JSON numbers are doubles here.
_WITHOUT_MEANING: Final = frozenset({"double", "password", "binary"})


class Side:
    """The schemas of one description for values that go in one direction.

    Args:
        name: the name of the side, in its references.
        document: as one OpenAPI 3 document.
        request: whether clients send the values.
        media_type: the media type of the values.
    """

    def __init__(self, name: str, document: Schema, *, request: bool, media_type: str = "") -> None:
        self.name, self.document = name, document
        self.definitions: dict[str, Any] = {}
        self._absent = "readOnly" if request else "writeOnly"
        self._names: dict[tuple[str, frozenset[str], bool], str] = {}
        # OpenAPI 3.0, 4.7.23: keywords beside a reference are ignored.
        self._alone = str(document.get("openapi", "")).startswith("3.0")
        self._opaque = OPAQUE if "xml" in media_type else OPAQUE[:-1]

    def schema(self, given: Any) -> Any:
        """Return a schema of the document as this direction uses it, in the form of JSON Schema 2020-12."""
        return self._prepare(modern(given), frozenset())

    def target(self, schema: Any) -> Any:
        """Return the schema that a prepared schema refers to; itself, if it is no plain reference."""
        trail = set()
        while isinstance(schema, dict) and schema.keys() == {"$ref"} and schema["$ref"] not in trail:
            trail.add(schema["$ref"])
            schema = self.definitions[schema["$ref"]]
        return {} if isinstance(schema, dict) and schema.get("$ref") in trail else schema

    def _prepare(self, given: Any, unsent: frozenset[str], *, base: bool = False) -> Any:
        if isinstance(given, bool):
            return given
        if not isinstance(given, dict):
            return {}
        reference = given.get("$ref", given.get("$dynamicRef"))
        if isinstance(reference, str):
            pointer = {"$ref": self._definition(reference, unsent, base=base)}
            beside = {key: value for key, value in given.items() if key not in {"$ref", "$dynamicRef"}}
            return pointer if self._alone else {**self._prepare(beside, unsent), **pointer}
        unsent |= self._unsent(given)
        found = {key: value for key, value in given.items() if key in _PLAIN or key in self._opaque}
        found |= {key: self._prepare(given[key], frozenset()) for key in ONE if isinstance(given.get(key), dict | bool)}
        for key in MANY:
            inner = unsent if key != "prefixItems" else frozenset[str]()
            if isinstance(given.get(key), list):
                found[key] = [self._prepare(part, inner, base=key == "allOf") for part in given[key]]
        for key in NAMED:
            if isinstance(given.get(key), dict):
                found[key] = {name: self._prepare(part, frozenset()) for name, part in given[key].items()}
        self._limit_choices(found, given)
        return self._plain(found, given, unsent)

    def _plain(self, found: Schema, given: Schema, unsent: frozenset[str]) -> Schema:
        """Return a schema in which words of older drafts have their new form, and nothing unsent is demanded."""
        if isinstance(given.get("items"), list):
            found["prefixItems"] = [self._prepare(part, frozenset()) for part in given["items"]]
        required = found.get("required")
        if "required" in found:
            found["required"] = sorted(set(required) - unsent) if isinstance(required, list) else []
            if not found["required"]:
                del found["required"]
        if unsent and isinstance(found.get("properties"), dict):
            found["properties"] = {
                name: UNSENT if name in unsent else part for name, part in found["properties"].items()
            }
        for key in ("exclusiveMinimum", "exclusiveMaximum"):
            if isinstance(found.get(key), bool):
                del found[key]
        form = found.get("format")
        if form in _WITHOUT_MEANING:
            del found["format"]
        elif form in _RANGES and found.get("type") != "string":
            del found["format"]
            least, most = _RANGES[form]
            found["minimum"] = max(found.get("minimum", least), least)
            found["maximum"] = min(found.get("maximum", most), most)
        if form == "byte" and found.get("type") == "string":
            del found["format"]
            found["contentEncoding"] = "base64"
        return found

    def _unsent(self, given: Any, depth: int = 0) -> frozenset[str]:
        """Return the members that are not sent in this direction (OpenAPI 3.0, 4.7.24.2)."""
        given = self._follow(given)
        if not isinstance(given, dict) or depth > 8:  # noqa: PLR2004 - a chain of inheritance that is longer is a circle
            return frozenset()
        properties, parts = given.get("properties"), given.get("allOf")
        own = properties.items() if isinstance(properties, dict) else ()
        found = {name for name, part in own if self._is_unsent(part)}
        return frozenset(found).union(*(self._unsent(part, depth + 1) for part in parts or ()))

    def _is_unsent(self, part: Any) -> bool:
        if not isinstance(part, dict):
            return False
        target = self._follow(part)
        inner = [*(part.get("allOf") or ()), target] + (target.get("allOf") or [] if isinstance(target, dict) else [])
        return any(
            isinstance(item, dict) and item.get(self._absent) is True for item in (part, *map(self._follow, inner))
        )

    def _follow(self, value: Any) -> Any:
        for _ in range(8):
            if not (isinstance(value, dict) and isinstance(value.get("$ref"), str)):
                return value
            value = self._raw(value["$ref"])
        return {}

    def _raw(self, reference: str) -> Any:
        try:
            return target_of(self.document, reference)
        except UnresolvedError:
            name = reference.rpartition("#")[2] or reference
            return next(_schemas_named(self.document, name), {})

    def _definition(self, reference: str, unsent: frozenset[str], *, base: bool) -> str:
        """Return the reference to a prepared target. With ``base``, a child refers to the schema it inherits from."""
        key = (reference, unsent, base)
        if key not in self._names:
            name = self._names[key] = f"#/$defs/{self.name}{len(self._names)}"
            self.definitions[name] = {}
            target = modern(self._raw(reference))
            heirs = [] if base else self._heirs(reference, target)
            self.definitions[name] = (
                {"anyOf": heirs} if heirs else self._prepare(target, unsent, base=base and "$ref" in (target or ()))
            )
        return self._names[key]

    def _limit_choices(self, found: Schema, given: Schema) -> None:
        """Let each alternative have only the values of the discriminator that choose it (OpenAPI 3.1, 4.8.25)."""
        one = given.get("discriminator")
        if not isinstance(one, dict) or not isinstance(one.get("propertyName"), str):
            return
        for key in ("anyOf", "oneOf"):
            for number, part in enumerate(given.get(key) or ()):
                if isinstance(part, dict) and isinstance(part.get("$ref"), str):
                    found[key][number] = {"allOf": [found[key][number], _choice(one, part["$ref"])]}

    def _heirs(self, reference: str, target: Any) -> list[Schema]:
        """Return the schemas that inherit from a target with a discriminator and no alternatives, and itself."""
        one = target.get("discriminator") if isinstance(target, dict) else None
        if not isinstance(one, dict) or "propertyName" not in one or {"anyOf", "oneOf"} & target.keys():
            return []
        schemas = self.document.get("components", {}).get("schemas", {})
        heirs = [
            f"#/components/schemas/{name}"
            for name, schema in schemas.items()
            if isinstance(schema, dict) and {"$ref": reference} in (schema.get("allOf") or ())
        ]
        found = [
            {"allOf": [{"$ref": self._definition(heir, frozenset(), base=False)}, _choice(one, heir)]} for heir in heirs
        ]
        itself = {"$ref": self._definition(reference, frozenset(), base=True)}
        return [*found, {"allOf": [itself, _choice(one, reference)]}] if found else []


def is_same(old: Any, new: Any, one: Side, other: Side, seen: set[tuple[str, str]]) -> bool:
    """Return whether two prepared schemas are written alike, whatever their references are called."""
    if isinstance(old, dict) and isinstance(new, dict):
        if isinstance(old.get("$ref"), str) and isinstance(new.get("$ref"), str):
            pair = old["$ref"], new["$ref"]
            if pair not in seen:
                seen.add(pair)
                if not is_same(one.definitions[pair[0]], other.definitions[pair[1]], one, other, seen):
                    return False
        elif "$ref" in old or "$ref" in new:
            # If only one side is a plain reference, compare the schema that it refers to.
            old, new = one.target(old), other.target(new)
            if not (isinstance(old, dict) and isinstance(new, dict)):
                return bool(old == new)
        keys = old.keys() | new.keys()
        return old.keys() == new.keys() and all(
            key == "$ref" or is_same(old[key], new[key], one, other, seen) for key in keys
        )
    if isinstance(old, list) and isinstance(new, list):
        return len(old) == len(new) and all(is_same(*pair, one, other, seen) for pair in zip(old, new, strict=True))
    return type(old) is type(new) and bool(old == new)


def _choice(discriminator: Schema, reference: str) -> Schema:
    """Return a schema of the values that choose a schema: those of the mapping, or else its name."""
    member, name = discriminator["propertyName"], reference.rpartition("/")[2]
    mapping = discriminator.get("mapping") or {}
    named = sorted(value for value, target in mapping.items() if target in {reference, name})
    return {"type": "object", "required": [member], "properties": {member: {"enum": named or [name]}}}


def _schemas_named(value: Any, name: str) -> Iterator[Any]:
    """Yield the schemas that have a name by $anchor, $dynamicAnchor or $id."""
    if isinstance(value, dict):
        if name in (value.get("$anchor"), value.get("$dynamicAnchor"), value.get("$id")):
            yield value
        for part in value.values():
            yield from _schemas_named(part, name)
    elif isinstance(value, list):
        for part in value:
            yield from _schemas_named(part, name)


_DEPTH: Final = 8
_MOST: Final = 40
# Keywords that apply to what other keywords of the same schema leave over.
_RELATIVE: Final = frozenset(
    {"additionalProperties", "patternProperties", "unevaluatedProperties", "unevaluatedItems", "prefixItems", "items"}
)
_BOUNDS: Final = {
    "minimum": max, "exclusiveMinimum": max, "minLength": max, "minItems": max, "minProperties": max,
    "maximum": min, "exclusiveMaximum": min, "maxLength": min, "maxItems": min, "maxProperties": min,
}  # fmt: skip


def alternatives(schema: Any, side: Side, depth: int = 0) -> list[Any]:
    """Return schemas of which a value meets at least one: those of anyOf, oneOf and several types."""
    given = plain(schema, side)
    if not isinstance(given, dict) or depth > _DEPTH:
        return [given]
    key = next((key for key in ("anyOf", "oneOf") if given.get(key)), None)
    found = [given]
    if key is not None and not ({"anyOf", "oneOf", "allOf", "$ref"} - {key}) & given.keys():
        base = {word: value for word, value in given.items() if word != key}
        parts = [plain({"allOf": [base, part]} if base else part, side) for part in given[key]]
        found = [alternative for part in parts for alternative in alternatives(part, side, depth + 1)]
        found = found if len(found) <= _MOST else [given]
    return [
        {**item, "type": kind} if kind else item
        for item in found
        for kind in (item["type"] if isinstance(item, dict) and isinstance(item.get("type"), list) else ("",))
    ]


def plain(schema: Any, side: Side, depth: int = 0) -> Any:
    """Return a schema without allOf and references, where that can be written as one schema."""
    schema = side.target(schema)
    if not isinstance(schema, dict) or not {"allOf", "$ref"} & schema.keys() or depth > _DEPTH:
        return schema
    base: Any = {key: value for key, value in schema.items() if key not in {"allOf", "$ref"}}
    parts = [*schema.get("allOf", ()), *([{"$ref": schema["$ref"]}] if "$ref" in schema else ())]
    for part in parts:
        base = _merge(base, plain(part, side, depth + 1))
        if base is None:
            return schema
    return base


def _merge(one: Any, other: Any) -> Any:
    """Return a schema that demands what both do; None if they cannot be merged."""
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
