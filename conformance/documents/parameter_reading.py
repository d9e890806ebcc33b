"""Read parameters and form fields back from their bytes on the wire, by their styles, and judge them.

A request that a generator means as invalid may be valid as it is written: each value is a text there. OpenAPI leaves
some ways of writing open (3.1, 4.8.12.2 and appendix C), so a verdict has three values.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from email.message import Message
from typing import Any, Final, TypeVar
from urllib.parse import unquote, unquote_plus

from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.json_shape import has_formats, shape_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Body, is_json
from conformance.documents.parameters import Encoding, Parameter
from conformance.documents.representation import discriminator_of, flat
from conformance.documents.writing import SEPARATORS

VALID, INVALID, UNCLEAR = "valid", "invalid", "unclear"
# The grammar of numbers in paths and queries; integers have no fraction.
_NUMBER: Final = re.compile(r"[+-]?(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_INTEGER: Final = re.compile(r"[+-]?\d+", re.ASCII)
# Texts that no server reads as a number: the empty text, or a letter where a number has none.
_NO_NUMBER: Final = re.compile(r"|.*[A-DF-Za-df-z].*|[eE].*", re.DOTALL)
_BOOLEANS: Final = {"true": True, "false": False}  # texts of booleans
# Texts that some frameworks read as a boolean or null.
_NEAR_BOOLEANS: Final = frozenset({"", "1", "0", "yes", "no", "on", "off", "t", "f", "y", "n"})
_NULLS: Final = frozenset({"", "null"})
_BEYOND_EVERY_BOUND: Final = 40  # digits of an integer that exceeds every declared bound
_SCALARS: Final = frozenset({"string", "number", "integer", "boolean"})
_ENCODED: Final = re.compile(r"%(?![0-9A-Fa-f]{2})")


@dataclass(frozen=True)
class Reading:
    """A value that stands in a request.

    Attributes:
        value: a text, a list or an object, in which each scalar is a text.
        sure: whether every reader takes it like this.
    """

    value: Any
    sure: bool = True


def decoded_query(text: str) -> str:
    """Return a name or value of a query or form, decoded.

    Raises:
        ValueError: it is not percent-encoded UTF-8.
    """
    return _decode(text, unquote_plus)


def decoded_path(text: str) -> str:
    """Return a part of a path segment, decoded.

    Raises:
        ValueError: it is not percent-encoded UTF-8.
    """
    return _decode(text, unquote)


def _decode(text: str, decode: Callable[..., str]) -> str:
    if _ENCODED.search(text):
        raise ValueError("a percent sign without two digits")
    return decode(text, errors="strict")


def judge_texts(parameter: Parameter, texts: Sequence[str], decode: Callable[[str], str] = str) -> str:
    """Return whether texts of a parameter are a valid value.

    Args:
        parameter: the parameter; of an exploded array of a query or form, each text is an item, of all others one.
        texts: as they stand in the request.
        decode: decodes a text or a part of it, and raises ValueError for what cannot be decoded.
    """
    try:
        if parameter.media_type:
            return _of_content(parameter, texts, decode)
        kinds = kinds_of(parameter.schema) or {"string"}
        said = [_of_scalar(parameter, texts, decode)] if kinds & _SCALARS else []
        if kinds & {"array", "object"} and list(texts) == [""]:
            return UNCLEAR  # nothing, an empty array, or an array with an empty text
        if "array" in kinds:
            said.append(_agreement(parameter.schema, _arrays(parameter, texts, decode)))
        if "object" in kinds:
            said.append(_agreement(parameter.schema, _objects(parameter, texts, decode)))
    except ValueError:
        return UNCLEAR
    if VALID in said:
        return VALID
    return INVALID if set(said) == {INVALID} else UNCLEAR


def judged_value(schema: Schema, reading: Reading) -> str:
    """Return whether a value whose scalars are texts is valid by a schema."""
    shape = shape_of(schema)
    said = set()
    for alternative in _alternatives(schema):
        value, sure = _convert(alternative, reading.value)
        if shape.holds(value):
            return VALID if reading.sure and has_formats(schema, value) else UNCLEAR
        said.add(sure)
    return INVALID if said == {True} else UNCLEAR


def _of_content(parameter: Parameter, texts: Sequence[str], decode: Callable[[str], str]) -> str:
    if len(texts) != 1 or not is_json(parameter.media_type):
        return UNCLEAR
    text = read_json(decode(texts[0]).encode())
    if text.malformed:
        return INVALID
    if text.non_finite or text.twice or text.encoding:
        return UNCLEAR
    return judged_json(parameter.schema, text.value)


def _of_scalar(parameter: Parameter, texts: Sequence[str], decode: Callable[[str], str]) -> str:
    text = _without_prefix(parameter, texts[0], decode) if len(texts) == 1 else None
    if text is None or (text == "" and (parameter.empty or not parameter.required)):
        return UNCLEAR  # some servers treat an optional parameter without a value as absent
    return judged_text(parameter.schema, decode(text))


def judged_text(schema: Schema, text: str) -> str:
    """Return whether a text stands for a valid scalar; a near miss of a number or boolean, or none, is unclear."""
    kinds = kinds_of(schema) or {"string"}
    if "string" in kinds and not text:
        return UNCLEAR
    readings, sure = _scalars(schema, text)
    shape = shape_of(schema)
    held = [value for value in readings if shape.holds(value)]
    if held:
        return VALID if any(has_formats(schema, value) for value in held) else UNCLEAR
    return INVALID if sure else UNCLEAR


def judged_json(schema: Schema, value: Any) -> str:
    """Return whether a JSON value is valid; a text without its format may be refused, as an author means it."""
    shape = shape_of(schema)
    if not shape.holds(value):
        return INVALID
    plain = has_formats(schema, value) and _is_discriminated(schema, value) and not _has_read_only(schema, value)
    return VALID if plain else UNCLEAR


def _has_read_only(schema: Schema, value: Any) -> bool:
    """Return whether a request has a member that only responses should have (OpenAPI 3.0, 4.7.24.2)."""
    given = flat(schema)
    if isinstance(value, list):
        items = given.get("items")
        return isinstance(items, dict) and any(_has_read_only(items, item) for item in value)
    properties = given.get("properties", {}) if isinstance(value, dict) else {}
    parts = [(part, value[name]) for name, part in properties.items() if name in value and isinstance(part, dict)]
    return any(part.get("readOnly") is True or _has_read_only(part, item) for part, item in parts)


def _is_discriminated(schema: Schema, value: Any) -> bool:
    """Return whether a value names its alternative, if the discriminator demands that (OpenAPI 3.1, 4.8.25)."""
    if "discriminator" not in str(schema):
        return True
    name, known = discriminator_of(schema)
    return isinstance(value, dict) and value.get(name) in known


def _scalars(schema: Schema, text: str) -> tuple[list[Any], bool]:
    """Return the values that a text may stand for, and whether no reader finds another one in it."""
    kinds = kinds_of(schema) or {"string"}
    readings: list[Any] = [text] if "string" in kinds else []
    sure = bool(kinds & _SCALARS) and not (text in _NULLS and shape_of(schema).holds(None))
    if kinds & {"number", "integer"} and not _NO_NUMBER.fullmatch(text):
        is_number = bool((_NUMBER if "number" in kinds else _INTEGER).fullmatch(text))
        sure = sure and is_number
        if is_number and math.isfinite(float(text)):
            is_whole = "number" not in kinds and len(text) < _BEYOND_EVERY_BOUND
            readings.append(int(text) if is_whole else float(text))
    if "boolean" in kinds:
        sure = sure and (text in _BOOLEANS or text.lower() not in _NEAR_BOOLEANS | _BOOLEANS.keys())
        readings += [_BOOLEANS[text]] if text in _BOOLEANS else []
    return readings, sure


def _convert(schema: Schema, value: Any) -> tuple[Any, bool]:
    """Return a value whose texts are converted to the types of their schemas, and whether every reader agrees."""
    if isinstance(value, list):
        prefix, rest = schema.get("prefixItems", []), schema.get("items")
        items = [_typed_part(prefix[i] if i < len(prefix) else rest, item) for i, item in enumerate(value)]
        return [item for item, _ in items], all(sure for _, sure in items)
    if isinstance(value, dict):
        properties, more = schema.get("properties", {}), schema.get("additionalProperties")
        members = {name: _typed_part(properties.get(name, more), item) for name, item in value.items()}
        sure = "patternProperties" not in schema and all(sure for _, sure in members.values())
        return {name: item for name, (item, _) in members.items()}, sure
    readings, sure = _scalars(schema, value)
    shape = shape_of(schema)
    return next((reading for reading in readings if shape.holds(reading)), value), sure or any(
        map(shape.holds, readings)
    )


def _typed_part(schema: Any, value: Any) -> tuple[Any, bool]:
    return _convert(flat(schema) if isinstance(schema, dict) else {}, value)


def _alternatives(schema: Schema) -> Iterator[Schema]:
    """Yield a schema once with each alternative of its union."""
    unions = [(key, item) for key in ("anyOf", "oneOf") for item in schema.get(key, ())]
    for key, one in unions:
        yield flat({**schema, key: [one]})
    if not unions:
        yield flat(schema)


def _agreement(schema: Schema, readings: Iterator[Reading]) -> str:
    """Return the verdict on a value that readers may take in several ways: unclear if it depends on the way."""
    said = {judged_value(schema, reading) for reading in readings}
    return said.pop() if len(said) == 1 else UNCLEAR


def _without_prefix(parameter: Parameter, text: str, decode: Callable[[str], str]) -> str | None:
    """Return a text without the prefix of the styles label and matrix; None if the prefix is missing."""
    if parameter.style == "label":
        return text[1:] if text.startswith(".") else None
    if parameter.style != "matrix":
        return text
    name, _, value = text[1:].partition("=")
    return value if text.startswith(";") and decode(name) == parameter.name else None


def _arrays(parameter: Parameter, texts: Sequence[str], decode: Callable[[str], str]) -> Iterator[Reading]:
    if parameter.style == "matrix" and parameter.explode:
        parts = [part.partition("=") for part in texts[0].split(";")[1:]]
        is_own = bool(parts) and texts[0].startswith(";") and all(decode(part[0]) == parameter.name for part in parts)
        yield Reading([decode(part[2]) for part in parts], sure=is_own)
    elif parameter.explode and parameter.where in {"query", "form"} and parameter.style == "form":
        yield Reading([decode(text) for text in texts])
    else:
        yield from _split(parameter, texts, decode)


def _objects(parameter: Parameter, texts: Sequence[str], decode: Callable[[str], str]) -> Iterator[Reading]:
    for items in _split(parameter, texts, decode):
        parts = items.value
        if parameter.explode:
            pairs = [part.partition("=") for part in parts]
            members = {decode(name): decode(value) for name, _, value in pairs}
            whole = all(separator for _, separator, _ in pairs) and len(members) == len(parts)
        else:
            members = dict(zip(parts[::2], parts[1::2], strict=False))
            whole = len(members) * 2 == len(parts)
        yield Reading(members, sure=items.sure and whole)


def _split(parameter: Parameter, texts: Sequence[str], decode: Callable[[str], str]) -> Iterator[Reading]:
    """Yield the parts of one text, each decoded unless they are pairs, by each separator that the style may have."""
    text = _without_prefix(parameter, texts[0], decode) if len(texts) == 1 else None
    if parameter.style == "matrix" and parameter.explode:
        text = texts[0][1:] if len(texts) == 1 and texts[0].startswith(";") else None
    if text is None:
        raise ValueError("not in its style")
    separator = SEPARATORS.get(parameter.style, ",")
    if parameter.style in {"label", "matrix"} and parameter.explode:
        separator = "." if parameter.style == "label" else ";"
    pairs = parameter.explode and "object" in kinds_of(parameter.schema)
    plain: Callable[[str], str] = str if pairs else decode
    if parameter.style in SEPARATORS:
        yield Reading(decode(text).split(separator))  # this separator is always percent-encoded
        return
    yield Reading([plain(part) for part in text.split(separator)])
    delimiters = (separator, "=") if pairs else (separator,)
    if any(decode(text).count(delimiter) != text.count(delimiter) for delimiter in delimiters):
        yield Reading(decode(text).split(separator))  # some servers decode before they split
    if parameter.style == "label" and not parameter.explode:
        # Before 3.1.1, the specification's table had a full stop between the items too.
        yield Reading([plain(part) for part in text.split(".")])


# Verdict on a text, and its reason.
Said = tuple[str, str]
_Value = TypeVar("_Value", str, "Part")
# Keywords that make the value of one field depend on others.
_JOINT: Final = frozenset({"anyOf", "oneOf", "not", "if", "minProperties", "maxProperties", "patternProperties"})


@dataclass(frozen=True)
class Part:
    """One part of a ``multipart/form-data`` body.

    Attributes:
        media_type: the media type of its content, without parameters; empty without one.
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
    """Return verdict, reason and whether it is missing, for each query parameter and for unknown ones."""
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
    said = judge_texts(item, texts, decoded_query)
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
        return UNCLEAR  # OpenAPI 3.0 and 3.1 write this value differently
    media_type = given.media_type if is_json(given.media_type) else ""
    item = Parameter(
        name, "form", required=False, schema=schema, style=given.style, explode=given.explode, media_type=media_type
    )
    return judge_texts(item, texts, decoded_query)


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
    # Some frameworks take a text with a file name for a file; OpenAPI leaves open how else to write an object.
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
