"""Where the schemas of an OpenAPI document are, and the names by which they refer to each other.

Words of one version of OpenAPI have another meaning in a document of another version, or none.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from copy import deepcopy
from typing import Any, Final
from urllib.parse import unquote

from conformance.documents.json_schema import Schema, modern
from conformance.transport.reach import joined

#: Key below which a description that was merged into one document keeps the contents of other files.
FILES: Final = "x-roaas-files"
_ONE: Final = frozenset(
    {
        "items", "additionalItems", "unevaluatedItems", "contains", "additionalProperties", "unevaluatedProperties",
        "propertyNames", "not", "if", "then", "else", "contentSchema",
    }
)  # fmt: skip
_NAMED: Final = frozenset({"properties", "patternProperties", "dependentSchemas", "$defs", "definitions"})
_SEVERAL: Final = frozenset({"allOf", "anyOf", "oneOf", "prefixItems"})
_WORDS: Final = frozenset({*_ONE, *_NAMED, *_SEVERAL, "type", "enum", "const", "$id", "$schema", "$anchor"})
# Keywords whose value is data: nothing in it is a schema or a reference.
DATA: Final = frozenset({"example", "examples", "default", "enum", "const", "value", "dataValue"})
_UNBOUND: Final = frozenset({"additionalProperties", "unevaluatedProperties"})
# Keywords which show that an object is no schema, although it shares other keywords with schemas.
_NO_SCHEMA: Final = frozenset({"openapi", "swagger", "in", "content", "responses", "paths", "schema", "url"})

Holder = dict[str, Any] | list[Any]


def schema_places(document: Any) -> Iterator[tuple[Holder, Any, str]]:
    """Yield the place of each schema, outer ones first: its holder, its key there, and its JSON pointer."""
    waiting: list[tuple[Holder, Any, str, bool]] = [([document], 0, "", _is_schema(document))]
    while waiting:
        holder, key, pointer, is_schema = waiting.pop()
        if is_schema:
            yield holder, key, pointer
        value = holder[key]  # the caller may have replaced it
        if isinstance(value, list) and not is_schema:
            waiting += [(value, i, f"{pointer}/{i}", False) for i in range(len(value))]
        for name in value if isinstance(value, dict) else ():
            below = f"{pointer}/{str(name).replace('~', '~0').replace('/', '~1')}"
            waiting += _inner(value, name, below) if is_schema else _outer(value, name, below)


def _is_schema(value: Any) -> bool:
    return isinstance(value, dict) and not _WORDS.isdisjoint(value) and _NO_SCHEMA.isdisjoint(value)


def _inner(schema: dict[str, Any], name: str, pointer: str) -> list[tuple[Holder, Any, str, bool]]:
    """Return the places of the schemas under one word of a schema."""
    part = schema[name]
    if name in _ONE and isinstance(part, dict | bool):
        return [(schema, name, pointer, True)]
    if name in _NAMED and isinstance(part, dict):
        return [(part, key, f"{pointer}/{str(key).replace('~', '~0').replace('/', '~1')}", True) for key in part]
    if (name in _SEVERAL or name == "items") and isinstance(part, list):
        return [(part, i, f"{pointer}/{i}", True) for i in range(len(part))]
    return []


def _outer(value: dict[str, Any], name: str, pointer: str) -> list[tuple[Holder, Any, str, bool]]:
    """Return the places under one word of an object that is no schema."""
    part = value[name]
    if name in {"schema", "itemSchema"}:
        return [(value, name, pointer, True)]
    if name in {"schemas", "definitions"} and isinstance(part, dict):
        return [(part, key, f"{pointer}/{str(key).replace('~', '~0').replace('/', '~1')}", True) for key in part]
    if name == FILES:
        return [(part, key, f"{pointer}/{key}", _is_schema(part[key])) for key in part]
    if name in DATA - {"examples"} or not isinstance(part, dict | list):
        return []
    return [(value, name, pointer, False)]


def make_plain(document: Any, location: str) -> dict[str, str]:  # noqa: C901 - one loop over schemas
    """Rewrite a document so that schemas are objects, and refer to each other only by JSON pointers.

    ``true`` becomes ``{}``, ``false`` becomes ``{"not": {}}``. References by ``$id``, ``$anchor`` and
    ``$dynamicAnchor`` become references by pointer. A ``$dynamicRef`` that may mean several schemas is dropped: any
    value passes there.

    Args:
        document: changed in place.
        location: its URL or path.

    Returns:
        The pointer of each anchor that other files may refer to.
    """
    base = joined(location, document.get("$self", "")) if isinstance(document, dict) else location
    bases = {"": base}
    anchors: dict[tuple[str, str], str] = {}
    dynamic: dict[str, list[str]] = {}
    roots = {base: ""}
    placed = []
    for holder, key, pointer in schema_places(document):
        schema = holder[key]
        if isinstance(schema, bool):
            if not (isinstance(holder, dict) and key in _UNBOUND and _is_schema(holder)):
                holder[key] = {} if schema else {"not": {}}
            continue
        if not isinstance(schema, dict):
            continue
        own = _base_of(pointer, bases)
        schema.pop("$schema", None)
        if isinstance(given := schema.pop("$id", None), str):
            bases[pointer] = own = joined(own, given.partition("#")[0])
            roots[own] = pointer
        for word in ("$anchor", "$dynamicAnchor"):
            if isinstance(name := schema.pop(word, None), str):
                anchors[own, name] = pointer
                if word == "$dynamicAnchor":
                    dynamic.setdefault(name, []).append(pointer)
        placed.append((schema, own))
    for schema, own in placed:
        wanted = schema.pop("$dynamicRef", None)
        if isinstance(wanted, str):
            named = dynamic.get(wanted.partition("#")[2], [])
            if len(named) < 2:  # noqa: PLR2004 - of several, the caller decides
                schema["$ref"] = f"#{named[0]}" if named else wanted
        if isinstance(schema.get("$ref"), str):
            schema["$ref"] = _by_pointer(schema["$ref"], own, roots, anchors)
    return {name: pointer for (uri, name), pointer in anchors.items() if uri == base}


def _base_of(pointer: str, bases: dict[str, str]) -> str:
    """Return the base URI of a place: that of the nearest schema around it with an ``$id``."""
    if len(bases) == 1:
        return bases[""]
    while pointer not in bases:
        pointer = pointer.rpartition("/")[0]
    return bases[pointer]


def _by_pointer(reference: str, base: str, roots: dict[str, str], anchors: dict[tuple[str, str], str]) -> str:
    """Return a reference within the document as a JSON pointer, and any other reference unchanged."""
    uri, fragment = base, reference[1:]
    if not reference.startswith("#"):
        uri, _, fragment = joined(base, reference).partition("#")
    if uri not in roots:
        return reference
    if fragment and not fragment.startswith("/"):
        found = anchors.get((uri, unquote(fragment)))
        return reference if found is None else f"#{found}"
    return f"#{roots[uri]}{fragment}"


# Keywords that OpenAPI 3.1 took from JSON Schema 2020-12; OpenAPI 3.0 and Swagger 2.0 do not have them (OpenAPI 3.0,
# 4.7.24).
_NEW: Final = frozenset(
    {
        "const", "prefixItems", "contains", "minContains", "maxContains", "patternProperties", "propertyNames", "if",
        "then", "else", "dependentSchemas", "dependentRequired", "unevaluatedItems", "unevaluatedProperties", "$defs",
        "$id", "$schema", "$anchor", "$dynamicAnchor", "$dynamicRef", "$comment", "contentEncoding",
        "contentMediaType", "contentSchema", "examples",
    }
)  # fmt: skip
_BOUNDS: Final = frozenset({"exclusiveMinimum", "exclusiveMaximum"})
# OpenAPI 3.0 ignores keywords beside a $ref, but authors mean `nullable` there.
_BESIDE_REFERENCE: Final = frozenset({"$ref", "nullable"})
_OF_2020: Final = ("https://json-schema.org/draft/2020-12/", "https://spec.openapis.org/oas/3.")
# Vendor extensions, whose content is no part of the description.
_EXTENSION: Final = re.compile(r"(?<!/headers)(?<!/schemas)(?<!/properties)(?<!/definitions)/x-(?!roaas-files/)")
# Places of a keyword that a message names.
_PLACES: Final = 20


def foreign_words(document: Schema) -> list[str]:
    """Return each keyword of another OpenAPI version in the schemas of a document, with its places."""
    places: dict[str, list[str]] = {}
    for _, _, told, pointer in _find(document):
        places.setdefault(told, []).append(pointer)
    version, other = ("3.0 or 2.0", "3.1") if _is_old(document) else ("3.1 or later", "3.0")
    return [
        f"{told}, a word of OpenAPI {other} in a document of {version}, at {', '.join(found[:_PLACES])}"
        + (f" and {len(found) - _PLACES} more places" if len(found) > _PLACES else "")
        for told, found in places.items()
    ]


def without_foreign_words(document: Schema) -> Schema:
    """Return a document without these keywords, so that its other faults can be found."""
    found = list(_find(document))
    if not found:
        return document
    plain: Schema = deepcopy(document)
    for holder, key, _, _ in list(_find(plain)):
        if isinstance(holder, dict) and not isinstance(holder[key], bool):
            del holder[key]
        else:
            holder[key] = {}
    return plain


def in_one_version(document: Schema) -> Schema:
    """Return a document that mixes schema keywords of two versions as OpenAPI 3.1; any other document unchanged.

    Each word keeps its meaning, because its author means that.
    """
    if next(_find(document), None) is None:
        return document
    found: Schema = deepcopy(document)
    is_old = _is_old(found)
    for holder, key, _ in schema_places(found):
        schema = holder[key]
        if is_old and isinstance(schema, dict) and "$ref" in schema:
            schema = {word: schema[word] for word in schema if word in _BESIDE_REFERENCE}
        holder[key] = modern(schema)
    return {**found, "openapi": "3.1.0"} if is_old else found


def in_extension(pointer: str) -> bool:
    """Return whether a place is in a vendor's extension (x-...), which may hold anything."""
    return _EXTENSION.search(pointer) is not None


