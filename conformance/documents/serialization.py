"""Write parameters and form bodies as OpenAPI's styles say (OpenAPI 3.1, 4.8.12.2 and 4.8.15.1)."""

from collections.abc import Mapping
from typing import Any
from urllib.parse import quote, urlencode

from conformance.documents.writing import json_text, text_of

_SEPARATORS = {"spaceDelimited": " ", "pipeDelimited": "|"}
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
    return ",".join(texts)


def query_pairs(name: str, value: Any, style: str = "form", *, explode: bool = True) -> list[tuple[str, str]]:
    """Return the (name, text) pairs of a query parameter or cookie, not percent-encoded."""
    if isinstance(value, dict):
        if style == "deepObject":
            return [(f"{name}[{key}]", text_of(item)) for key, item in value.items()]
        if explode:
            return [(key, text_of(item)) for key, item in value.items()]
        return [(name, ",".join(_members(value, ",")))]
    if isinstance(value, list):
        if explode and style not in _SEPARATORS:
            return [(name, _plain(item)) for item in value]
        return [(name, _SEPARATORS.get(style, ",").join(map(_plain, value)))]
    return [(name, _plain(value))]


def query_text(pairs: list[tuple[str, str]]) -> str:
    """Return a query string, percent-encoded."""
    return "&".join(f"{quote(name, safe='[]')}={quote(text, safe=',|')}" for name, text in pairs)


def header_text(value: Any, *, explode: bool = False) -> str:
    """Return a header parameter's value (style simple)."""
    return ",".join(_members(value, "=" if explode else ","))


def form_body(value: dict[str, Any], encoding: Mapping[str, tuple[str, bool]]) -> bytes:
    """Return the members of an object as ``application/x-www-form-urlencoded``; encoding: their style and explode."""
    pairs: list[tuple[str, str]] = []
    for name, item in value.items():
        style, explode = encoding.get(name, ("form", True))
        pairs += query_pairs(name, item, style, explode=explode)
    return urlencode(pairs).encode()


def multipart_body(value: dict[str, Any]) -> tuple[str, bytes]:
    """Return the Content-Type and the bytes of an object as ``multipart/form-data`` (RFC 7578).

    A member of type bytes is sent as a file.
    """
    parts: list[bytes] = []
    for name, item in value.items():
        for one in item if isinstance(item, list) else [item]:
            is_file = isinstance(one, bytes)
            content = one if isinstance(one, bytes) else _plain(one).encode()
            head = f'Content-Disposition: form-data; name="{name}"' + ('; filename="roaas.bin"' if is_file else "")
            head += "\r\nContent-Type: application/octet-stream" if is_file else ""
            parts.append(f"--{_BOUNDARY}\r\n{head}\r\n\r\n".encode() + content + b"\r\n")
    return f"multipart/form-data; boundary={_BOUNDARY}", b"".join(parts) + f"--{_BOUNDARY}--\r\n".encode()


def _plain(value: Any) -> str:
    """Return an item as text; what is no scalar becomes JSON, and null becomes empty."""
    if value is None:
        return ""
    return json_text(value) if isinstance(value, dict | list) else text_of(value)


def _members(value: Any, between: str) -> list[str]:
    """Return the texts of an array's items or an object's members, or the text of a scalar."""
    if isinstance(value, dict):
        return [f"{key}{between}{_plain(item)}" for key, item in value.items()]
    return [_plain(item) for item in value] if isinstance(value, list) else [_plain(value)]
