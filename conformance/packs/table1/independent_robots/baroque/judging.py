"""Input judged by the contract's own OpenAPI schemas, with jsonschema."""

import json
import math
import re
from functools import cache
from typing import Any

import yaml
from jsonschema import Draft202012Validator
from lxml import etree

from conformance.papers_robot.files import CONTRACT_DIR

_NUMBER = re.compile(r"[+-]?(\d+(\.\d+)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_MOST_ATTRIBUTES = 100


class NotTakenError(Exception):
    """Input that is refused, with the status that says so."""

    def __init__(self, status: int, detail: str) -> None:
        super().__init__(detail)
        self.status = status


@cache
def components() -> dict[str, Any]:
    """Return the schemas of the contract."""
    found: dict[str, Any] = yaml.safe_load((CONTRACT_DIR / "openapi.yaml").read_text(encoding="utf-8"))["components"]
    return found


@cache
def _validator(name: str) -> Draft202012Validator:
    return Draft202012Validator({"$ref": f"#/components/schemas/{name}", "components": components()})


def from_json(body: bytes) -> Any:
    """Return parsed JSON; reject texts that Python's parser accepts beyond JSON, such as NaN."""

    def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
        if len({name for name, _ in items}) < len(items):
            names = [name for name, _ in items]
            twice = next(name for name in names if names.count(name) > 1)
            values = [value for name, value in items if name == twice]
            raise NotTakenError(400, f"{twice} is given more than once: {values!r:.200}")
        return dict(items)

    def constant(text: str) -> Any:
        raise NotTakenError(400, f"{text} is no JSON")

    def finite(text: str) -> float:
        number = float(text)
        if not math.isfinite(number):
            raise NotTakenError(422, f"a number in the body, {text:.80}, is beyond a double")
        return number

    try:
        text = body.decode("utf-8")
        return json.loads(text, object_pairs_hook=pairs, parse_constant=constant, parse_float=finite)
    except (ValueError, RecursionError) as error:
        raise NotTakenError(400, f"the body is no JSON: {error}") from None


def judged(value: Any, schema: str) -> Any:
    """Return a value if it is valid by its schema.

    Raises:
        NotTakenError: the value is not valid.
    """
    try:
        error = next(iter(sorted(_validator(schema).iter_errors(value), key=lambda one: -len(one.absolute_path))), None)
    except RecursionError:
        raise NotTakenError(400, "the body is nested too deep") from None
    if error is not None:
        where = ".".join(str(part) for part in error.absolute_path) or "body"
        raise NotTakenError(422, f"{where}: {error.message[:400]} (given: {error.instance!r:.200})")
    _encodable(value)
    return value


def _encodable(value: Any) -> None:
    if isinstance(value, dict):
        for part in value.values():
            _encodable(part)
    elif isinstance(value, str):
        try:
            value.encode()
        except UnicodeEncodeError:
            raise NotTakenError(422, f"{value!a:.100} is no text") from None
    elif isinstance(value, int) and abs(value) > 10**300:
        raise NotTakenError(422, f"{str(value)[:80]} is beyond a double")


def safe_xml(body: bytes) -> Any:
    """Return the root element of an XML document without a DOCTYPE and within the limits on size and depth.

    Raises:
        etree.XMLSyntaxError: the body is not XML.
        NotTakenError: the document has a DOCTYPE or exceeds a limit.
    """
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, remove_comments=True
    )
    root: Any = etree.fromstring(body, parser)
    if root.getroottree().docinfo.doctype:
        raise NotTakenError(422, "a Document Type Declaration is not taken")
    for node in [*root.itersiblings(preceding=True), *root.itersiblings(), *root.iter()]:
        if not isinstance(node.tag, str):
            raise NotTakenError(422, "a processing instruction is not taken")
        if len(node.attrib) > _MOST_ATTRIBUTES:
            raise NotTakenError(422, f"{len(node.attrib)} attributes are too many")
    return root


def from_xml(body: bytes, root: str, schema: str) -> Any:
    """Return the JSON value that an XML body represents.

    Raises:
        NotTakenError: the body does not represent a valid value.
    """
    try:
        top = safe_xml(body)
    except etree.XMLSyntaxError as error:
        raise NotTakenError(400, f"the body is no XML: {error}") from None
    if top.tag != root:
        raise NotTakenError(422, f"the root is {top.tag:.200}, not {root}")
    return _value(top, components()["schemas"][schema], root)


def _value(element: Any, schema: dict[str, Any], path: str) -> Any:
    if "$ref" in schema:
        schema = components()["schemas"][schema["$ref"].rpartition("/")[2]]
    if element.attrib:
        raise NotTakenError(422, f"{path}: attributes {dict(element.attrib)!r:.200} are not taken")
    text = element.text or ""
    if schema["type"] == "object":
        if (text + "".join(child.tail or "" for child in element)).strip():
            raise NotTakenError(422, f"{path}: there is text between elements, {text.strip()!r:.100}")
        found: dict[str, Any] = {}
        for child in element:
            part = schema["properties"].get(child.tag)
            if part is None or child.tag in found:
                raise NotTakenError(422, f"{path}.{child.tag:.200}: unknown or there twice, {child.text or ''!r:.100}")
            found[child.tag] = _value(child, part, f"{path}.{child.tag}")
        return found
    if len(element):
        raise NotTakenError(422, f"{path}: {element[0].tag:.200} stands where text should")
    if schema["type"] == "string":
        return text
    return number(text.strip(), path, whole=schema["type"] == "integer")


def number(text: str, name: str, *, whole: bool = False) -> float | int:
    """Return the number that a text represents.

    Raises:
        NotTakenError: the text is not a number.
    """
    pattern = re.compile(r"[+-]?\d{1,99}", re.ASCII) if whole else _NUMBER
    if not pattern.fullmatch(text) or not math.isfinite(float(text)):
        raise NotTakenError(400, f"{name}: {text!r:.200} is not the number that it should be")
    return int(text) if whole else float(text)
