"""What cannot be read in a description is left out of it, so that the rest is judged; `file-valid` judges the file."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from typing import Any, Final

import jsonschema_rs

from conformance.documents.description_faults import misplaced, reason
from conformance.documents.json_schema import Schema, UnresolvedError, modern, pointed, resolved
from conformance.documents.openapi import methods_of, read_operations
from conformance.documents.schema_budget import Growth
from conformance.documents.schema_places import schema_places
from conformance.documents.schema_words import in_extension

_UNREADABLE: Final = (UnresolvedError, AttributeError, TypeError, KeyError, ValueError)
# Of a place so many characters are shown, and so many lines are.
_SHOWN: Final = 300
_LINES: Final = 200
_META: Final = jsonschema_rs.validator_for({"$ref": "https://json-schema.org/draft/2020-12/schema"})


def without_unreadable(document: Schema, original: Schema | None = None) -> tuple[Schema, list[str]]:
    """Return a document without its unreadable schemas and operations, and a line on each.

    Such a schema allows any value, and such an operation is not there. The lines name the places in the original.
    """
    document, lines = _without_schemas(document)
    bare = _bare(document)
    try:
        read_operations(bare)
    except _UNREADABLE:
        found, more = _without_operations(document, bare, misplaced(original or document))
        return found, _some([*lines, *more])
    return document, _some(lines)


def _some(lines: list[str]) -> list[str]:
    return lines if len(lines) <= _LINES else [*lines[:_LINES], f"{len(lines) - _LINES:,} more are not judged"]


def _bare(value: Any) -> Any:
    """Return a part of a document without its schemas, which are what takes time to read."""
    if isinstance(value, list):
        return [_bare(item) for item in value]
    if not isinstance(value, dict):
        return value
    return {key: {} if key in {"schema", "schemas", "itemSchema"} else _bare(item) for key, item in value.items()}


def without_large(document: Schema) -> Schema:
    """Return a description in which any value is valid where a schema is too large to judge by."""
    growth = Growth(document)
    places = [(holder, key) for holder, key, pointer in schema_places(document) if not in_extension(pointer)]
    return _without_schemas(document)[0] if any(growth.fault(holder[key]) for holder, key in places[::-1]) else document


def _without_schemas(document: Schema) -> tuple[Schema, list[str]]:
    growth = Growth(document)
    every = (holder[key] for holder, key, pointer in schema_places(document) if not in_extension(pointer))
    if not any(map(_fault, _outermost(document))) and not any(map(growth.fault, every)):
        return document, []
    found: Schema = deepcopy(document)
    growth = Growth(found)
    lines = []
    # Inner ones first, so that as little as possible is left out.
    for holder, key, pointer in reversed(list(schema_places(found))):
        if in_extension(pointer):
            continue
        if fault := _fault(holder[key]):
            fault = f"it is no JSON Schema: {fault}"
        elif fault := growth.fault(holder[key]):
            fault = f"it is too large: {fault}"
        if fault:
            holder[key] = {}
            lines.append(f"{pointer[:_SHOWN]}: not judged: {fault}")
    return found, lines[::-1]


def _outermost(document: Schema) -> Iterator[Any]:
    """Yield the schemas of a document that are in no other schema."""
    around = "#"
    for holder, key, pointer in schema_places(document):
        if not pointer.startswith(f"{around}/") and not in_extension(pointer):
            around = pointer
            yield holder[key]


def _fault(schema: Any) -> str:
    """Return why a schema is none; empty if it is one."""
    try:
        error = next(iter(_META.iter_errors(modern(schema))), None)
    except _UNREADABLE as broken:
        return repr(broken)
    return "" if error is None else error.message.splitlines()[0][:160]


def _without_operations(document: Schema, bare: Schema, faults: list[tuple[str, str]]) -> tuple[Schema, list[str]]:
    lines, paths = [], {}
    for path, item in document["paths"].items():
        try:
            whole = pointed(document, item["$ref"]) if isinstance(item, dict) and "$ref" in item else item
            broken = dict(_broken(bare, path, faults)) if isinstance(whole, dict) else {"": "it is no object"}
        except _UNREADABLE as error:
            whole, broken = None, {"": reason(error, faults, ("paths", path), ("components",))}
        lines += [f"{f'{method} {path}'.strip()}: not judged: {why}" for method, why in broken.items()]
        if not broken:
            paths[path] = item
        elif isinstance(whole, dict):
            more = whole.get("additionalOperations")
            kept = {key: one for key, one in whole.items() if key.upper() not in broken and one is not more}
            if isinstance(more, dict):
                kept["additionalOperations"] = {key: one for key, one in more.items() if key not in broken}
            paths[path] = kept
    return {**document, "paths": paths}, lines


def _broken(document: Schema, path: str, faults: list[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Yield the method of each operation of a path that cannot be read, and why."""
    item = resolved(document, document["paths"][path])
    for method, operation in methods_of(item).items():
        alone = {"parameters": item.get("parameters", []), "additionalOperations": {method: operation}}
        try:
            read_operations({**document, "paths": {path: alone}})
        except _UNREADABLE as error:
            own, shared = ("paths", path, method.lower()), ("paths", path, "parameters")
            yield method, reason(error, faults, own, shared, ("components",), ("paths", path))
