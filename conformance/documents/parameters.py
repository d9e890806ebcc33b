"""Parameters of operations and fields of forms, as an OpenAPI description has them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

from conformance.documents.json_schema import Schema, modern

_NO_LETTER: Final = re.compile(r"[^a-z0-9]")
# Longer names are not remembered: a response may have any number of them.
_SHORT: Final = 64


@dataclass(frozen=True)
class Parameter:
    """One parameter of an operation.

    Attributes:
        name: as in requests.
        where: path, query, header or cookie.
        required: whether requests must have it.
        schema: the schema of its value.
        examples: example values in the description; may be empty.
        also: other names of it, for instance in ROS (x-roaas-also).
        style: how arrays and objects are written.
        explode: whether their items are written apart.
        media_type: the media type of a parameter with ``content``; empty if it is written by its style.
        reserved: whether reserved characters are written as they are (allowReserved).
        empty: whether it may be written without a value (allowEmptyValue).
        says: the description of it.
    """

    name: str
    where: str
    required: bool
    schema: Schema
    examples: tuple[Any, ...] = ()
    also: tuple[str, ...] = ()
    style: str = "simple"
    explode: bool = False
    media_type: str = ""
    reserved: bool = False
    empty: bool = False
    says: str = ""


@dataclass(frozen=True)
class Encoding:
    """How a field of a form is written (OpenAPI 3.1, 4.8.15).

    Attributes:
        style, explode: as those of a query parameter.
        media_type: the media type of its value; empty where the description does not say it.
    """

    style: str = "form"
    explode: bool = True
    media_type: str = ""


def read_encoding(content: dict[str, Any]) -> dict[str, Encoding]:
    """Return the encoding objects of a media type object by the field's name."""
    return {
        name: Encoding(
            style := given.get("style", "form"),
            bool(given.get("explode", style == "form")),
            given.get("contentType", "").split(",", 1)[0].split(";", 1)[0].strip().lower(),
        )
        for name, given in content.get("encoding", {}).items()
    }


def by_media_type(given: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the entries of ``content`` by media type, in lower case and without parameters."""
    return {name.split(";", 1)[0].strip().lower(): content for name, content in given.get("content", {}).items()}


def read_parameter(given: dict[str, Any]) -> Parameter:
    """Return a parameter object, which has no references."""
    content: dict[str, Any] = next(iter(given.get("content", {}).values()), {})
    return Parameter(
        given["name"],
        given["in"],
        bool(given.get("required", given["in"] == "path")),
        modern(given.get("schema", content.get("schema", {}))),
        examples_of(given) or examples_of(content),
        tuple(given.get("x-roaas-also", ())),
        style := given.get("style", "form" if given["in"] in {"query", "cookie"} else "simple"),
        bool(given.get("explode", style == "form")),
        next(iter(by_media_type(given)), ""),
        bool(given.get("allowReserved", False)),
        bool(given.get("allowEmptyValue", False)),
        " ".join(
            str(item.get("description", "")) for item in (given, given.get("schema", {})) if isinstance(item, dict)
        ),
    )


def examples_of(given: dict[str, Any]) -> tuple[Any, ...]:
    """Return the examples of a parameter or media type, or those of its schema."""
    if "example" in given:
        return (given["example"],)
    named = tuple(item["value"] for item in given.get("examples", {}).values() if "value" in item)
    schema = given.get("schema", {})
    if named:
        return named
    return (schema["example"],) if "example" in schema else tuple(schema.get("examples", ()))


def plain_name(name: str) -> str:
    """Return a normalised name, without case and separators: ``job_id`` and ``jobId`` are equal."""
    return _plain(name) if len(name) <= _SHORT else _plain.__wrapped__(name)


@lru_cache(maxsize=1024)
def _plain(name: str) -> str:
    return _NO_LETTER.sub("", name.lower())
