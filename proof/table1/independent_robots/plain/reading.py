"""Read and write plain values as JSON, XML and YAML by a shape; errors name the field and value that do not fit."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass, field
from typing import Any
from xml.parsers import expat
from xml.sax.saxutils import escape

# A parser makes a carriage return a line feed unless it is written as a reference (XML 1.0 2.11).
_RETURN = {"\r": "&#13;"}
FORMATS = ("application/json", "application/xml", "text/plain")


def choose(accept: str | None, formats: tuple[str, ...] = FORMATS) -> str | None:
    """Return the media type to send for an Accept field (RFC 9110 12.5.1), or None if none is acceptable.

    Of equally welcome formats the first one is sent.
    """
    if accept is None or not accept.strip():
        return formats[0]
    ranges: list[tuple[str, float]] = []
    for part in accept.split(","):
        name, *parameters = [text.strip() for text in part.split(";")]
        quality = 1.0
        for parameter in parameters:
            key, _, value = parameter.partition("=")
            if key.strip().lower() == "q":
                try:
                    quality = float(value)
                except ValueError:
                    quality = 0.0
        ranges.append((name.lower(), quality))
    best = max(formats, key=lambda format_: _quality(format_, ranges))
    return best if _quality(best, ranges) > 0 else None


def _quality(format_: str, ranges: list[tuple[str, float]]) -> float:
    for pattern in (format_, format_.split("/", maxsplit=1)[0] + "/*", "*/*"):
        found = [quality for name, quality in ranges if name == pattern]
        if found:
            return max(found)
    return 0.0


def write(value: Any, root: str, format_: str) -> bytes:
    """Return a value in a format."""
    if format_ == "application/xml":
        return f'<?xml version="1.0" encoding="UTF-8"?>{element(root, value)}'.encode()
    if format_ == "text/plain":
        return ("\n".join(_yaml(value, "")) + "\n").encode()
    return as_json(value)


def as_json(value: Any) -> bytes:
    """Return JSON in which whole floats are written as integers."""
    return json.dumps(_whole(value), separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def _whole(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _whole(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_whole(part) for part in value]
    if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
        return int(value)
    return value


def element(name: str, value: Any) -> str:
    """Return XML; items of a list in a field repeat the field's element, those of a bare list are called item."""
    if isinstance(value, dict):
        inner = "".join(
            "".join(element(key, item) for item in part) if isinstance(part, list) else element(key, part)
            for key, part in value.items()
        )
        return f"<{name}>{inner}</{name}>"
    if isinstance(value, list):
        return f"<{name}>{''.join(element('item', item) for item in value)}</{name}>"
    text = escape(_without_illegal(value), _RETURN) if isinstance(value, str) else repr(value)
    return f"<{name}>{text}</{name}>"


def _yaml(value: Any, indent: str) -> list[str]:
    lines: list[str] = []
    if isinstance(value, dict):
        for key, part in value.items():
            if isinstance(part, dict | list) and part:
                lines += [f"{indent}{key}:", *_yaml(part, indent + "  ")]
            else:
                lines.append(f"{indent}{key}: {_scalar(part)}")
        return lines
    if not isinstance(value, list):
        return [indent + _scalar(value)]
    for item in value or [[]]:
        if isinstance(item, dict):
            first, *rest = _yaml(item, indent + "  ")
            lines += [f"{indent}- {first.lstrip()}", *rest]
        else:
            lines.append(f"{indent}- {_scalar(item)}" if value else f"{indent}[]")
    return lines


def _scalar(value: Any) -> str:
    if isinstance(value, str):
        return '"' + "".join(_quote(char) for char in value) + '"'
    if isinstance(value, list | dict):
        return "[]" if isinstance(value, list) else "{}"
    text = repr(value)
    # YAML 1.1 takes 1e-05 for a string: a float has a point.
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _quote(char: str) -> str:
    """Return a character as it is written inside YAML's double quotes."""
    if char in '"\\':
        return "\\" + char
    return char if char == " " or char.isprintable() else f"\\U{ord(char):08x}"


def _without_illegal(text: str) -> str:
    """Return a text without the characters that XML 1.0 does not allow (2.2)."""
    return "".join(char if char in "\t\n\r" or (char >= " " and char not in "\ufffe\uffff") else "?" for char in text)


