"""Write JSON and XML, also texts that no library would write."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from lxml import etree

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
    return json.dumps(value, ensure_ascii=False)


def _object(members: Iterable[tuple[str, Any]]) -> str:
    return "{" + ", ".join(f"{json.dumps(name, ensure_ascii=False)}: {json_text(item)}" for name, item in members) + "}"


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
