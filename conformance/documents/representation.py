"""Read JSON, XML and YAML bodies by one schema into comparable JSON values."""

import re
from typing import Any, Final

import yaml
from lxml import etree

from conformance.contract.document_text import check_yaml
from conformance.documents import xml
from conformance.documents.json_schema import Schema, as_double, kind_of, types_of, whole
from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json, is_xml

# Numbers that the contract allows. XML Schema and YAML also allow a point without digits after it, which is harmless.
_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_WHOLE = re.compile(r"[+-]?\d{1,400}", re.ASCII)
_NULLS = {"", "null", "~", "Null", "NULL"}
# libyaml where PyYAML was built with it: pure Python takes 20 ms for a document of 150 lines.
_Loader: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
_ByItself: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_COMBINING = frozenset({"allOf", "oneOf", "anyOf"})
# Exceptions of PyYAML: its constructors let Python's own through, such as IndexError for `!!int ""`.
_NO_YAML: Final = (yaml.YAMLError, ValueError, LookupError, TypeError, ArithmeticError, AttributeError)
_NIL = "{http://www.w3.org/2001/XMLSchema-instance}nil"


class UnreadableError(Exception):
    """Raised for a body that is not in the format of its media type; the message explains why."""


def read(media_type: str, body: bytes, schema: Schema) -> Any:
    """Return a body as a JSON value by a schema; members that the schema does not name are left out.

    A value that does not fit the schema stays as written (usually text), so that validation reports it.

    Raises:
        UnreadableError: the body is not JSON, XML or YAML, or is XML with text that belongs to no member.
    """
    try:
        if is_json(media_type):
            text = read_json(body)
            if text.problem:
                raise UnreadableError(text.problem)
            return projected(text.value, schema)
        if is_xml(media_type):
            root = parse_xml(body)
            if stray := _stray_text(root):
                raise UnreadableError(stray)
            return from_element(root, schema)
        return from_plain(parse_yaml(body), schema)
    except RecursionError as error:
        raise UnreadableError("a document that is nested too deeply to be read") from error


def parse_xml(body: bytes) -> etree._Element:
    """Return the root element of a robot's XML document, without comments.

    Raises:
        UnreadableError: it is not well-formed, or has a document type declaration.
    """
    try:
        return xml.parse(body, comments=False)
    except xml.NotXmlError as error:
        raise UnreadableError(str(error)) from error


def parse_yaml(body: bytes) -> Any:
    """Return the only document of a YAML stream, with all scalars as text. An empty last document is ignored.

    ``ros2 topic echo`` prints ``---`` after each message.

    Raises:
        UnreadableError: it is not YAML, or has several documents.
    """
    try:
        text = body.decode("utf-8")
        check_yaml(text)
        documents = list(yaml.load_all(text, Loader=_Loader))
    except _NO_YAML as error:
        raise UnreadableError(f"not YAML: {_short(error)}") from error
    while len(documents) > 1 and documents[-1] in (None, ""):
        documents.pop()
    if len(documents) != 1:
        raise UnreadableError(f"{len(documents)} YAML documents where one was expected")
    return documents[0]


def _short(error: Exception) -> str:
    """Return a parser's message on one line, without the placeholder for a file name."""
    return " ".join(str(error).replace('in "<unicode string>", ', "at ").split())[:200]


def by_itself(body: bytes) -> Any:
    """Return the first document of a YAML stream with types by YAML's rules: plain 123 is a number.

    Raises:
        UnreadableError: it is not YAML.
    """
    try:
        text = body.decode("utf-8")
        check_yaml(text)
        return next(iter(yaml.load_all(text, Loader=_ByItself)), None)
    except _NO_YAML as error:
        raise UnreadableError(f"not YAML: {_short(error)}") from error


def _stray_text(root: etree._Element) -> str:
    """Return the text between an element's children; empty if there is none."""
    for element in root.iter():
        if isinstance(element.tag, str) and xml.elements(element) and (text := xml.text_of(element).strip()):
            return f"the text {text[:40]!r} between the child elements of <{local_name(element)}>"
    return ""


def local_name(element: etree._Element) -> str:
    """Return an element's name without its namespace."""
    return etree.QName(element).localname


def from_element(element: etree._Element, schema: Schema) -> Any:
    """Return an XML element as a JSON value by a schema, as read() does."""
    schema = flat(schema)
    types = types_of(schema)
    kind = next((name for name in types if name != "null"), "string")
    children = xml.elements(element)
    if "null" in types and (element.get(_NIL) in {"true", "1"} or (not children and not element.text)):
        return None
    if kind == "array":
        return [from_element(child, schema.get("items", {})) for child in children]
    if kind == "object":
        return _from_children(children, schema)
    return {local_name(child): "" for child in children} if children else scalar(element.text or "", kind)


def _from_children(children: list[etree._Element], schema: Schema) -> dict[str, Any]:
    by_name: dict[str, list[etree._Element]] = {}
    for child in children:
        by_name.setdefault(local_name(child), []).append(child)
    properties: dict[str, Schema] = schema.get("properties", {})
    if not properties:
        return {name: group[0].text or "" for name, group in by_name.items()}
    result: dict[str, Any] = {}
    for name, part in properties.items():
        group = by_name.get(name, [])
        if kind_of(flat(part)) == "array":
            if group or name in schema.get("required", ()):
                result[name] = _items(group, flat(part).get("items", {}))
        elif len(group) == 1:
            result[name] = from_element(group[0], part)
        elif group:
            result[name] = [from_element(item, part) for item in group]
    return result


