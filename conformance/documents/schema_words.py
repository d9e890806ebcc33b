"""Words of one version of OpenAPI's schemas in a document of another: where they stand, and what they mean there."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from copy import deepcopy
from typing import Any, Final

from conformance.documents.json_schema import Schema, modern
from conformance.documents.schema_places import Holder, schema_places

# OpenAPI 3.1 took these from JSON Schema 2020-12; OpenAPI 3.0 and Swagger 2.0 do not have them (OpenAPI 3.0, 4.7.24).
_NEW: Final = frozenset(
    {
        "const", "prefixItems", "contains", "minContains", "maxContains", "patternProperties", "propertyNames", "if",
        "then", "else", "dependentSchemas", "dependentRequired", "unevaluatedItems", "unevaluatedProperties", "$defs",
        "$id", "$schema", "$anchor", "$dynamicAnchor", "$dynamicRef", "$comment", "contentEncoding",
        "contentMediaType", "contentSchema", "examples",
    }
)  # fmt: skip
_BOUNDS: Final = frozenset({"exclusiveMinimum", "exclusiveMaximum"})
# In a document of 3.0, what stands beside a $ref is ignored; `nullable` is taken as its author means it.
_BESIDE_REFERENCE: Final = frozenset({"$ref", "nullable"})
_OF_2020: Final = ("https://json-schema.org/draft/2020-12/", "https://spec.openapis.org/oas/3.")
# A vendor's extension, whose content is no part of the description.
_EXTENSION: Final = re.compile(r"(?<!/headers)(?<!/schemas)(?<!/properties)(?<!/definitions)/x-(?!roaas-files/)")
# As many places of one word are named.
_PLACES: Final = 20


def foreign_words(document: Schema) -> list[str]:
    """Return each word of another version in the schemas of a document, with the places where it stands."""
    places: dict[str, list[str]] = {}
    for _, _, told, pointer in _found(document):
        places.setdefault(told, []).append(pointer)
    version, other = ("3.0 or 2.0", "3.1") if _is_old(document) else ("3.1 or later", "3.0")
    return [
        f"{told}, a word of OpenAPI {other} in a document of {version}, at {', '.join(found[:_PLACES])}"
        + (f" and {len(found) - _PLACES} more places" if len(found) > _PLACES else "")
        for told, found in places.items()
    ]


def without_foreign_words(document: Schema) -> Schema:
    """Return a document without these words, so that its other faults can be looked for."""
    found = list(_found(document))
    if not found:
        return document
    plain: Schema = deepcopy(document)
    for holder, key, _, _ in list(_found(plain)):
        if isinstance(holder, dict) and not isinstance(holder[key], bool):
            del holder[key]
        else:
            holder[key] = {}
    return plain


def in_one_version(document: Schema) -> Schema:
    """Return a document whose schemas mix the words of two versions as one of OpenAPI 3.1; any other as it is.

    Each word keeps its meaning, because its author means that.
    """
    if next(_found(document), None) is None:
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


def _found(document: Schema) -> Iterator[tuple[Holder, Any, str, str]]:
    """Yield what holds each such word, its key there, the word as it is told, and the JSON pointer of its schema."""
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
    """Return a word that OpenAPI 3.1 has and 3.0 has not, as it is told; empty if it is another."""
    if word == "type" and (value == "null" or isinstance(value, list)):
        return json.dumps({word: value})
    if word in _BOUNDS and not isinstance(value, bool):
        return f"{word} as a number"
    return word if word in _NEW else ""


def _old(word: str, value: Any) -> str:
    """Return a word that OpenAPI 3.0 has and 3.1 has not, as it is told; empty if it is another."""
    if word in _BOUNDS and isinstance(value, bool):
        return json.dumps({word: value})
    return "items as an array" if word == "items" and isinstance(value, list) else ""
