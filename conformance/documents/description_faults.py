"""Find faults of a description file, apart from any device.

What cannot be read is left out of the description, so that the rest is judged; `file-valid` judges the file.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from copy import deepcopy
from functools import lru_cache
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any, Final

import jsonschema_rs

from conformance.documents.json_schema import Schema, UnresolvedError, modern, resolved, target_of
from conformance.documents.json_shape import shape_of
from conformance.documents.openapi import PARAMETER, Operation, methods_of, read_operations, without_marked
from conformance.documents.schema_budget import Growth
from conformance.documents.schema_places import DATA, foreign_words, in_extension, schema_places, without_foreign_words

# Violations to search for the reason why a part of the description cannot be read.
_MOST_FAULTS = 1_000
_SCHEMAS = "openapi/definitions.py"


def invalid(original: Schema) -> list[str]:
    """Return where a description is no valid document of its version; empty if it is."""
    version = str(original.get("openapi") or original.get("swagger") or "")[:3]
    foreign, faults = foreign_words(original), []
    for error in validator(version).iter_errors(without_foreign_words(original)):
        where = "/".join(str(part) for part in error.instance_path)
        faults.append(f"/{where}: {error.message[:160]}")
    return [*foreign, *sorted(set(faults), key=len)[:20], *_path_parameters(original), *_schemas(original)]


def type_faults(original: Schema) -> list[tuple[str, str]]:
    """Return members of a description that have another type than its version demands: places and explanations."""
    version = str(original.get("openapi") or original.get("swagger") or "")[:3]
    errors = map(_deepest, islice(validator(version).iter_errors(without_foreign_words(original)), _MOST_FAULTS))
    return [(f"{_pointer(error.instance_path)}/", error.message[:160]) for error in errors]


def _deepest(error: Any) -> Any:
    """Return the violation that lies deepest, of several alternatives as well."""
    inner = (_deepest(item) for alternative in getattr(error.kind, "context", ()) for item in alternative)
    return max((error, *inner), key=lambda item: len(item.instance_path))


def _pointer(path: Iterable[object]) -> str:
    return "".join(f"/{str(part).replace('~', '~0').replace('/', '~1')}" for part in path)


def reason(error: Exception, faults: list[tuple[str, str]], *places: Iterable[object]) -> str:
    """Return why a part of a description cannot be read.

    Args:
        error: what reading it raised.
        faults: as `misplaced` returns them.
        places: where the cause may be, the likeliest first.
    """
    if isinstance(error, UnresolvedError):
        return str(error)
    for near in map(_pointer, places):
        for place, fault in faults:
            if place.startswith(f"{near}/"):
                return f"at {place.removesuffix('/')}: {fault}"
    return "a part of it is not as OpenAPI says, or leads back to itself"


@lru_cache(maxsize=4)
def validator(version: str) -> Any:
    """Return the validator of descriptions of a version, such as "3.1".

    The schemas of the OpenAPI Initiative come from Schemathesis, which is a dependency anyway. They are read from its
    source, because importing it takes a fifth of a second.
    """
    import jsonschema_rs  # noqa: PLC0415 - only where a description is judged

    schemathesis = find_spec("schemathesis")
    source = Path(schemathesis.origin if schemathesis and schemathesis.origin else "").with_name("specs") / _SCHEMAS
    name = f"{'SWAGGER' if version == '2.0' else 'OPENAPI'}_{version.replace('.', '')}"
    schemas = {
        ast.unparse(one.targets[0]): one.value
        for one in ast.parse(source.read_bytes()).body
        if isinstance(one, ast.Assign)
    }
    schema = ast.literal_eval(schemas.get(name) or schemas["OPENAPI_31"])
    return jsonschema_rs.validator_for(schema, offline=True, formats={"regex": lambda _: True})


def _operations(document: Schema) -> Iterator[tuple[str, str, Schema, list[Any]]]:
    """Yield path, method, operation and shared parameters of a description, without those that are malformed."""
    paths = document.get("paths")
    for path, item in paths.items() if isinstance(paths, dict) else ():
        try:
            whole = resolved(document, item)
        except UnresolvedError:
            continue
        for method, operation in methods_of(whole).items() if isinstance(whole, dict) else ():
            if isinstance(operation, dict):
                shared = whole.get("parameters", [])
                yield path, method, operation, shared if isinstance(shared, list) else []


def _path_parameters(document: Schema) -> Iterator[str]:
    """Yield path parameters that are in a path and not declared, or the reverse (OpenAPI 3.1, 4.8.8.2)."""
    for path, method, operation, shared in _operations(document):
        own = operation.get("parameters", [])
        given = [*shared, *(own if isinstance(own, list) else [])]
        declared = {str(item.get("name")) for item in given if isinstance(item, dict) and item.get("in") == "path"}
        used = set(PARAMETER.findall(path))
        for name in sorted(used - declared):
            yield f"{method} {path} does not declare its path parameter {name}"
        for name in sorted(declared - used):
            yield f"{method} {path} declares the path parameter {name}, which is not in the path"


def _schemas(document: Schema) -> Iterator[str]:
    """Yield schemas that no validator can compile, such as one with an invalid regular expression."""
    told: set[str] = set()
    for place, schema in _every_schema(document):
        try:
            shape_of(modern(resolved(document, schema)))
        except UnresolvedError:
            continue  # the requirement description/references reports that
        except (ValueError, TypeError, RecursionError) as error:
            reason = str(error).splitlines()[0][:160]
            if reason not in told:
                told.add(reason)
                yield f"{place} is no JSON Schema: {reason}"


def _every_schema(document: Schema) -> Iterator[tuple[str, Schema]]:
    """Yield the schemas of components, parameters, request bodies and responses, with their places."""
    components = document.get("components")
    schemas = components.get("schemas") if isinstance(components, dict) else document.get("definitions")
    for name, schema in schemas.items() if isinstance(schemas, dict) else ():
        if isinstance(schema, dict):
            yield f"the schema {name}", schema
    for path, method, operation, shared in _operations(document):
        own = operation.get("parameters", [])
        for one in [*shared, *(own if isinstance(own, list) else [])]:
            if isinstance(one, dict) and isinstance(one.get("schema"), dict):
                yield f"the schema of {one.get('in')} {one.get('name')} of {method} {path}", one["schema"]
        responses = operation.get("responses")
        contents = [("request", operation.get("requestBody"))]
        contents += [(f"status {key}", one) for key, one in responses.items()] if isinstance(responses, dict) else []
        for place, one in contents:
            content = one.get("content") if isinstance(one, dict) else None
            for media in content.values() if isinstance(content, dict) else ():
                if isinstance(media, dict) and isinstance(media.get("schema"), dict):
                    yield f"the schema of {method} {path}, {place}", media["schema"]


def dead_references(document: Schema) -> list[str]:
    """Return the references within the document that lead nowhere."""
    found: dict[str, None] = {}
    waiting: list[Any] = [document]
    while waiting:
        value = waiting.pop()
        if isinstance(value, list):
            waiting += reversed(value)
        elif isinstance(value, dict):
            reference = value.get("$ref")
            if isinstance(reference, str) and reference.startswith("#"):
                try:
                    target_of(document, reference)
                except UnresolvedError:
                    found[reference] = None
            waiting += [item for key, item in reversed(value.items()) if key == "examples" or key not in DATA]
    return list(found)


def repeated_ids(document: Schema) -> list[str]:
    """Return each ``operationId`` that occurs several times, with its operations."""
    by_id: dict[str, list[str]] = defaultdict(list)
    for path, method, operation, _ in _operations(document):
        if isinstance(operation.get("operationId"), str):
            by_id[operation["operationId"]].append(f"{method} {path}")
    return [f"{id_}: {', '.join(labels)}" for id_, labels in by_id.items() if len(labels) > 1]


def alike_paths(document: Schema) -> list[str]:
    """Return the templates that differ only in the names of their parameters."""
    by_shape: dict[str, list[str]] = defaultdict(list)
    paths = document.get("paths")
    for path in paths if isinstance(paths, dict) else ():
        by_shape[PARAMETER.sub("{}", path)].append(path)
    return [" and ".join(paths) for paths in by_shape.values() if len(paths) > 1]


def unfitting_examples(document: Schema) -> list[str]:
    """Return the examples and defaults that are invalid by the schema beside them, with their places."""
    found: dict[str, None] = {}
    for path, method, operation, shared in _operations(document):
        for place, schema, marks, value in _examples(operation, shared):
            try:
                given = modern(schema)
                for mark in marks:
                    given = without_marked(given, mark)
                problem = shape_of(given).problem(value)
            except (ValueError, TypeError, RecursionError):
                continue
            if problem:
                found[f"{place} of {method} {path}: {problem}"] = None
    return list(found)


def _examples(operation: Schema, shared: list[Any]) -> Iterator[tuple[str, Schema, tuple[str, ...], Any]]:
    """Yield the examples and defaults of an operation: place, schema, marks of optional members, and value."""
    declared = operation.get("parameters", [])
    for one in [*shared, *(declared if isinstance(declared, list) else [])]:
        if isinstance(one, dict) and isinstance(one.get("schema"), dict):
            place = f"the example of {one.get('in')} {one.get('name')}"
            yield from ((place, one["schema"], (), value) for value in _examples_of(one))
            yield from _of_schema(f"{one.get('in')} {one.get('name')}", one["schema"])
    body = operation.get("requestBody", {})
    responses = operation.get("responses", {})
    contents = [("the request body", body)] if isinstance(body, dict) else []
    if isinstance(responses, dict):
        contents += [
            (f"the body of status {status}", one) for status, one in responses.items() if isinstance(one, dict)
        ]
    for place, one in contents:
        content = one.get("content", {})
        for name, media in content.items() if isinstance(content, dict) else ():
            if isinstance(media, dict) and isinstance(media.get("schema"), dict) and "json" in name:
                # A request lacks readOnly members, and a response writeOnly members.
                marks = ("readOnly" if one is body else "writeOnly",)
                yield from ((f"the example of {place}", media["schema"], marks, value) for value in _examples_of(media))
                yield from _of_schema(place, media["schema"])


def _examples_of(given: Schema) -> list[Any]:
    examples = given.get("examples", {})
    named = (
        [example["value"] for example in examples.values() if isinstance(example, dict) and "value" in example]
        if isinstance(examples, dict)
        else []
    )
    return [*([given["example"]] if "example" in given else []), *named]


def _of_schema(place: str, schema: Schema, depth: int = 0) -> Iterator[tuple[str, Schema, tuple[str, ...], Any]]:
    """Yield the defaults and examples inside a schema."""
    plain = {key: value for key, value in schema.items() if key not in {"default", "example", "examples"}}
    # The same schema may serve requests and responses.
    marks = ("readOnly", "writeOnly")
    if schema.get("default") is not None:
        yield f"the default of {place}", plain, marks, schema["default"]
    if schema.get("example") is not None:
        yield f"the example of {place}", plain, marks, schema["example"]
    examples = schema.get("examples")
    named = examples if isinstance(examples, list) else ()
    yield from ((f"an example of {place}", plain, marks, value) for value in named)
    properties = schema.get("properties")
    for name, part in properties.items() if isinstance(properties, dict) and depth < 4 else ():  # noqa: PLR2004 - levels
        if isinstance(part, dict):
            yield from _of_schema(f"{place} /{name}", part, depth + 1)


def openapi_fault(document: Any) -> str:
    """Return why a document is not a valid OpenAPI 3 description; empty if it is."""
    if not isinstance(document, dict):
        return "it is no object"
    version = document.get("openapi")
    if not isinstance(version, str) or not re.fullmatch(r"3\.[0-2]\.\d+", version):
        return f"a description of version {version!r}"
    error = next(iter(validator(version[:3]).iter_errors(document)), None)
    if error is not None:
        where = ".".join(str(part) for part in error.instance_path)
        return f"a fault at {where or 'the root'}: {error.message[:200]}"
    try:
        operations = read_operations(document)
    except UnresolvedError as unresolved:
        return str(unresolved)
    except (AttributeError, TypeError, KeyError, RecursionError) as broken:
        return f"no description: {broken!r}"
    return _path_fault(operations)


def _path_fault(operations: Sequence[Operation]) -> str:
    """Return a path parameter that is in a path but not described, or the reverse (OpenAPI 3.1, 4.8.8.2); or empty."""
    for operation in operations:
        used = set(PARAMETER.findall(operation.template))
        described = {item.name for item in operation.parameter("path")}
        if used != described:
            return f"{operation.label} with the path parameters {sorted(used)} and {sorted(described)} described"
    return ""


_UNREADABLE: Final = (UnresolvedError, AttributeError, TypeError, KeyError, ValueError)
_SHOWN: Final = 300  # most characters of a place in a message
_LINES: Final = 200  # most lines of a message
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
        found, more = _without_operations(document, bare, type_faults(original or document))
        return found, _some([*lines, *more])
    return document, _some(lines)


def _some(lines: list[str]) -> list[str]:
    return lines if len(lines) <= _LINES else [*lines[:_LINES], f"{len(lines) - _LINES:,} more are not judged"]


def _bare(value: Any) -> Any:
    """Return a part of a document without its schemas, which take longest to read."""
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
    # Innermost first, so that as little of the description as possible is left out.
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
    """Return why a schema is invalid, or an empty text."""
    try:
        error = next(iter(_META.iter_errors(modern(schema))), None)
    except _UNREADABLE as broken:
        return repr(broken)
    return "" if error is None else error.message.splitlines()[0][:160]


def _without_operations(document: Schema, bare: Schema, faults: list[tuple[str, str]]) -> tuple[Schema, list[str]]:
    lines, paths = [], {}
    for path, item in document["paths"].items():
        try:
            whole = target_of(document, item["$ref"]) if isinstance(item, dict) and "$ref" in item else item
            broken = dict(_unreadable(bare, path, faults)) if isinstance(whole, dict) else {"": "it is no object"}
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


def _unreadable(document: Schema, path: str, faults: list[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Yield the method of each operation of a path that cannot be read, and why."""
    item = resolved(document, document["paths"][path])
    for method, operation in methods_of(item).items():
        alone = {"parameters": item.get("parameters", []), "additionalOperations": {method: operation}}
        try:
            read_operations({**document, "paths": {path: alone}})
        except _UNREADABLE as error:
            own, shared = ("paths", path, method.lower()), ("paths", path, "parameters")
            yield method, reason(error, faults, own, shared, ("components",), ("paths", path))