def _items(group: list[etree._Element], schema: Schema) -> list[Any]:
    """Return the items of an array: one child element for each, or all inside one child element."""
    if len(group) == 1:
        inner = xml.elements(group[0])
        fields = set(flat(schema).get("properties", {}))
        nested = not fields & {local_name(child) for child in inner} if fields else bool(inner)
        if nested or not (inner or (group[0].text or "").strip()):
            return [from_element(child, schema) for child in inner]
    return [from_element(item, schema) for item in group]


def from_plain(value: Any, schema: Schema) -> Any:
    """Return YAML with text scalars as a JSON value by a schema, as read() does."""
    schema = flat(schema)
    kind = kind_of(schema)
    if isinstance(value, str):
        if value in _NULLS and "null" in types_of(schema):
            return None
        return value if kind in {"array", "object"} else scalar(value, kind)
    if isinstance(value, list):
        return [from_plain(item, schema.get("items", {})) for item in value]
    if isinstance(value, dict):
        properties: dict[str, Schema] = schema.get("properties", {})
        return {
            name: from_plain(item, properties.get(name, {}))
            for name, item in value.items()
            if name in properties or not properties
        }
    return value


def scalar(text: str, kind: str) -> Any:
    """Return a text as a value of a JSON type; the text itself if it does not fit."""
    stripped = text.strip(" \t\r\n")
    if kind in {"number", "integer"} and _NUMBER.fullmatch(stripped):
        return int(stripped) if _WHOLE.fullmatch(stripped) else float(stripped)
    if kind == "boolean" and stripped.lower() in {"true", "false", "1", "0"}:
        return stripped.lower() in {"true", "1"}
    return text


def projected(value: Any, schema: Schema) -> Any:
    """Return a JSON value without the members that its schema does not name."""
    if not isinstance(value, list | dict):
        return value
    schema = flat(schema)
    if isinstance(value, list):
        given = schema.get("items")
        items = flat(given) if isinstance(given, dict) else {}  # `items` may be `false` beside prefixItems
        if not items.get("properties") and "items" not in items:
            return list(value)  # mostly numbers: a covariance matrix has 36
        return [projected(item, items) for item in value]
    properties: dict[str, Schema] = schema.get("properties", {})
    if not properties:
        return value
    return {
        name: projected(item, properties[name]) if isinstance(item, list | dict) else item
        for name, item in value.items()
        if name in properties
    }


def flat(schema: Schema, within: frozenset[str] = frozenset()) -> Schema:
    """Return a schema with the properties of its allOf, or of its first alternative, merged into it.

    Args:
        schema: the schema.
        within: references that are being merged; a schema that combines itself adds nothing to itself.
    """
    if "$ref" not in schema and _COMBINING.isdisjoint(schema):
        return schema
    reference = str(schema.get("$ref", ""))
    if reference and reference in within:
        return {}
    within, schema = within | {reference}, whole(schema)
    if _COMBINING.isdisjoint(schema):
        return schema
    parts = [*schema.get("allOf", ()), *schema.get("oneOf", ())[:1], *schema.get("anyOf", ())[:1]]
    result = {key: item for key, item in schema.items() if key not in _COMBINING}
    for part in parts:
        inner = flat(part, within)
        properties = {**inner.get("properties", {}), **result.get("properties", {})}
        for name in inner.get("properties", {}).keys() & result.get("properties", {}).keys():
            one, other = inner["properties"][name], result["properties"][name]
            # A member that several parts describe must satisfy all of them.
            properties[name] = one if one == other else {"allOf": [other, one]}
        result = {
            **inner,
            **result,
            "properties": properties,
            "required": [*inner.get("required", ()), *result.get("required", ())],
        }
        if not result["properties"]:
            del result["properties"]
    return result


def discriminator_of(schema: Schema) -> tuple[str, tuple[str, ...]]:
    """Return the member that names the alternative, and its mapped values; empty if there is none."""
    given = schema.get("discriminator")
    mapping = given.get("mapping") if isinstance(given, dict) else None
    if not isinstance(given, dict) or not isinstance(mapping, dict):
        return "", ()
    return str(given.get("propertyName", "")), tuple(mapping)


def flattened(value: Any, where: str = "") -> dict[str, Any]:
    """Return all scalars of a value by their paths, numbers as doubles, and the length of each list."""
    if isinstance(value, dict):
        leaves: dict[str, Any] = {} if value else {where: "{}"}
        for name, item in value.items():
            leaves.update(flattened(item, f"{where}.{name}" if where else str(name)))
        return leaves
    if isinstance(value, list):
        leaves = {f"{where}[]": len(value)}
        for index, item in enumerate(value):
            leaves.update(flattened(item, f"{where}[{index}]"))
        return leaves
    if isinstance(value, int | float) and not isinstance(value, bool):
        return {where: as_double(value)}
    return {where: value}
