"""Convert ROS messages of any installed type to JSON values and back, without losing a bit.

A message is an object by field. Integers are numbers of any size, floats are numbers with NaN and infinities bare, as
Python's JSON has them; uint8[] and byte[] are `{"b64": …}`, and a byte is a number.
"""

import base64
import importlib
import re
from collections.abc import Iterable
from functools import cache
from typing import Any, Final

_TYPE: Final = re.compile(r"(\w+)/(?:(msg|srv|action)/)?(\w+)")
_ARRAY: Final = re.compile(r"sequence<(?P<items>.+?)(?:, (?P<most>\d+))?>|(?P<item>.+)\[(?P<count>\d+)\]")
_OCTETS: Final = frozenset({"uint8", "octet"})


class UnknownTypeError(Exception):
    """Raised when a type is not installed; the message says which package brings it."""


@cache
def type_of(name: str) -> Any:
    """Return the Python class of a type, such as "nav_msgs/msg/Odometry"; a part of a service has its name at the end.

    Raises:
        UnknownTypeError: it is not installed.
    """
    found = _TYPE.fullmatch(name.partition("#")[0])
    if found is None:
        raise UnknownTypeError(f"{name!r} is no type of ROS 2, such as 'nav_msgs/msg/Odometry'")
    package, kind, own = found.groups()
    try:
        whole = getattr(importlib.import_module(f"{package}.{kind or 'msg'}"), own)
    except ModuleNotFoundError as error:
        raise UnknownTypeError(
            f"the package {package} is not installed: apt install ros-jazzy-{package.replace('_', '-')}, or "
            f"pip install 'ros-{package.replace('_', '-')}'"
        ) from error
    except AttributeError as error:
        raise UnknownTypeError(f"the package {package} has no {kind or 'msg'} {own!r}") from error
    part = name.partition("#")[2]
    return getattr(whole, part) if part else whole


def described(name: str) -> dict[str, dict[str, str]]:
    """Return the fields of a type and of all types in it: the type of each field by its name, by type.

    Raises:
        UnknownTypeError: one is not installed.
    """
    found: dict[str, dict[str, str]] = {}
    left = [name]
    while left:
        one = left.pop()
        if one not in found:
            found[one] = dict(type_of(one).get_fields_and_field_types())
            left += [item for item in map(_item_of, found[one].values()) if "/" in item]
    return found


def _item_of(declared: str) -> str:
    array = _ARRAY.fullmatch(declared)
    return (array["items"] or array["item"]) if array else declared


def plain(message: Any) -> dict[str, Any]:
    """Return the JSON value of a message."""
    fields: dict[str, str] = message.get_fields_and_field_types()
    return {name: _plain(getattr(message, name), declared) for name, declared in fields.items()}


def _plain(value: Any, declared: str) -> Any:
    item = _item_of(declared)
    if item is declared:
        if "/" in declared:
            return plain(value)
        return value[0] if declared == "octet" else value
    if item in _OCTETS:
        octets = b"".join(value) if item == "octet" else bytes(value)
        return {"b64": base64.b64encode(octets).decode()}
    if "/" in item:
        return [plain(one) for one in value]
    return value.tolist() if hasattr(value, "tolist") else list(value)


def plain_parameter(kind: str, value: Any) -> Any:
    """Return the JSON value of a parameter of a kind, such as "byte_array", whose octets are a list of bytes."""
    if not kind.endswith("_array") or value is None:
        return value
    return {"b64": base64.b64encode(b"".join(value)).decode()} if kind == "byte_array" else list(value)


def octets_of(value: dict[str, str]) -> list[bytes]:
    """Return the octets in a JSON value as a parameter has them."""
    return list(_singly(base64.b64decode(value["b64"])))


def message_of(name: str, value: dict[str, Any]) -> Any:
    """Return the message that a JSON value stands for; fields that it lacks have their defaults.

    Raises:
        UnknownTypeError: the type is not installed.
        ValueError: the value is none of this type.
    """
    return _filled(type_of(name), value)


def _filled(kind: Any, value: dict[str, Any]) -> Any:
    fields: dict[str, str] = kind.get_fields_and_field_types()
    if strange := value.keys() - fields.keys():
        raise ValueError(f"{kind.__name__} has no field {min(strange)!r}")
    return kind(**{name: _made(value[name], fields[name]) for name in value})


def _made(value: Any, declared: str) -> Any:
    item = _item_of(declared)
    if item is declared:
        if "/" in declared:
            return _filled(type_of(declared), value)
        return bytes([value]) if declared == "octet" else value
    if isinstance(value, dict):
        octets = base64.b64decode(value["b64"])
        return _singly(octets) if item == "octet" else octets if "[" not in declared else list(octets)
    return [_filled(type_of(item), one) for one in value] if "/" in item else value


def _singly(octets: bytes) -> Iterable[bytes]:
    return [octets[index : index + 1] for index in range(len(octets))]
