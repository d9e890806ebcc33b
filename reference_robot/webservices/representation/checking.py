"""The check that JSON or XML data from a client has the fields, types and value ranges that the contract requires."""

import math
from typing import Any, Final

from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.representation.shapes import Real, Record, Series, Shape, Text, Truth, Whole

_SHOWN: Final = 120


def checked(shape: Shape, plain: Any, where: str = "") -> Any:
    """Return parsed JSON or XML data that has the required shape (types of its fields), with real numbers as float.

    Args:
        shape: The required shape.
        plain: The parsed data: dicts, lists, str, int, float and bool.
        where: The path of the field for error messages; empty for the whole body.

    Raises:
        Problem: 422, with a detail that names the field and the value (RFC 9110 15.5.21).
    """
    return _CHECKS[type(shape)](shape, plain, where)


def refused(where: str, plain: Any, why: str) -> Problem:
    """Return the Problem 422 for an invalid field, with its path, its value and the rule ``why``."""
    return Problem(422, f"{where or 'the body'} {why}, not {shown(plain)}")


def shown(plain: Any) -> str:
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
    raise refused(where, plain, "must be a finite number")


def _whole(shape: Whole, plain: Any, where: str) -> int:
    # JSON has only one kind of number: 4.0 equals 4.
    number = int(plain) if type(plain) is float and plain.is_integer() else plain
    if type(number) is int and shape.lowest <= number <= shape.highest:
        return number
    raise refused(where, plain, f"must be an integer from {shape.lowest} to {shape.highest}")


def _text(shape: Text, plain: Any, where: str) -> str:
    if type(plain) is not str:
        raise refused(where, plain, "must be a string")
    if len(plain) < shape.shortest or (shape.longest is not None and len(plain) > shape.longest):
        longest = "" if shape.longest is None else f" to {shape.longest}"
        raise refused(where, plain, f"must have {shape.shortest}{longest} characters")
    try:
        plain.encode()
    except UnicodeEncodeError as error:  # an unpaired \ud800 in JSON (RFC 8259 8.2)
        raise refused(where, plain, "must be Unicode text without lone surrogates") from error
    return plain


def _truth(_shape: Truth, plain: Any, where: str) -> bool:
    if type(plain) is not bool:
        raise refused(where, plain, "must be true or false")
    return plain


def _series(shape: Series, plain: Any, where: str) -> list[Any]:
    if type(plain) is not list:
        raise refused(where, plain, "must be a list")
    if shape.length is not None and len(plain) != shape.length:
        raise refused(where, plain, f"must have {shape.length} items")
    return [checked(shape.item, item, f"{where}[{index}]") for index, item in enumerate(plain)]


def _record(shape: Record, plain: Any, where: str) -> dict[str, Any]:
    if type(plain) is not dict:
        raise refused(where, plain, f"must be an object of type {shape.name}")
    path = f"{where}." if where else ""
    known = dict(shape.fields)
    for name, value in plain.items():
        if name not in known:
            known_names = ", ".join(known)
            raise Problem(422, f"unknown field {shown(path + name)} = {shown(value)}; {shape.name} has {known_names}")
    result = {}
    for name, part in shape.fields:
        if name in plain:
            result[name] = checked(part, plain[name], path + name)
        elif name not in shape.optional:
            raise Problem(422, f"missing field {path}{name}; got {shown(plain)}")
    return result


_CHECKS: Final[dict[type, Any]] = {
    Real: _real,
    Whole: _whole,
    Text: _text,
    Truth: _truth,
    Series: _series,
    Record: _record,
}
