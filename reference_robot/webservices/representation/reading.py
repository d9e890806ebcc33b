"""Parsing of request bodies into dicts, lists and numbers: strict JSON (RFC 8259), and XML as the robot sends it."""

import codecs
import json
import math
import re
from collections import Counter
from functools import lru_cache
from typing import Any, Final

from lxml import etree

from reference_robot.webservices.representation.problems import Problem, check, clip
from reference_robot.webservices.representation.shapes import Real, Record, Series, Text, Truth, Whole
from reference_robot.webservices.representation.writing import JSON, XML
from reference_robot.webservices.representation.xml_input import parsed

ACCEPTED: Final = (JSON, XML)

# The contract's grammar of a number in paths, queries and XML; ASCII digits only. The quantifiers are
# possessive, because the text after a number never belongs to it.
NUMBER: Final = r"[+-]?+(?:[0-9]++(?:\.[0-9]++)?+|\.[0-9]++)(?:[eE][+-]?+[0-9]++)?+"
_REAL: Final = re.compile(NUMBER)
_WHOLE: Final = re.compile(r"[+-]?[0-9]{1,40}")  # more than 64 bits; Python refuses 5,000 digits
_DIGITS_READ: Final = 400  # an integer with more digits exceeds every double
_XML_SPACE: Final = " \t\r\n"


class _Beyond:
    """A JSON number that is too large for a double; its repr is the text that the client sent."""

    def __init__(self, lexeme: str) -> None:
        self.lexeme = lexeme

    def __repr__(self) -> str:
        return self.lexeme


def read(body: bytes, content_type: bytes | None, shape: Record) -> dict[str, Any]:
    """Return a JSON or XML request body as a dict that has the required shape (types of its fields).

    The caller has limited the body's size.

    Raises:
        Problem: 415 for another media type, 400 for a body that is not JSON or XML, 422 for a wrong shape or value.
    """
    media_type, charset = parsed_content_type(content_type)
    if media_type == JSON:
        if charset is not None and charset not in {"utf-8", "utf8", "us-ascii"}:
            raise _media_problem(f"charset {charset!a}")
        return dict(check(shape, read_json(body)))
    if media_type == XML:
        root = parsed(body, charset)
        if root.tag != shape.name:
            raise Problem(422, f"the root element must be {shape.name}, not {clip(root.tag)}")
        return dict(check(shape, _from_element(root, shape, shape.name)))
    raise _media_problem(f"Content-Type {(content_type or b'').decode('latin-1')[:200]!a}")


@lru_cache(maxsize=256)
def parsed_content_type(field: bytes | None) -> tuple[str, str | None]:
    """Return media type and charset of a Content-Type in lower case (RFC 9110 8.3.1); the charset may be None."""
    media_type, *parameters = (field or b"").decode("latin-1").lower().split(";")
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        if name.strip() == "charset":
            return media_type.strip(), value.strip().strip('"')
    return media_type.strip(), None


def read_json(body: bytes) -> Any:
    """Return the value of a JSON text; numbers too large for a double become ``_Beyond`` objects.

    Raises:
        Problem: 400 for a byte order mark, invalid UTF-8, invalid JSON (including NaN and Infinity) and too deep
            nesting; 422 for a name that occurs twice in one object.
    """
    if body.startswith(codecs.BOM_UTF8):
        raise Problem(400, "the body begins with a byte order mark (RFC 8259 8.1)")
    try:
        return json.loads(
            body.decode(),
            object_pairs_hook=_object,
            parse_constant=_refuse_constant,
            parse_float=_real,
            parse_int=_whole,
        )
    except UnicodeDecodeError as error:
        raise Problem(400, f"the body is not UTF-8: {error.reason} at byte {error.start}") from error
    except json.JSONDecodeError as error:
        raise Problem(400, f"the body is not JSON: {error.msg} at line {error.lineno} column {error.colno}") from error
    except RecursionError as error:
        raise Problem(400, "the body is nested too deeply") from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        twice, _ = Counter(name for name, _ in pairs).most_common(1)[0]
        raise Problem(422, f"the field {clip(twice)} occurs more than once in {clip(pairs)}")
    return result


def _refuse_constant(name: str) -> None:
    raise Problem(400, f"{name} is not a JSON number (RFC 8259 6)")


def _real(lexeme: str) -> float | _Beyond:
    number = float(lexeme)
    return number if math.isfinite(number) else _Beyond(lexeme)


def _whole(lexeme: str) -> int | _Beyond:
    return int(lexeme) if len(lexeme) <= _DIGITS_READ else _Beyond(lexeme)


def _from_element(element: etree._Element, shape: Any, where: str) -> Any:
    """Return the value of an XML element; a value of a wrong type remains text, which ``checked`` refuses later."""
    if element.attrib:
        raise Problem(422, f"unknown attribute {clip(next(iter(element.attrib)))} of {where}")
    if isinstance(shape, Record):
        return _from_children(element, shape, where)
    if len(element):
        raise Problem(422, f"{where} must hold a single value, not elements")
    text = element.text or ""
    value = text.strip(_XML_SPACE)
    if isinstance(shape, Real) and _REAL.fullmatch(value):
        return _real(value)
    if isinstance(shape, Whole) and _WHOLE.fullmatch(value):
        return int(value)
    if isinstance(shape, Truth) and value in {"true", "false", "1", "0"}:
        return value in {"true", "1"}
    return text


def _from_children(element: etree._Element, shape: Record, where: str) -> dict[str, Any]:
    result: dict[str, Any] = {name: [] for name, part in shape.fields if isinstance(part, Series)}
    _refuse_text(element.text, where)
    for child in element:
        _refuse_text(child.tail, where)
        part = shape.field(child.tag)
        path = f"{where}.{child.tag}"
        if isinstance(part, Series):
            result[child.tag].append(_from_element(child, part.item, path))
        elif child.tag in result:
            raise Problem(422, f"{clip(path)} occurs more than once")
        else:
            result[child.tag] = _from_element(child, part or Text(), path)
    return result


def _refuse_text(text: str | None, where: str) -> None:
    if text and text.strip(_XML_SPACE):
        raise Problem(422, f"{where} holds elements, not the text {clip(text.strip())}")


def _media_problem(what: str) -> Problem:
    accepted = ", ".join(ACCEPTED)
    return Problem(415, f"{what} is not supported; send {accepted} in UTF-8", ((b"accept", accepted.encode()),))
