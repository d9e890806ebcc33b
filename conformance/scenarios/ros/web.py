"""How the values of ROS messages are written on the web, and whether a web's value is that of a message.

Numbers on the web are decimal (RFC 8259 6), so a value is judged by its digits, not by what a double makes of them.
What the map leaves open is accepted.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
import re
import struct
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import quote

from conformance.documents.xml import NotXmlError, elements, local, parse
from conformance.documents.xsd_shapes import value_of
from conformance.scenarios.ros.definition import FLOATS, INTEGERS, LONG, Definition, Shape, put_at, value_at
from conformance.statement.ros_map import Body, Calls, RosMap
from conformance.transport.exchange import Attempt, Exchange

_SHOWN: Final = 80
#: A request that fails after more than _SOON_MS may have timed out on a busy machine: it is sent up to TRIES times.
_SOON_MS, TRIES = 1000.0, 3
_UUID: Final = 16
#: Non-finite numbers as strings: in JSON if the map says so, in XML by XML Schema (3.2.5).
_NAMES: Final = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf, "INF": math.inf, "-INF": -math.inf}
_NUMBER: Final = re.compile(r"\s*[-+]?[0-9.]+([eE][-+]?[0-9]+)?\s*")
_MISSING: Final = object()
#: Statuses, and SOAP's fault codes, for a request that is refused because of what it says.
_REFUSED: Final = {HTTPStatus.BAD_REQUEST, HTTPStatus.UNPROCESSABLE_ENTITY}
_CLIENT: Final = re.compile(rb"[:>](Client|Sender)\b[^<]*</")


@dataclass(frozen=True)
class Difference:
    """A field whose value on the web is not that of the ROS message.

    Attributes:
        at: the field, as a JSON pointer in the ROS message.
        declared: its type.
        web, ros: its value on either side, for readers.
    """

    at: str
    declared: str
    web: str
    ros: str


@dataclass(frozen=True)
class Document:
    """The value in a body.

    Attributes:
        value: JSON with its numbers as they are written, or the first element in a SOAP Body; None if it is neither.
        is_xml: whether it is XML, in which each value is a text.
    """

    value: Any
    is_xml: bool = False


def is_success(attempt: Attempt, body: Body) -> bool:
    """Return whether a response is 2xx, and reports no failure by the map."""
    if not isinstance(attempt, Exchange) or not attempt.response.ok:
        return False
    value, failure = document_of(attempt.response.body).value, body.failure
    if isinstance(body, Calls) and body.state is not None:
        return value_at(value, body.state.at) in body.state.succeeded
    return failure is None or value_at(value, failure.at) not in failure.values


def is_out_of_range(attempt: Attempt, body: Body) -> bool:
    """Return whether a request was refused as the client's fault: its values may be beyond a limit that no type has."""
    if not isinstance(attempt, Exchange) or is_success(attempt, body):
        return False
    status, octets = attempt.response.status, attempt.response.body
    return status in _REFUSED or (status == HTTPStatus.INTERNAL_SERVER_ERROR and _CLIENT.search(octets) is not None)


def gave_up(attempt: Attempt | None, body: Body) -> bool:
    """Return whether a request failed after a while, because its deadline passed on a busy machine."""
    is_late = isinstance(attempt, Exchange) and attempt.response.elapsed_ms > _SOON_MS
    return attempt is not None and is_late and not is_success(attempt, body)


def content_of(exchange: Exchange, body: Body) -> str:
    """Return what a response has in the message's place, as text."""
    return str(value_at(document_of(exchange.response.body).value, body.at))


def document_of(octets: bytes) -> Document:
    """Return the value in a body. Never raises."""
    if octets.lstrip()[:1] == b"<":
        try:
            root = parse(octets)
        except NotXmlError:
            return Document(None, is_xml=True)
        bodies = [element for element in elements(root) if local(str(element.tag)) == "Body"]
        return Document(
            next((value_of(element) for part in bodies for element in elements(part)), value_of(root)), is_xml=True
        )
    try:
        return Document(json.loads(octets, parse_float=Decimal))
    except (ValueError, RecursionError):
        return Document(None)


def document_for(value: dict[str, Any], definition: Definition, body: Body, ros: RosMap) -> Any:
    """Return the request document for sending a message, in the map's form or plain JSON; None if it has no body."""
    message = _web(value, Shape(definition.root), definition, ros)
    if body.places:
        mapped: Any = {}
        for web, own in body.fields.items():
            mapped = put_at(mapped, web, value_at(message, own))
        message = mapped
        if not (body.fields or body.body):
            return None
    return _merge(body.body, put_at({}, body.at, message))