def _is_old(document: Schema) -> bool:
    return str(document.get("openapi") or document.get("swagger"))[:3] in {"2.0", "3.0"}


def _find(document: Schema) -> Iterator[tuple[Holder, Any, str, str]]:
    """Yield the holder of each such keyword, its key, its name in messages, and the JSON pointer of its schema."""
    is_old = _is_old(document)
    others = [] if _is_2020(document.get("jsonSchemaDialect")) else [""]
    for holder, key, pointer in schema_places(document):
        schema = holder[key]
        if in_extension(pointer):
            continue
        if isinstance(schema, bool) and is_old and key != "additionalProperties":
            yield holder, key, json.dumps(schema), pointer
        if not isinstance(schema, dict):
            continue
        if not is_old and not _is_2020(schema.get("$schema")):
            others.append(pointer)
        if any(pointer == other or pointer.startswith(f"{other}/") for other in others):
            continue
        for word, value in schema.items():
            if told := _new(word, value) if is_old else _old(word, value):
                yield schema, word, told, pointer


def _is_2020(dialect: Any) -> bool:
    return dialect is None or (isinstance(dialect, str) and dialect.startswith(_OF_2020))


def _new(word: str, value: Any) -> str:
    """Return the message on a keyword that OpenAPI 3.1 has and 3.0 lacks; empty for any other."""
    if word == "type" and (value == "null" or isinstance(value, list)):
        return json.dumps({word: value})
    if word in _BOUNDS and not isinstance(value, bool):
        return f"{word} as a number"
    return word if word in _NEW else ""


def _old(word: str, value: Any) -> str:
    """Return the message on a keyword that OpenAPI 3.0 has and 3.1 lacks; empty for any other."""
    if word in _BOUNDS and isinstance(value, bool):
        return json.dumps({word: value})
    return "items as an array" if word == "items" and isinstance(value, list) else ""
