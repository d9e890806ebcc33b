"""Write JSON and XML, also texts that no library would write."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote, urlencode

from lxml import etree

from conformance.documents.parameters import Encoding
from conformance.documents.xml import elements


@dataclass(frozen=True)
class Token:
    """A piece of JSON text that is written verbatim: ``NaN``, ``1e400``, ``0x1``."""

    text: str


@dataclass(frozen=True)
class Pairs:
    """An object as a list of (name, value) pairs, in which a name may occur twice."""

    members: tuple[tuple[str, Any], ...]


def json_text(value: Any) -> str:
    """Return a value as JSON text; it may contain Token and Pairs."""
    if isinstance(value, Token):
        return value.text
    if isinstance(value, Pairs):
        return _object(value.members)
    if isinstance(value, dict):
        return _object(value.items())
    if isinstance(value, list):
        return "[" + ", ".join(json_text(item) for item in value) + "]"
    return _scalar(value)


def _scalar(value: Any) -> str:
    """Return a JSON scalar; half a surrogate pair, which UTF-8 does not have, as its escape (RFC 8259 7)."""
    text = json.dumps(value, ensure_ascii=False)
    return json.dumps(value) if any("\ud800" <= one <= "\udfff" for one in text) else text


def _object(members: Iterable[tuple[str, Any]]) -> str:
    return "{" + ", ".join(f"{_scalar(name)}: {json_text(item)}" for name, item in members) + "}"


def xml_bytes(value: Any, root: str, like: etree._Element | None = None) -> bytes:
    """Return a value as XML: one child per member, one child per array item.

    Args:
        value: JSON value, which may contain Pairs for duplicate elements and Token for verbatim text.
        root: name of the root element.
        like: an element from the robot with such a value, whose namespace and order are copied; or None.
    """
    namespace = etree.QName(like).namespace if like is not None else None
    element = etree.Element(etree.QName(namespace, root), nsmap={None: namespace} if namespace else None)  # type: ignore[dict-item] # lxml's own default prefix
    _fill(element, value, like)
    return etree.tostring(element, encoding="utf-8", xml_declaration=True)


def _fill(element: etree._Element, value: Any, like: etree._Element | None) -> None:
    if isinstance(value, dict | Pairs):
        members = list(value.items() if isinstance(value, dict) else value.members)
        patterns = {etree.QName(child).localname: child for child in (elements(like) if like is not None else ())}
        order = {name: index for index, name in enumerate(patterns)}
        members.sort(key=lambda member: order.get(member[0], len(order)))
        for name, item in members:
            pattern = patterns.get(name)
            namespace = etree.QName(pattern if pattern is not None else element).namespace
            for one in item if isinstance(item, list) else [item]:
                _fill(etree.SubElement(element, etree.QName(namespace, name)), one, pattern)
    elif value is not None:
        element.text = text_of(value)


def text_of(value: Any) -> str:
    """Return a scalar as text for XML, a path or a query."""
    if isinstance(value, Token):
        return value.text
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return ",".join(text_of(item) for item in value)
    return str(value)


#: Separators between items, for styles without a comma. ``tabDelimited`` is Swagger 2.0's tsv.
SEPARATORS = {"spaceDelimited": " ", "pipeDelimited": "|", "tabDelimited": "\t"}
# Reserved characters that no server takes for the end of a parameter (RFC 3986 2.2).
_RESERVED = "/?:@!$'()*,"
# Escapes in a quoted name (RFC 7578 2, WHATWG multipart/form-data).
_IN_QUOTES = str.maketrans({'"': "%22", "\r": "%0D", "\n": "%0A"})
_BOUNDARY = "roaas-7d1f0c"


def path_text(value: Any, style: str = "simple", name: str = "", *, explode: bool = False) -> str:
    """Return a path parameter's value, percent-encoded, in the styles simple, label and matrix."""
    members = _members(value, "=" if explode else ",")
    texts = [quote(text, safe=",=") if isinstance(value, dict) else quote(text, safe="") for text in members]
    if style == "label":
        return "." + ("." if explode else ",").join(texts)
    if style == "matrix":
        if explode and isinstance(value, dict):
            return "".join(f";{text}" for text in texts)
        many = isinstance(value, list) and explode
        return "".join(f";{name}={text}" for text in texts) if many else f";{name}={','.join(texts)}"
    return quote(SEPARATORS.get(style, ","), safe=",").join(texts)


