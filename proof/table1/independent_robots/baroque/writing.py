"""Write values in three formats, each in a valid but unusual notation."""

import json
from typing import Any

import yaml
from lxml import etree

from proof.table1.independent_robots.plain.server import Answer

_ROOTS = {"Sensors": "sensor_list", "NavigationServices": "services", "Deliveries": "history"}


def as_json(value: Any) -> bytes:
    """Return JSON: indented, keys in reverse order, characters escaped, floats with an exponent."""
    return _json(value, "\n").encode()


def _json(value: Any, indent: str) -> str:
    if isinstance(value, dict):
        inner = f",{indent}\t".join(
            f"{json.dumps(key)} : {_json(part, indent + chr(9))}" for key, part in reversed(value.items())
        )
        return f"{{{indent}\t{inner}{indent}}}"
    if isinstance(value, list):
        return "[ " + " , ".join(_json(part, indent + "\t") for part in value) + " ]"
    if isinstance(value, float):
        # 17 significant digits give every double back.
        return f"{value:.16E}"
    return json.dumps(value)


def as_xml(root: str, value: Any, *, namespace: str = "") -> bytes:
    """Return XML with comments and CDATA; items of an array are nested under its field."""
    top = etree.Element(
        f"{{{namespace}}}{root}" if namespace else _ROOTS.get(root, root), nsmap={"unused": "urn:example:unused"}
    )
    fill(top, value, namespace)
    top.insert(0, etree.Comment(" from a robot "))
    return etree.tostring(top, xml_declaration=True, encoding="UTF-8")


def fill(element: Any, value: Any, namespace: str = "", *, nested: bool = True) -> None:
    """Put a value into an lxml element; without ``nested``, array items repeat their field's element."""
    if isinstance(value, dict):
        for key, part in value.items():
            parts = part if isinstance(part, list) and not nested else [part]
            for item in parts:
                fill(
                    etree.SubElement(element, f"{{{namespace}}}{key}" if namespace else key),
                    item,
                    namespace,
                    nested=nested,
                )
    elif isinstance(value, list):
        for item in value:
            fill(etree.SubElement(element, "element"), item, namespace, nested=nested)
    elif isinstance(value, str):
        text = "".join(
            char if char in "\t\n\r" or (char >= " " and char not in "\ufffe\uffff") else "?" for char in value
        )
        # A carriage return would not survive in CDATA (XML 1.0 2.11).
        element.text = text if "\r" in text or "]]>" in text or not text else etree.CDATA(text)
    elif isinstance(value, float):
        element.text = f"\n{value:.16E} "
    else:
        element.text = f" +{value} " if isinstance(value, int) and value >= 0 else str(value)


def as_text(value: Any) -> bytes:
    """Return YAML, in flow style where it is short, with the marker that ros2 topic echo prints after each message."""
    text: str = yaml.safe_dump(value, default_flow_style=None, sort_keys=True, width=60, allow_unicode=False)
    return f"{text}---\n".encode()


def problem(status: int, detail: str, *, xml: bool = False) -> Answer:
    """Return an error response with every member that RFC 9457 defines."""
    value = {
        "type": f"/problems/{status}",
        "title": "Nothing came of it",
        "status": status,
        "detail": detail,
        "instance": "/robot/troubles/1",
        "advice": "see the manual",
    }
    if xml:
        body, media_type = as_xml("problem", value, namespace="urn:ietf:rfc:7807"), "application/problem+xml"
    else:
        body, media_type = as_json(value), "application/problem+json; charset=utf-8"
    return Answer(status, body, media_type, {"vary": "accept"})
