"""References to things of a device: ids, cursors and names of other resources, which a client cannot invent."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Any, Final
from urllib.parse import parse_qsl, urlsplit

from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameter_reading import decoded_query, pairs_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.documents.writing import text_of
from conformance.transport.exchange import Outgoing

# Ends of member names that refer to something else: an identifier, or the place where a list continues.
_ENDS: Final = ("id", "ids", "uuid", "guid", "cursor", "token", "reference", "href", "parent", "etag")
# Names that refer to something only as whole words, because other words end in them too.
_WHOLE: Final = frozenset({"ref", "slug", "key", "after", "before", "since", "next", "previous", "startafter"})
# Names of texts, which are no references even where an API has a collection of the same name.
_TEXTS: Final = frozenset({"note", "comment", "description", "message", "remark", "text"})
# Words that end like a reference and are none.
_NO_REFERENCES: Final = frozenset(
    {
        "acid", "android", "avoid", "bid", "centroid", "cuboid", "ellipsoid", "fluid", "grid", "humid", "hybrid",
        "invalid", "lid", "liquid", "paid", "pyramid", "rapid", "solenoid", "solid", "transparent", "valid", "void",
    }
)  # fmt: skip
# Text formats that JSON Schema and OpenAPI define: the suite can make a valid value.
_DEFINED: Final = frozenset(
    {
        "date-time", "date", "time", "duration", "email", "idn-email", "hostname", "idn-hostname", "ipv4", "ipv6",
        "uri", "uri-reference", "iri", "iri-reference", "uri-template", "json-pointer", "relative-json-pointer",
        "regex", "byte", "binary", "password",
    }
)  # fmt: skip
_WORD: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_FORM: Final = "application/x-www-form-urlencoded"
_DEPTH: Final = 6


def collections_of(operations: Iterable[Operation]) -> frozenset[str]:
    """Return the plain names of the collections whose items an API has paths for, in the singular."""
    known, names = {item.template.rstrip("/"): item for item in operations}, set[str]()
    for path, item in known.items():
        numbers = {one.name for one in item.parameter("path") if kinds_of(one.schema) == {"integer"}}
        for end in re.finditer(r"/\{([^{}]+)\}", path):
            above = path[: end.start()]
            # In a path below a thing, a whole number that no list contains may be an index into an array.
            if "{" not in above or above in known or end[1] not in numbers:
                names.add(above.rpartition("/")[2])
    return frozenset(singular(name) for name in names if name and not name.endswith("}"))


def singular(name: str) -> str:
    """Return the plain name of one item of a collection: ``valve`` for ``Valves``."""
    plain = plain_name(name)
    if plain.endswith("ies"):
        return f"{plain[:-3]}y"
    if plain.endswith(("ches", "shes", "xes", "sses")):
        return plain[:-2]
    return plain[:-1] if plain.endswith("s") and not plain.endswith("ss") else plain


@lru_cache(maxsize=1024)
def thing_of(name: str) -> str:
    """Return the normalised name of the thing that a reference names: ``valve`` for ``valve_id``; empty for ``id``."""
    plain = plain_name(name)
    end = next((end for end in ("ids", "uuid", "guid", "id", "name", "ref") if plain.endswith(end)), "")
    return singular(plain.removesuffix(end))


def refers(name: str, schema: Schema, collections: frozenset[str]) -> bool:
    """Return whether only the device knows the values of a parameter or member: references, and texts of its own form.

    A format that no standard defines for texts is such a form, as ``int64`` and ``semver`` are. So is ``uuid``, which
    identifies something.
    """
    kinds = kinds_of(schema) or {"string"}
    given = flat(schema)
    if not kinds & {"string", "integer", "array"} or "enum" in given or "const" in given:
        return False
    items = flat(given["items"]) if isinstance(given.get("items"), dict) else given
    own = "format" in items and "string" in kinds_of(items) and is_free_text(items)
    return own or _is_reference(name, collections)


@lru_cache(maxsize=1024)
def _is_reference(name: str, collections: frozenset[str]) -> bool:
    """Return whether a name is that of a reference."""
    plain = plain_name(name)
    last = (_WORD.findall(name) or [""])[-1].lower()
    ends = last.endswith(_ENDS) and last not in _NO_REFERENCES
    return ends or plain in _WHOLE or (thing_of(name) in collections and plain not in _TEXTS)


def is_free_text(schema: Schema) -> bool:
    """Return whether a value may be any text, because the description declares no form."""
    given = flat(schema)
    if given.keys() & {"enum", "const"} or "string" not in (kinds_of(given) or {"string"}):
        return False
    return given["format"] not in _DEFINED if isinstance(given.get("format"), str) else "pattern" not in given


def values_in(operation: Operation, request: Outgoing) -> Iterator[tuple[str, Schema, str]]:
    """Yield name, schema and text of each scalar in the query and body of a request."""
    schemas = {item.name: item.schema for item in operation.parameter("query")}
    yield from _fields(schemas, request.target.partition("?")[2])
    body = operation.bodies.get(request.media_type)
    if body is None:
        return
    if is_json(request.media_type):
        yield from _scalars("", body.schema, read_json(request.body).value, 0)
    elif request.media_type == _FORM:
        yield from _fields(flat(body.schema).get("properties", {}), request.body.decode("latin-1"))


def _fields(schemas: dict[str, Schema], text: str) -> Iterator[tuple[str, Schema, str]]:
    try:
        pairs = [(name, decoded_query(value)) for name, value in pairs_of(text)]
    except ValueError:
        return
    for name, value in pairs:
        parts = value.split(",") if "array" in kinds_of(schemas.get(name, {})) else [value]
        yield from ((name, schemas.get(name, {}), part) for part in parts)


def _scalars(name: str, schema: Schema, value: Any, depth: int) -> Iterator[tuple[str, Schema, str]]:
    if depth > _DEPTH:
        return
    if isinstance(value, dict):
        properties = flat(schema).get("properties", {})
        for member, item in value.items():
            yield from _scalars(member, properties.get(member, {}), item, depth + 1)
    elif isinstance(value, list):
        items = flat(schema).get("items", {})
        for item in value:
            yield from _scalars(name, items if isinstance(items, dict) else {}, item, depth + 1)
    elif isinstance(value, str | int) and not isinstance(value, bool):
        yield name, schema, text_of(value)


def in_link(text: str) -> list[tuple[str, str]]:
    """Return the names and values in the query of a link; empty if a text is none."""
    return parse_qsl(urlsplit(text).query) if "?" in text and "=" in text else []