NUMBER = re.compile(r"[+-]?(\d+(\.\d+)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
# XML Schema's double may also end in a point.
_DOUBLE = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INTEGER = re.compile(r"[+-]?\d+", re.ASCII)
_DEEPEST, _MOST_ATTRIBUTES, _LONGEST_NAME = 60, 60, 1000
_INT32 = 2**31
_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_HARMLESS = {f"{_XSI} {name}" for name in ("type", "schemaLocation", "noNamespaceSchemaLocation")}
_TIME = {"sec": "int32", "nanosec": "uint32"}
_HEADER = {"stamp?": _TIME, "frame_id": "string"}
VECTOR3 = {"x": "double", "y": "double", "z": "double"}
TWIST = {"linear": VECTOR3, "angular": VECTOR3}
_POSE = {"position": VECTOR3, "orientation": {**VECTOR3, "w": "double"}}
GOAL = {
    "header?": _HEADER,
    "goal_id?": {"stamp?": _TIME, "id": "id"},
    "goal": {"target_pose": {"header": _HEADER, "pose": _POSE}},
}
DELIVERY = {
    "depot_x": "double",
    "depot_y": "double",
    "destination_x": "double",
    "destination_y": "double",
    "message_code": "int32",
    "source_x": "double",
    "source_y": "double",
}
PLAN = {
    "x": "double",
    "y": "double",
    "yaw?": "double",
    "frame_id?": "string",
    "tolerance?": "double",
    "start_x?": "double",
    "start_y?": "double",
    "start_yaw?": "double",
}


class RefusedError(Exception):
    """Raised for input that the robot rejects.

    Args:
        status: the response's HTTP status.
        detail: names the offending field and value.
    """

    def __init__(self, status: int, detail: str) -> None:
        super().__init__(detail)
        self.status = status


@dataclass
class Element:
    """An XML element; a name is ``namespace local`` or ``local``."""

    name: str
    attributes: dict[str, str]
    children: list[Element] = field(default_factory=list)
    text: str = ""

    @property
    def namespace(self) -> str:
        """Return the element's namespace, or an empty string."""
        return self.name.rpartition(" ")[0]

    @property
    def local(self) -> str:
        """Return the element's name without its namespace."""
        return self.name.rpartition(" ")[2]


class UnsafeError(RefusedError):
    """XML that is dangerous rather than wrong."""


class MalformedError(RefusedError):
    """No XML at all."""


def parse_xml(body: bytes) -> Element:
    """Read a document without any Document Type Declaration, entity, processing instruction or excess.

    Raises:
        MalformedError, UnsafeError: see there.
    """
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    top = Element("", {})
    stack = [top]

    def begin(name: str, attributes: dict[str, str]) -> None:
        if len(stack) > _DEEPEST or len(attributes) > _MOST_ATTRIBUTES or len(name) > _LONGEST_NAME:
            raise UnsafeError(422, "XML that is too deep, too long in a name or too rich in attributes")
        element = Element(name, attributes)
        stack[-1].children.append(element)
        stack.append(element)

    def end(_name: str) -> None:
        stack.pop()

    def text(data: str) -> None:
        stack[-1].text += data

    def unsafe(*_: object) -> None:
        raise UnsafeError(422, "a Document Type Declaration or processing instruction")

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = begin, end, text
    parser.StartDoctypeDeclHandler = unsafe
    parser.ProcessingInstructionHandler = unsafe
    try:
        parser.Parse(body, True)  # noqa: FBT003 - the whole document at once
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise MalformedError(400, f"no XML: {error}") from None
    return top.children[0]


def parse_json(body: bytes) -> Any:
    """Read JSON strictly (RFC 8259).

    Raises:
        RefusedError: it is none, or has a name twice.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name, value in pairs:
            if name in found:
                raise RefusedError(422, f"{name}: there twice, again with {_excerpt(value)}")
            found[name] = value
        return found

    def none(text: str) -> Any:
        raise RefusedError(400, f"no JSON: {text}")

    try:
        return json.loads(body.decode("utf-8"), object_pairs_hook=once, parse_constant=none)
    except (ValueError, RecursionError) as error:
        raise RefusedError(400, f"no JSON: {error}") from None


def _excerpt(value: Any) -> str:
    try:
        return json.dumps(value)[:200]
    except (ValueError, RecursionError):
        return "a value that is too large to be shown"


def fit(value: Any, shape: Any, path: str = "") -> Any:
    """Return a JSON value that fits a shape: a dict of fields (``?`` marks optional ones) or a simple type's name.

    Raises:
        RefusedError: the value does not fit.
    """
    if isinstance(shape, dict):
        if not isinstance(value, dict):
            raise RefusedError(422, f"{path or 'body'}: {_excerpt(value)} is no object")
        names = {name.rstrip("?"): (name.endswith("?"), part) for name, part in shape.items()}
        for name in value:
            if name not in names:
                raise RefusedError(422, f"{_join(path, name)}: unknown field, with {_excerpt(value[name])}")
        for name, (optional, _) in names.items():
            if name not in value and not optional:
                raise RefusedError(422, f"{_join(path, name)}: missing in {_excerpt(value)}")
        return {name: fit(value[name], part, _join(path, name)) for name, (_, part) in names.items() if name in value}
    return _simple(value, shape, path)


def _simple(value: Any, type_: str, path: str) -> Any:
    wrong = RefusedError(422, f"{path}: {_excerpt(value)} is no {type_}")
    if type_ in {"string", "id"}:
        if not isinstance(value, str) or any("\ud800" <= char <= "\udfff" for char in value):
            raise wrong
        if type_ == "id" and not 0 < len(value) <= 255:  # noqa: PLR2004 - contract
            raise wrong
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise wrong
    if type_ == "double":
        try:
            number = float(value)
        except OverflowError:
            raise wrong from None
        if not math.isfinite(number):
            raise RefusedError(422, f"{path}: {value!r} is not finite")
        return number
    low, high = (-_INT32, _INT32) if type_ == "int32" else (0, 2 * _INT32)
    if not low <= value < high or value != int(value):
        raise wrong
    return int(value)


def fit_element(  # noqa: C901 - one rule after another
    element: Element, shape: Any, path: str, *, ordered: bool
) -> Any:
    """Return an XML element's content as fit() does; ``ordered`` requires the order of an XML Schema sequence.

    Raises:
        RefusedError: the content does not fit.
    """
    for name, value in element.attributes.items():
        if name not in _HARMLESS:
            raise RefusedError(422, f"{path}: attribute {name!r} with {value[:100]!r} is not known")
    if not isinstance(shape, dict):
        if element.children:
            raise RefusedError(422, f"{path}: {element.children[0].name!r} stands where text should")
        text = element.text
        if shape in {"string", "id"}:
            return _simple(text, shape, path)
        return _simple(number(text.strip(" \t\r\n"), path, integer=shape != "double", pattern=_DOUBLE), shape, path)
    if element.text.strip():
        raise RefusedError(422, f"{path}: text {element.text.strip()[:100]!r} between elements")
    found: dict[str, Any] = {}
    names = {name.rstrip("?"): (name.endswith("?"), part) for name, part in shape.items()}
    for child in element.children:
        where = _join(path, child.name)
        if child.name not in names:
            raise RefusedError(422, f"{where}: unknown element, with {child.text.strip()[:100]!r}")
        if child.name in found:
            raise RefusedError(422, f"{where}: there twice, again with {child.text.strip()[:100]!r}")
        if ordered and found and list(names).index(child.name) < list(names).index(list(found)[-1]):
            raise RefusedError(422, f"{where}: in the wrong place, with {child.text.strip()[:100]!r}")
        found[child.name] = fit_element(child, names[child.name][1], where, ordered=ordered)
    for name, (optional, _) in names.items():
        if name not in found and not optional:
            raise RefusedError(422, f"{_join(path, name)}: missing in {element.local!r}")
    return found


def number(text: str, name: str, *, integer: bool = False, pattern: re.Pattern[str] = NUMBER) -> float | int:
    """Return the number that a text represents.

    Raises:
        RefusedError: the text is not a number, or the number is not finite.
    """
    if integer:
        if not _INTEGER.fullmatch(text) or len(text) > 200:  # noqa: PLR2004 - no int has that many digits
            raise RefusedError(422, f"{name}: {text[:200]!r} is no integer")
        return int(text)
    if not pattern.fullmatch(text) or not math.isfinite(float(text)):
        raise RefusedError(422, f"{name}: {text[:200]!r} is no finite number")
    return float(text)


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name