def parameters_for(value: dict[str, Any], body: Body) -> dict[str, str]:
    """Return the parameters of a path or query that sends a message."""
    found = {name: value_at(value, own) for name, own in body.in_url.items()}
    return {name: quote(one if isinstance(one, str) else json.dumps(one), "") for name, one in found.items()}


def fields_in(message: dict[str, Any], body: Body) -> dict[str, Any]:
    """Return the fields of a ROS message that an operation's request has."""
    found: dict[str, Any] = {}
    for own in body.places:
        found = put_at(found, own, value_at(message, own))
    return found if body.places else message


def is_finite(value: Any) -> bool:
    """Return whether no number in a message is NaN or an infinity."""
    if isinstance(value, dict | list):
        return all(map(is_finite, value.values() if isinstance(value, dict) else value))
    return not isinstance(value, float) or math.isfinite(value)


def with_texts(octets: bytes, body: Body) -> bytes:
    """Return a JSON body whose message has a text in place of each number, and an object in place of each text."""

    def text(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: text(item) for name, item in value.items()}
        return [text(item) for item in value] if isinstance(value, list) else {} if isinstance(value, str) else "x"

    document = json.loads(octets)
    return json.dumps(put_at(document, body.at, text(value_at(document, body.at)))).encode()


def _merge(one: Any, other: Any) -> Any:
    """Return an object with the members of two, where the second has precedence; the second if one is no object."""
    if isinstance(one, dict) and isinstance(other, dict) and one:
        return {name: _merge(one.get(name), other.get(name, one.get(name))) for name in (*one, *other)}
    return other


def _web(value: Any, shape: Shape, definition: Definition, ros: RosMap) -> Any:
    if shape.is_octets:
        return value["b64"] if ros.bytes == "base64" else list(base64.b64decode(value["b64"]))
    if shape.is_array:
        return [_web(item, Shape(shape.item), definition, ros) for item in value]
    if shape.is_message:
        fields = definition.fields(shape.item)
        return {name: _web(value[name], one, definition, ros) for name, one in fields if name in value}
    if shape.item in LONG and ros.integers == "string":
        return str(value)
    if shape.item in FLOATS and not math.isfinite(value):
        name = "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
        return {"null": None, "string": name}.get(ros.non_finite or "", value)
    return value


def differences(
    document: Document, value: dict[str, Any], definition: Definition, body: Body, ros: RosMap
) -> list[Difference]:
    """Return the fields in which a web's message is not a ROS message; empty if they are the same."""
    return list(differing(document, value, definition, body, ros))


def differing(
    document: Document, value: dict[str, Any], definition: Definition, body: Body, ros: RosMap
) -> Iterator[Difference]:
    """Yield the fields in which a web's message is not a ROS message.

    Args:
        document: that has the web's message.
        value: the value of the ROS message, with all fields.
        definition: the definition of its type.
        body: how the operation writes it.
        ros: how the gateway writes values.
    """
    judge, message = _Comparison(definition, ros, document.is_xml), value_at(document.value, body.at)
    if not body.fields:
        yield from judge.compare(message, value, Shape(definition.root), "")
    for web, own in body.fields.items():
        shape = definition.at(own)
        if shape is not None:
            yield from judge.compare(value_at(message, web, _MISSING), value_at(value, own), shape, own)


