"""Write a value as JSON, XML or YAML, and choose the format that the client accepts."""

import json
from typing import Any
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
