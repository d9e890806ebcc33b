"""Judge the parameters of a query and the fields of a form as they stand in a request: several texts, each with a name.

What has a name that the description does not know is unclear in a query, and an additional property in a form.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from email.message import Message
from typing import Final, TypeVar

from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Body, is_json
from conformance.documents.parameter_reading import (
    INVALID,
    UNCLEAR,
    VALID,
    Reading,
    decoded_query,
    judged,
    judged_json,
    judged_text,
    judged_value,
)
from conformance.documents.parameters import Encoding, Parameter
from conformance.documents.representation import flat

# A verdict, and why it is so.
Said = tuple[str, str]
_Value = TypeVar("_Value", str, "Part")
# With these, what a field may be depends on other fields.
_JOINT: Final = frozenset({"anyOf", "oneOf", "not", "if", "minProperties", "maxProperties", "patternProperties"})


@dataclass(frozen=True)
class Part:
    """One part of a ``multipart/form-data`` body.

    Attributes:
        media_type: of its content, without parameters; empty without one.
        is_file: whether it has a file name.
        content: its bytes.
    """

    media_type: str
    is_file: bool
    content: bytes


def pairs_of(text: str) -> list[tuple[str, str]]:
    """Return the names, decoded, and values, as they stand there, of a query or form.

    Raises:
        ValueError: a name is not percent-encoded UTF-8.
    """
    split = [part.partition("=") for part in text.split("&") if part]
    return [(decoded_query(name), value) for name, _, value in split]


def query_verdicts(parameters: Sequence[Parameter], query: str) -> list[tuple[str, str, bool]]:
    """Return verdict, reason and whether something is missing for each query parameter, and for what is unknown."""
    try:
        pairs = pairs_of(query)
    except ValueError:
        return [(UNCLEAR, "", False)]
    known: set[str] = set()
    found = []
    for item in parameters:
        names, said = _query_verdict(item, parameters, pairs)
        known |= names
        found.append(said)
    unknown = {name for name, _ in pairs} - known
    return [*found, *([(UNCLEAR, "", False)] if unknown else [])]


def _query_verdict(
    item: Parameter, others: Sequence[Parameter], pairs: Sequence[tuple[str, str]]
) -> tuple[set[str], tuple[str, str, bool]]:
    """Return the names that belong to a parameter, and the verdict on it."""
    kinds = kinds_of(item.schema)
    is_apart = item.style == "deepObject" or (item.style == "form" and item.explode)
    if "object" in kinds and not item.media_type and is_apart:
        names = _member_names(item, others, pairs)
        members = [(names[name], value) for name, value in pairs if name in names]
        if members or kinds == {"object"}:
            return set(names), _members_verdict(item, members)
    texts = [value for name, value in pairs if name == item.name]
    if not texts:
        missing = (INVALID, f"no parameter {item.name}", True) if item.required and not _may_be_nothing(item) else None
        return {item.name}, missing or (VALID, "", False)
    said = judged(item, texts, decoded_query)
    return {item.name}, (said, f"{texts[0][:40]!r} at query {item.name}", False)


def _may_be_nothing(item: Parameter) -> bool:
    """Return whether an empty array, which is written as nothing at all, is a valid value."""
    return "array" in kinds_of(item.schema) and judged_value(item.schema, Reading([])) != INVALID


def _member_names(item: Parameter, others: Sequence[Parameter], pairs: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Return the member of an exploded object that each name in a query stands for."""
    if item.style == "deepObject":
        begin = f"{item.name}["
        return {name: name[len(begin) : -1] for name, _ in pairs if name.startswith(begin) and name.endswith("]")}
    taken = {other.name for other in others if other is not item}
    schema = flat(item.schema)
    is_open = schema.get("additionalProperties", True) is not False
    own = schema.get("properties", {}).keys()
    return {name: name for name, _ in pairs if name in own or (is_open and name not in taken)}


def _members_verdict(item: Parameter, members: Sequence[tuple[str, str]]) -> tuple[str, str, bool]:
    if not members:
        sure = item.required and judged_value(item.schema, Reading({})) == INVALID
        if sure:
            return INVALID, f"no parameter {item.name}", True
        return UNCLEAR if item.required else VALID, "", False
    names = [name for name, _ in members]
    own = flat(item.schema).get("properties", {}).keys()
    foreign = bool(own) and own.isdisjoint(names) and item.style == "form"
    if foreign or len(set(names)) < len(names) or any("[" in name or "]" in name for name in names):
        return UNCLEAR, "", False
    try:
        value = {name: decoded_query(text) for name, text in members}
    except ValueError:
        return UNCLEAR, "", False
    return judged_value(item.schema, Reading(value)), f"{str(value)[:60]!r} at query {item.name}", False


def urlencoded_verdict(body: bytes, form: Body) -> Said:
    """Return the verdict on an ``application/x-www-form-urlencoded`` body."""
    try:
        pairs = pairs_of(body.decode("ascii"))
    except ValueError:
        return UNCLEAR, ""
    fields: dict[str, list[str]] = {}
    for name, text in pairs:
        fields.setdefault(name, []).append(text)
    return _form_verdict(form, fields, _text_field)