@dataclass(frozen=True)
class _Comparison:
    definition: Definition
    ros: RosMap
    is_xml: bool

    def compare(self, web: Any, own: Any, shape: Shape, at: str) -> Iterator[Difference]:
        """Yield the differences in a value and its parts."""
        if shape.is_octets:
            if not self._are_octets(web, base64.b64decode(own["b64"])):
                yield self._difference(at, shape, web, own["b64"])
        elif shape.is_array:
            yield from self._items(web, own, shape, at)
        elif shape.is_message:
            yield from self._fields(web, own, shape, at)
        elif not self._is(web, own, shape.item):
            yield self._difference(at, shape, web, own)

    def _fields(self, web: Any, own: Any, shape: Shape, at: str) -> Iterator[Difference]:
        if not isinstance(web, dict):
            yield self._difference(at, shape, web, own)
            return
        for name, field in self.definition.fields(shape.item):
            yield from self.compare(web.get(name, _MISSING), own[name], field, f"{at}/{name}")

    def _items(self, web: Any, own: list[Any], shape: Shape, at: str) -> Iterator[Difference]:
        if self.is_xml and not isinstance(web, list):
            # XML writes what repeats as often as it is there: not at all, or once.
            web = [] if web is _MISSING else [web]
        if not isinstance(web, list) or len(web) != len(own):
            yield self._difference(at, shape, web, own)
            return
        item = Shape(shape.item)
        for number, (one, other) in enumerate(zip(web, own, strict=True)):
            yield from self.compare(one, other, item, f"{at}/{number}")

    def _are_octets(self, web: Any, own: bytes) -> bool:
        form = self.ros.bytes
        if isinstance(web, list) and form != "base64":
            return len(web) == len(own) and all(map(self._is_whole, web, own))
        if not isinstance(web, str):
            return self.is_xml and web is _MISSING and not own
        if form == "array":
            return False
        try:
            if base64.b64decode(web, validate=True) == own:
                return True
        except (binascii.Error, ValueError):
            pass
        # A map that leaves open how octets are written leaves this open as well.
        return form is None and (web.lower() == own.hex() or (len(own) == _UUID and web == str(uuid.UUID(bytes=own))))

    def _is(self, web: Any, own: Any, item: str) -> bool:
        if item == "boolean":
            return web is own or (self.is_xml and web in ({"true", "1"} if own else {"false", "0"}))
        if item in INTEGERS:
            if item in LONG and isinstance(web, str) and not self.is_xml:
                return self.ros.integers != "number" and web == str(own)
            named = item in LONG and self.ros.integers == "string" and not self.is_xml
            return not named and self._is_whole(web, own)
        if item in FLOATS:
            return self._is_real(web, own, item)
        return bool(web == own) if isinstance(web, str) else self.is_xml and web is _MISSING and own == ""

    def _is_real(self, web: Any, own: float, item: str) -> bool:
        if not math.isfinite(own):
            return self._is_not_finite(web, own)
        try:
            number = float(Decimal(web)) if self._is_number(web) else math.nan
            return number == own or (item == "float" and struct.unpack("f", struct.pack("f", number))[0] == own)
        except (InvalidOperation, ValueError, OverflowError):
            return False

    def _is_not_finite(self, web: Any, own: float) -> bool:
        form = self.ros.non_finite
        if isinstance(web, str):
            named = _NAMES.get(web)
            if named is None:  # a map that leaves the form open leaves this open, if it is no other number
                return form is None and not (self.is_xml and _NUMBER.fullmatch(web))
            return form in {None, "string"} and _same(named, own)
        if isinstance(web, float):
            return form in {None, "literal"} and _same(web, own)
        return web is None and form in {None, "null"}

    def _is_number(self, web: Any) -> bool:
        return isinstance(web, str) if self.is_xml else isinstance(web, int | Decimal) and not isinstance(web, bool)

    def _is_whole(self, web: Any, own: int) -> bool:
        """Return whether a web's value is an integer: 5.0 is the number 5 (RFC 8259 6)."""
        return bool(web == str(own)) if self.is_xml else self._is_number(web) and bool(web == own)

    def _difference(self, at: str, shape: Shape, web: Any, own: Any) -> Difference:
        declared = f"{shape.item}[]" if shape.is_array else shape.item
        return Difference(at or "/", declared, _value_text(web), _value_text(own))


def _same(one: float, other: float) -> bool:
    return one == other or (math.isnan(one) and math.isnan(other))


def equal(own: Any, other: Any) -> bool:
    """Return whether a ROS message has all values of another one, which may lack fields; NaN equals NaN."""
    return next(changes(own, other), None) is None


def changes(own: Any, other: Any, at: str = "") -> Iterator[tuple[str, str, str]]:
    """Yield the differences between two ROS messages: field, own value, other value."""
    if isinstance(other, dict) and isinstance(own, dict) and "b64" not in other:
        for name, one in other.items():
            yield from changes(own.get(name, _MISSING), one, f"{at}/{name}")
    elif isinstance(other, list) and isinstance(own, list) and len(own) == len(other):
        for number, pair in enumerate(zip(own, other, strict=True)):
            yield from changes(*pair, f"{at}/{number}")
    elif not (own == other or (isinstance(own, float) and isinstance(other, float) and _same(own, other))):
        yield at or "/", _value_text(own), _value_text(other)


def _value_text(value: Any) -> str:
    if value is _MISSING:
        return "nothing"
    if isinstance(value, dict) and set(value) == {"b64"}:
        value = value["b64"]
    if isinstance(value, list) and not any(isinstance(item, list | dict) for item in value):
        text = f"[{', '.join(map(_value_text, value[:_SHOWN]))}]"
    else:
        text = str(value) if isinstance(value, Decimal) else repr(value)
    if len(text) <= _SHOWN:
        return text
    size = f" ({len(value)} items)" if isinstance(value, list) else f" ({len(text)} characters)"
    return f"{text[: _SHOWN - 20]}…{size}"