def query_pairs(name: str, value: Any, style: str = "form", *, explode: bool = True) -> list[tuple[str, str]]:
    """Return the (name, text) pairs of a query parameter or cookie, not percent-encoded."""
    if isinstance(value, dict):
        if style == "deepObject":
            return [(f"{name}[{key}]", _plain(item)) for key, item in value.items()]
        if explode:
            return [(key, _plain(item)) for key, item in value.items()]
        between = SEPARATORS.get(style, ",")
        return [(name, between.join(_members(value, between)))]
    if isinstance(value, list):
        if explode and style not in SEPARATORS:
            return [(name, _plain(item)) for item in value]
        return [(name, SEPARATORS.get(style, ",").join(map(_plain, value)))]
    return [(name, _plain(value))]


def query_text(pairs: list[tuple[str, str]], reserved: frozenset[str] = frozenset()) -> str:
    """Return a query string, percent-encoded; reserved: names of parameters that keep reserved characters."""
    return "&".join(
        f"{quote(name, safe='')}={quote(text, safe=_RESERVED if name in reserved else ',')}" for name, text in pairs
    )


def header_text(value: Any, style: str = "simple", *, explode: bool = False) -> str:
    """Return a header parameter's value (style simple, or one of Swagger 2.0)."""
    return SEPARATORS.get(style, ",").join(_members(value, "=" if explode else ","))


def form_body(value: dict[str, Any], encoding: Mapping[str, Encoding]) -> bytes:
    """Return the members of an object as ``application/x-www-form-urlencoded``."""
    pairs: list[tuple[str, str]] = []
    for name, item in value.items():
        how = encoding.get(name, Encoding())
        if how.media_type.endswith("json"):
            pairs.append((name, json_text(item)))
        else:
            pairs += query_pairs(name, item, how.style, explode=how.explode)
    return urlencode(pairs).encode()


def multipart_body(value: dict[str, Any], encoding: Mapping[str, Encoding] | None = None) -> tuple[str, bytes]:
    """Return the Content-Type and the bytes of an object as ``multipart/form-data`` (RFC 7578).

    A member of type bytes is sent as a file, an object as JSON, and each item of a list as a part of its own.
    """
    parts: list[bytes] = []
    for name, item in value.items():
        given = (encoding or {}).get(name, Encoding()).media_type
        for octets in item if isinstance(item, list) and not given.endswith("json") else [item]:
            is_file = isinstance(octets, bytes)
            as_json = isinstance(octets, dict | list) or given.endswith("json")
            content = (
                octets if isinstance(octets, bytes) else (json_text(octets) if as_json else _plain(octets)).encode()
            )
            usual = "application/octet-stream" if is_file else "application/json" if as_json else ""
            media_type = given if given and "*" not in given else usual
            head = f'Content-Disposition: form-data; name="{name.translate(_IN_QUOTES)}"'
            head += '; filename="roaas.bin"' if is_file else ""
            head += f"\r\nContent-Type: {media_type}" if media_type else ""
            parts.append(f"--{_BOUNDARY}\r\n{head}\r\n\r\n".encode() + content + b"\r\n")
    return f"multipart/form-data; boundary={_BOUNDARY}", b"".join(parts) + f"--{_BOUNDARY}--\r\n".encode()


def _plain(value: Any) -> str:
    """Return an item as text: JSON for objects and lists, empty for null."""
    if value is None:
        return ""
    return json_text(value) if isinstance(value, dict | list) else text_of(value)


def _members(value: Any, between: str) -> list[str]:
    """Return the texts of an array's items or an object's members, or the text of a scalar."""
    if isinstance(value, dict):
        return [f"{key}{between}{_plain(item)}" for key, item in value.items()]
    return [_plain(item) for item in value] if isinstance(value, list) else [_plain(value)]