def _text_field(name: str, schema: Schema, how: Encoding | None, texts: Sequence[str]) -> str:
    given = how or Encoding()
    if how is None and "object" in kinds_of(schema):
        return UNCLEAR  # OpenAPI 3.0 and 3.1 differ in how it is written
    media_type = given.media_type if is_json(given.media_type) else ""
    item = Parameter(
        name, "form", required=False, schema=schema, style=given.style, explode=given.explode, media_type=media_type
    )
    return judged(item, texts, decoded_query)


def multipart_verdict(body: bytes, content_type: str, form: Body) -> Said:
    """Return the verdict on a ``multipart/form-data`` body (RFC 7578)."""
    fields = parts_of(body, content_type)
    return (UNCLEAR, "") if fields is None else _form_verdict(form, fields, _part_field)


def _part_field(_: str, schema: Schema, how: Encoding | None, parts: Sequence[Part]) -> str:
    given = (how or Encoding()).media_type
    if "array" in kinds_of(schema) and not is_json(given):
        items = flat(schema).get("items", {})
        said = {_one_part(items, given, part) for part in parts}
        enough = schema.get("minItems", 0) <= len(parts) <= schema.get("maxItems", len(parts))
        if UNCLEAR in said or schema.get("uniqueItems"):
            return UNCLEAR
        return VALID if enough and INVALID not in said else INVALID
    return _one_part(schema, given, parts[0]) if len(parts) == 1 else UNCLEAR


def _one_part(schema: Schema, given: str, part: Part) -> str:
    if is_binary(schema):
        return VALID if part.is_file and part.content else UNCLEAR
    if is_json(part.media_type) or is_json(given):
        text = read_json(part.content)
        if text.problem and not text.malformed:
            return UNCLEAR
        return INVALID if text.malformed else judged_json(schema, text.value)
    # A text with a file name is a file to some frameworks; OpenAPI leaves other ways to write an object open.
    is_text = not part.is_file and "object" not in kinds_of(schema)
    return text_verdict(part.content, schema) if is_text else UNCLEAR


def text_verdict(content: bytes, schema: Schema) -> str:
    """Return whether content that is text stands for a valid scalar."""
    try:
        return judged_text(schema, content.decode())
    except UnicodeDecodeError:
        return UNCLEAR


def is_binary(schema: Schema) -> bool:
    """Return whether a field of a form is a file (OpenAPI 3.0 and 3.1, 4.8.14.5)."""
    binary = schema.get("format") in {"binary", "base64"} or "contentMediaType" in schema
    return binary or (schema.get("type") == "file")


def _form_verdict(
    form: Body,
    fields: Mapping[str, Sequence[_Value]],
    judge: Callable[[str, Schema, Encoding | None, Sequence[_Value]], str],
) -> Said:
    """Return the verdict on a form whose fields `judge` reads."""
    if kinds_of(form.schema) != {"object"} or not _JOINT.isdisjoint(form.schema):
        return UNCLEAR, ""
    schema = flat(form.schema)
    properties, more = schema.get("properties", {}), schema.get("additionalProperties", True)
    said: list[Said] = [(INVALID, f"no field {name}") for name in schema.get("required", ()) if name not in fields]
    for name, texts in fields.items():
        part = properties.get(name, more)
        if part is False:
            said.append((INVALID, f"{name} is excluded by the schema"))
        elif part is True or not part.get("readOnly"):
            schema_of_it = {} if part is True else part
            said.append(
                (judge(name, schema_of_it, form.encoding.get(name), texts), f"{name} is not as its schema has it")
            )
        if not name.isprintable() or not name:
            said.append((UNCLEAR, ""))
    return next((one for wanted in (UNCLEAR, INVALID) for one in said if one[0] == wanted), (VALID, ""))


def parts_of(body: bytes, content_type: str) -> dict[str, list[Part]] | None:
    """Return the parts of a ``multipart/form-data`` body by name; None if it cannot be read for sure."""
    head = Message()
    head["Content-Type"] = content_type
    boundary = head.get_param("boundary")
    if not isinstance(boundary, str) or not boundary:
        return None
    pieces = (b"\r\n" + body).split(b"\r\n--" + boundary.encode())
    if pieces[0].strip() or not pieces[-1].startswith(b"--"):
        return None
    found: dict[str, list[Part]] = {}
    for piece in pieces[1:-1]:
        fields, blank, content = piece.partition(b"\r\n\r\n")
        part = Message()
        for line in fields.decode("utf-8", "replace").split("\r\n")[1:]:
            name, _, value = line.partition(":")
            part[name.strip()] = "".join(value.splitlines())
        called = part.get_param("name", header="content-disposition")
        if not blank or not isinstance(called, str) or not called.isprintable():
            return None
        media_type = (part["content-type"] or "").split(";", 1)[0].strip().lower()
        is_file = part.get_param("filename", header="content-disposition") is not None
        found.setdefault(called, []).append(Part(media_type, is_file, content))
    return found
