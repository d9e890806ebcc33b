"""Read and alter one field of one message in place, in JSON, in XML, in a path or in a query."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from typing import Any, Protocol
from urllib.parse import parse_qsl, quote, unquote, urlencode

from lxml import etree

from proof.mutation.messages import Request, Response
from proof.selftest.generated.places import ITEM, Place

_AGAIN = "@again@"  # prefix for the name of a member that is written twice
_NUMERIC = {"number", "integer"}


class UnusualError(ValueError):
    """A message that would change by being parsed and written again; no mutant alters it."""


class Slot(Protocol):
    """A field that is present in a message."""

    def value(self) -> Any:
        """Return the field's value: a number, a text, or a copy of an object or list."""

    def put(self, value: Any) -> None:
        """Replace the value; None writes null."""

    def drop(self) -> None:
        """Remove the field from the message."""

    def rename(self, name: str) -> None:
        """Replace the field's name."""

    def double(self) -> None:
        """Write the field a second time."""

    def beside(self, name: str) -> Slot | None:
        """Return the field of that name in the same object, or None."""


class JsonSlot:
    """A member of a JSON object, or a parameter of a path or query."""

    def __init__(self, container: dict[str, Any], name: str) -> None:
        self._container, self._name = container, name

    def value(self) -> Any:
        """Return the member's value, copied."""
        return copy.deepcopy(self._container[self._name])

    def put(self, value: Any) -> None:
        """Replace the member's value."""
        self._container[self._name] = value

    def drop(self) -> None:
        """Remove the member."""
        del self._container[self._name]

    def rename(self, name: str) -> None:
        """Replace the member's name."""
        self._container[name] = self._container.pop(self._name)

    def double(self) -> None:
        """Write the member's name twice into the object."""
        self._container[_AGAIN + self._name] = self._container[self._name]

    def beside(self, name: str) -> JsonSlot | None:
        """Return another member of the same object, or None."""
        return JsonSlot(self._container, name) if name in self._container else None


class TextSlot(JsonSlot):
    """A parameter of a path or query, whose text may be a number."""

    def __init__(self, container: dict[str, Any], name: str, kind: str) -> None:
        super().__init__(container, name)
        self._kind = kind

    def value(self) -> Any:
        """Return the parameter as a number where its text is one, else as text."""
        return _read(self._container[self._name], self._kind)

    def put(self, value: Any) -> None:
        """Replace the parameter's text."""
        self._container[self._name] = text_of(value)

    def beside(self, name: str) -> TextSlot | None:
        """Return another parameter of the same target, or None."""
        return TextSlot(self._container, name, self._kind) if name in self._container else None


class XmlSlot:
    """The child elements of one name below one element: several where the field is a list."""

    def __init__(self, parent: etree._Element, nodes: list[etree._Element], kind: str) -> None:
        self._parent, self._nodes, self._kind = parent, nodes, kind

    def value(self) -> Any:
        """Return the elements' value, as JSON would have it."""
        if self._kind == "array":
            return [copy.deepcopy(node) for node in self._nodes]
        node = self._nodes[0]
        return copy.deepcopy(node) if self._kind == "object" else _read(node.text or "", self._kind)

    def put(self, value: Any) -> None:
        """Replace the elements' content."""
        if isinstance(value, list):
            at = self._parent.index(self._nodes[0])
            tail = [copy.deepcopy(node) for node in value]
            for node in self._nodes:
                self._parent.remove(node)
            for offset, node in enumerate(tail):
                self._parent.insert(at + offset, node)
            return
        for node in self._nodes:
            if etree.iselement(value):
                node[:] = [copy.deepcopy(child) for child in value]
                node.text = value.text
            else:
                node[:] = []
                node.text = text_of(value)

    def drop(self) -> None:
        """Remove the elements."""
        for node in self._nodes:
            self._parent.remove(node)

    def rename(self, name: str) -> None:
        """Replace the elements' local name."""
        for node in self._nodes:
            node.tag = etree.QName(etree.QName(node).namespace, name).text

    def double(self) -> None:
        """Write the elements a second time."""
        for node in self._nodes:
            node.addnext(copy.deepcopy(node))

    def beside(self, name: str) -> XmlSlot | None:
        """Return the sibling elements of that name, or None."""
        nodes = _children(self._parent, name)
        return XmlSlot(self._parent, nodes, self._kind) if nodes else None


def _read(text: str, kind: str) -> Any:
    """Return the text as a number where the field is a number and the text is one; else the text."""
    if kind in _NUMERIC:
        try:
            return int(text) if kind == "integer" else float(text)
        except ValueError:
            return text
    return text


def text_of(value: Any) -> str:
    """Return a value as text for XML, paths and queries."""
    if value is None:
        return ""
    return repr(value) if isinstance(value, float) else str(value)


