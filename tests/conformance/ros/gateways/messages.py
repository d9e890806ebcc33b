"""ROS messages as JSON and back, in the number forms that a gateway declares; schemas of both."""

import base64
import binascii
import importlib
import json
import math
import struct
import time
from dataclasses import dataclass
from typing import Any

from rosidl_parser.definition import (
    AbstractNestedType,
    AbstractString,
    AbstractWString,
    Array,
    BasicType,
    BoundedSequence,
    NamespacedType,
)

_FLOATS = {"float", "double", "long double"}
_WORDS = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
_FLOAT32_MOST = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]


class RefusedError(ValueError):
    """A JSON value that is no message of a type; the message names the place."""


@dataclass(frozen=True)
class Forms:
    """How JSON writes what it has no form for.

    Attributes:
        non_finite: null or string.
        integers: number or string, for 64 bits.
        bytes: base64 or array, for uint8[] and byte[].
        required: whether a body has to name all fields.
        faults: what is done wrong.
    """

    non_finite: str = "null"
    integers: str = "number"
    bytes: str = "base64"
    required: bool = False
    faults: frozenset[str] = frozenset()

    def write(self, message: Any) -> dict[str, Any]:
        """Return a message as JSON."""
        slots = dict(zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True))
        fields = {name: self._out(getattr(message, name), slot) for name, slot in slots.items()}
        if "fields swapped" in self.faults and "y" in slots:
            fields["x"], fields["y"] = fields["y"], fields["x"]
        if "nanosec" in slots and "stamps as doubles" in self.faults:
            seconds = message.sec + message.nanosec / 1e9
            fields = {"sec": int(seconds), "nanosec": int(seconds % 1 * 1e9)}
        if "nanosec" in slots and "stamps of the request" in self.faults:
            fields = {"sec": int(time.time()), "nanosec": 0}
        return fields

    def read(self, value: Any, kind: type, place: str = "") -> Any:
        """Return the message of a type that JSON names.

        Raises:
            RefusedError: it names none.
        """
        if not isinstance(value, dict):
            raise RefusedError(f"{place or 'the body'} is not an object")
        slots = dict(zip(kind.get_fields_and_field_types(), kind.SLOT_TYPES, strict=True))
        if unknown := value.keys() - slots.keys():
            raise RefusedError(f"{place} has no field {min(unknown)!r}")
        if self.required and (missing := slots.keys() - value.keys()):
            raise RefusedError(f"{place}/{min(missing)} is missing")
        message = kind()
        given = {name: self._in(value[name], slots[name], f"{place}/{name}") for name in value}
        for name, field in given.items():
            setattr(message, name, field)
        if "fields swapped" in self.faults and "y" in slots:
            message.x, message.y = message.y, message.x
        return message

    def schema(self, kind: type, *, sent: bool) -> dict[str, Any]:
        """Return the JSON Schema of a type, as a request's body (`sent`) or in a response."""
        slots = dict(zip(kind.get_fields_and_field_types(), kind.SLOT_TYPES, strict=True))
        schema = {"type": "object", "properties": {name: self._schema(slot, sent=sent) for name, slot in slots.items()}}
        schema["additionalProperties"] = False
        return schema | ({"required": list(slots)} if self.required or not sent else {})

    def _out(self, value: Any, kind: Any) -> Any:
        if isinstance(kind, NamespacedType | AbstractNestedType):
            return self.write(value) if isinstance(kind, NamespacedType) else self._array_out(value, kind)
        if not isinstance(kind, BasicType):
            return self._text(value)
        if kind.typename in _FLOATS:
            return self._number(float(value))
        if kind.typename in {"int64", "uint64"}:
            return self._wide(int(value))
        if kind.typename == "octet":
            return value[0]
        return bool(value) if kind.typename == "boolean" else int(value)

    def _array_out(self, value: Any, kind: AbstractNestedType) -> Any:
        if _octets(kind):
            octets = b"".join(one if isinstance(one, bytes) else bytes([int(one) & 255]) for one in value)
            octets = octets[:65536] if "arrays cut" in self.faults else octets
            return base64.b64encode(octets).decode() if self.bytes == "base64" else list(octets)
        return [self._out(one, kind.value_type) for one in (value[:1000] if "arrays cut" in self.faults else value)]

    def _wide(self, value: int) -> Any:
        if "2^53" in self.faults:
            value = int(float(value))
        return str(value) if self.integers == "string" else value

    def _text(self, value: str) -> str:
        value = value[:255] if "texts cut" in self.faults else value
        return value.encode("ascii", "replace").decode() if "ascii" in self.faults else value

    def _number(self, value: float) -> Any:
        if math.isfinite(value):
            return round(value, 6) if "6 digits" in self.faults else value
        if "NaN as 0" in self.faults:
            return 0.0
        if (self.non_finite == "null") is not ("NaN unsaid" in self.faults):
            return None
        return next(word for word, meant in _WORDS.items() if repr(meant) == repr(value))

    def _in(self, value: Any, kind: Any, place: str) -> Any:
        if isinstance(kind, NamespacedType):
            return self.read(value, interface("/".join(kind.namespaced_name())), place)
        if isinstance(kind, AbstractNestedType):
            return self._array(value, kind, place)
        if isinstance(kind, BasicType):
            if kind.typename in _FLOATS:
                return self._float(value, kind.typename, place)
            if kind.typename == "boolean":
                if not isinstance(value, bool):
                    raise RefusedError(f"{place} is not a boolean")
                return value
            return self._integer(value, kind.typename, place)
        if not isinstance(value, str) or "\0" in value or any("\ud800" <= one <= "\udfff" for one in value):
            raise RefusedError(f"{place} is not a string that ROS can hold")
        if isinstance(kind, AbstractString | AbstractWString) and len(value) > getattr(kind, "maximum_size", 1 << 31):
            raise RefusedError(f"{place} is too long")
        return self._text(value)

    def _array(self, value: Any, kind: Any, place: str) -> Any:
        if _octets(kind) and self.bytes == "base64":
            if not isinstance(value, str):
                raise RefusedError(f"{place} is not base64")
            try:
                octets = list(base64.b64decode(value, validate=True))
            except (binascii.Error, ValueError) as error:
                raise RefusedError(f"{place} is not base64: {error}") from error
            items = [bytes([one]) for one in octets] if kind.value_type.typename == "octet" else octets
        elif isinstance(value, list):
            items = [self._in(one, kind.value_type, f"{place}/{number}") for number, one in enumerate(value)]
        else:
            raise RefusedError(f"{place} is not an array")
        if isinstance(kind, Array) and len(items) != kind.size:
            raise RefusedError(f"{place} has {len(items)} items, not {kind.size}")
        if isinstance(kind, BoundedSequence) and len(items) > kind.maximum_size:
            raise RefusedError(f"{place} has over {kind.maximum_size} items")
        return items

    def _float(self, value: Any, name: str, place: str) -> float:
        if value is None and self.non_finite == "null":
            return 0.0 if "NaN as 0" in self.faults else math.nan
        if isinstance(value, str) and self.non_finite == "string" and value in _WORDS:
            return 0.0 if "NaN as 0" in self.faults else _WORDS[value]
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RefusedError(f"{place} is not a number")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number) or (name == "float" and abs(number) > _FLOAT32_MOST):
            raise RefusedError(f"{place} is beyond what ROS can hold")
        if "limits" in self.faults and abs(number) > 1:
            raise RefusedError(f"{place} is beyond the limit of this robot")
        return round(number, 6) if "6 digits sent" in self.faults else number

    def _integer(self, value: Any, name: str, place: str) -> Any:
        wide = name in {"int64", "uint64"}
        if wide and self.integers == "string" and isinstance(value, str) and value.removeprefix("-").isdecimal():
            value = int(value) if len(value) < 24 else 2**64
        if isinstance(value, bool) or not isinstance(value, int):
            raise RefusedError(f"{place} is not an integer")
        lowest, highest = _range(name)
        if "integers wrap" in self.faults:
            value = (value - lowest) % (highest - lowest + 1) + lowest
        if not lowest <= value <= highest:
            raise RefusedError(f"{place} is not from {lowest} to {highest}")
        if wide and "2^53" in self.faults:
            return max(lowest, min(int(float(value)), highest))
        return bytes([value]) if name == "octet" else value

    def _schema(self, kind: Any, *, sent: bool) -> dict[str, Any]:
        if isinstance(kind, NamespacedType):
            return self.schema(interface("/".join(kind.namespaced_name())), sent=sent)
        if isinstance(kind, AbstractNestedType):
            if _octets(kind) and self.bytes == "base64":
                return {"type": "string", "contentEncoding": "base64", "pattern": _BASE64}
            schema = {"type": "array", "items": self._schema(kind.value_type, sent=sent)}
            if isinstance(kind, Array):
                schema |= {"minItems": kind.size, "maxItems": kind.size}
            return schema | ({"maxItems": kind.maximum_size} if isinstance(kind, BoundedSequence) else {})
        if not isinstance(kind, BasicType):
            return {"type": "string", "pattern": "^[^\\u0000]*$"} if sent else {"type": "string"}
        if kind.typename in _FLOATS:
            most = _FLOAT32_MOST if kind.typename == "float" else 1.7976931348623157e308
            number = {"type": "number", "minimum": -most, "maximum": most}
            other = {"type": "null"} if self.non_finite == "null" else {"type": "string", "enum": list(_WORDS)}
            return {"anyOf": [number, other]}
        return {"type": "boolean"} if kind.typename == "boolean" else self._integer_schema(kind.typename, sent=sent)

    def _integer_schema(self, name: str, *, sent: bool) -> dict[str, Any]:
        lowest, highest = _range(name)
        if name not in {"int64", "uint64"} or self.integers == "number":
            return {"type": "integer", "minimum": lowest, "maximum": highest}
        # A pattern has no bounds: shorter numbers are all in range.
        digits = "{1,18}" if sent else "+"
        return {"type": "string", "pattern": f"^-?[0-9]{digits}$" if lowest else f"^[0-9]{digits}$"}


_BASE64 = "^(?:[A-Za-z0-9+/]{4})*(?:[A-Za-z0-9+/]{2}==|[A-Za-z0-9+/]{3}=)?$"


def parsed(text: bytes | str) -> Any:
    """Return JSON that RFC 8259 allows, without literals like NaN.

    Raises:
        RefusedError: it is none.
    """

    def refuse(literal: str) -> Any:
        raise RefusedError(f"{literal} is not JSON")

    try:
        return json.loads(text, parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise RefusedError(f"the body is not JSON: {error}") from error


def interface(name: str) -> Any:
    """Return the class of `package/msg/Name`, `package/srv/Name` or `package/action/Name`."""
    package, folder, kind = name.split("/")
    return getattr(importlib.import_module(f"{package}.{folder}"), kind)


def _octets(kind: AbstractNestedType) -> bool:
    return isinstance(kind.value_type, BasicType) and kind.value_type.typename in {"uint8", "octet"}


def _range(name: str) -> tuple[int, int]:
    if name in {"octet", "char"}:
        return 0, 255
    bits = int("".join(filter(str.isdigit, name)))
    return (0, 2**bits - 1) if name.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
