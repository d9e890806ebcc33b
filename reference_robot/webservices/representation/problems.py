"""Error responses as problem details (RFC 9457), and the check of a client's data for fields, types and ranges."""

import math
from http import HTTPStatus
from typing import Any, Final

from lxml import etree

from reference_robot.webservices.representation.shapes import Real, Record, Series, Shape, Text, Truth, Whole
from reference_robot.webservices.representation.writing import element_of, write_json

PROBLEM_JSON: Final = "application/problem+json"
PROBLEM_XML: Final = "application/problem+xml"

_NAMESPACE: Final = "urn:ietf:rfc:7807"  # RFC 9457 appendix B keeps the namespace of RFC 7807


class Problem(Exception):  # noqa: N818 - RFC 9457's own name for it
    """An error response: 4xx for errors of the client, 5xx for the robot's; the detail names field and value.

    ``extensions`` are further members of the problem details object (RFC 9457 3.2), by name.
    """

    def __init__(
        self,
        status: int,
        detail: str,
        headers: tuple[tuple[bytes, bytes], ...] = (),
        extensions: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.headers = headers
        self.extensions = extensions or {}

    def members(self) -> dict[str, Any]:
        """Return the members of the problem details object: type, title, status, detail, and extensions."""
        return {
            "type": "about:blank",
            "title": HTTPStatus(self.status).phrase,
            "status": self.status,
            "detail": self.detail,
            **self.extensions,
        }

    def serialize(self, media_type: str) -> bytes:
        """Return the problem as a body of media type application/problem+json or application/problem+xml."""
        if media_type == PROBLEM_JSON:
            return write_json(self.members())
        root = etree.Element("problem", xmlns=_NAMESPACE)
        root.extend([element_of(value, name) for name, value in self.members().items()])
        return etree.tostring(root, encoding="utf-8", xml_declaration=True)


def not_yet(detail: str) -> Problem:
    """Return the Problem 503 with Retry-After for a temporary inability of the robot (RFC 9110 15.6.4)."""
    return Problem(503, detail, ((b"retry-after", b"1"),))


_SHOWN: Final = 120


def check(shape: Shape, plain: Any, where: str = "") -> Any:
    """Return parsed JSON or XML data that has the required shape (types of its fields), with real numbers as float.

    Args:
        shape: The required shape.
        plain: The parsed data: dicts, lists, str, int, float and bool.
        where: The path of the field for error messages; empty for the whole body.

    Raises:
        Problem: 422, with a detail that names the field and the value (RFC 9110 15.5.21).
    """
    return _CHECKS[type(shape)](shape, plain, where)


def invalid_field(where: str, plain: Any, why: str) -> Problem:
    """Return the Problem 422 for an invalid field, with its path, its value and the rule ``why``."""
    return Problem(422, f"{where or 'the body'} {why}, not {clip(plain)}")


def clip(plain: Any) -> str:
    """Return a value as text for an error message: printable ASCII, at most 120 characters and an ellipsis."""
    text = ascii(plain)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}… ({len(text)} characters)"


def _real(_shape: Real, plain: Any, where: str) -> float:
    if type(plain) is float or type(plain) is int:
        try:
            number = float(plain)
        except OverflowError:
            number = math.inf
        if math.isfinite(number):
            return number
    raise invalid_field(where, plain, "must be a finite number")


def _whole(shape: Whole, plain: Any, where: str) -> int:
    # JSON has only one kind of number: 4.0 equals 4.
    number = int(plain) if type(plain) is float and plain.is_integer() else plain
    if type(number) is int and shape.lowest <= number <= shape.highest:
        return number
    raise invalid_field(where, plain, f"must be an integer from {shape.lowest} to {shape.highest}")


def _text(shape: Text, plain: Any, where: str) -> str:
    if type(plain) is not str:
        raise invalid_field(where, plain, "must be a string")
    if len(plain) < shape.shortest or (shape.longest is not None and len(plain) > shape.longest):
        longest = "" if shape.longest is None else f" to {shape.longest}"
        raise invalid_field(where, plain, f"must have {shape.shortest}{longest} characters")
    try:
        plain.encode()
    except UnicodeEncodeError as error:  # an unpaired \ud800 in JSON (RFC 8259 8.2)
        raise invalid_field(where, plain, "must be Unicode text without lone surrogates") from error
    return plain


def _truth(_shape: Truth, plain: Any, where: str) -> bool:
    if type(plain) is not bool:
        raise invalid_field(where, plain, "must be true or false")
    return plain


def _series(shape: Series, plain: Any, where: str) -> list[Any]:
    if type(plain) is not list:
        raise invalid_field(where, plain, "must be a list")
    if shape.length is not None and len(plain) != shape.length:
        raise invalid_field(where, plain, f"must have {shape.length} items")
    return [check(shape.item, item, f"{where}[{index}]") for index, item in enumerate(plain)]


def _record(shape: Record, plain: Any, where: str) -> dict[str, Any]:
    if type(plain) is not dict:
        raise invalid_field(where, plain, f"must be an object of type {shape.name}")
    path = f"{where}." if where else ""
    known = dict(shape.fields)
    for name, value in plain.items():
        if name not in known:
            known_names = ", ".join(known)
            raise Problem(422, f"unknown field {clip(path + name)} = {clip(value)}; {shape.name} has {known_names}")
    result = {}
    for name, part in shape.fields:
        if name in plain:
            result[name] = check(part, plain[name], path + name)
        elif name not in shape.optional:
            raise Problem(422, f"missing field {path}{name}; got {clip(plain)}")
    return result


_CHECKS: Final[dict[type, Any]] = {
    Real: _real,
    Whole: _whole,
    Text: _text,
    Truth: _truth,
    Series: _series,
    Record: _record,
}