def same(one: Any, other: Any) -> bool:
    """Return whether two values of a field are equal: numbers by value, all else by their text."""
    if etree.iselement(one) or etree.iselement(other):
        both = etree.iselement(one) and etree.iselement(other)
        return both and bool(etree.tostring(one, with_tail=False) == etree.tostring(other, with_tail=False))
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    numbers = isinstance(one, int | float) and isinstance(other, int | float)
    return bool(one == other) and (numbers or type(one) is type(other))


Edit = Callable[[list[Slot]], bool]


def edit_message(place: Place, message: Request | Response, edit: Edit) -> bool:
    """Alter the field in a message, and return whether the message changed.

    A message that cannot be parsed, or that parsing and writing would change (a name twice, a DTD), stays as it is.
    """
    try:
        if isinstance(message, Request) and place.medium in {"path", "query"}:
            return _in_target(place, message, edit)
        if place.medium == "json":
            return _in_json(place, message, edit)
        return _in_xml(place, message, edit)
    except (UnusualError, RecursionError, etree.XMLSyntaxError, KeyError, TypeError, IndexError, OverflowError):
        return False


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) != len(pairs):
        raise UnusualError
    return made


def _no_constant(name: str) -> Any:
    raise UnusualError(name)


def _in_json(place: Place, message: Request | Response, edit: Edit) -> bool:
    if not message.media_type.endswith("json"):
        return False
    try:
        value = json.loads(message.body, object_pairs_hook=_unique, parse_constant=_no_constant)
    except ValueError as error:
        raise UnusualError from error
    slots = [JsonSlot(item, place.steps[-1]) for item in _objects(value, place.steps[:-1]) if place.steps[-1] in item]
    if not slots or not edit(list(slots)):
        return False
    message.body = json.dumps(value).replace(f'"{_AGAIN}', '"').encode()
    return True


def _objects(value: Any, steps: tuple[str, ...]) -> list[dict[str, Any]]:
    found = [value]
    for step in steps:
        if step == ITEM:
            found = [item for one in found if isinstance(one, list) for item in one]
        else:
            found = [one[step] for one in found if isinstance(one, dict) and step in one]
    return [one for one in found if isinstance(one, dict)]


def _in_xml(place: Place, message: Request | Response, edit: Edit) -> bool:
    if "xml" not in message.media_type:
        return False
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=isinstance(message, Response))
    try:
        root = etree.fromstring(message.body, parser)
    except ValueError as error:
        raise UnusualError from error
    information: Any = root.getroottree().docinfo
    if information.doctype:
        raise UnusualError
    parents = [root]
    if place.medium == "soap":
        parents = [wrapper for body in _children(root, "Body") for wrapper in _children(body, "")]
    for step in place.steps[:-1]:
        parents = (
            _items(parents) if step == ITEM else [element for parent in parents for element in _children(parent, step)]
        )
    found = [(parent, _children(parent, place.steps[-1])) for parent in parents]
    if place.kind == "array" and place.medium == "xml":
        # A list may be nested in one element of the field's name.
        found = [
            (nodes[0], _children(nodes[0], "")) if _is_nested(nodes) else (parent, nodes) for parent, nodes in found
        ]
    slots = [XmlSlot(parent, nodes, place.kind) for parent, nodes in found if nodes]
    if not slots or not edit(list(slots)):
        return False
    message.body = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return True


def _children(parent: etree._Element, name: str) -> list[etree._Element]:
    """Return the child elements with a local name; all, where the name is empty."""
    elements = [node for node in parent if isinstance(node.tag, str)]
    return [node for node in elements if not name or etree.QName(node).localname == name]


def _is_nested(nodes: list[etree._Element]) -> bool:
    return len(nodes) == 1 and len({child.tag for child in nodes[0]}) == 1


def _items(parents: list[etree._Element]) -> list[etree._Element]:
    """Return the items of lists, whether each is an element of its own or nested in one list element."""
    found: list[etree._Element] = []
    for parent in parents:
        found += _children(parent, "") if _is_nested([parent]) and len(parent) else [parent]
    return found


def _in_target(place: Place, request: Request, edit: Edit) -> bool:
    name = place.steps[0]
    if place.medium == "query":
        given = dict(parse_qsl(request.query, keep_blank_values=True))
        if name not in given or not edit([TextSlot(given, name, place.kind)]):
            return False
        request.target = f"{request.path}?{urlencode({key.replace(_AGAIN, ''): item for key, item in given.items()})}"
        return True
    found = re.fullmatch(place.exchange.path, request.path)
    if found is None:
        return False
    names = place.exchange.parameters
    parameters = {key: unquote(item) for key, item in zip(names, found.groups(), strict=True)}
    if not edit([TextSlot(parameters, name, place.kind)]):
        return False
    path = request.path
    for number, key in reversed(list(enumerate(names, start=1))):
        start, end = found.span(number)
        path = path[:start] + quote(parameters[key], safe="+-.,") + path[end:]
    request.target = path + (f"?{request.query}" if request.query else "")
    return True
