"""A field of one message at hand, to be read and altered, whether it stands in JSON, XML, a path or a query."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from typing import Any, Protocol
from urllib.parse import parse_qsl, quote, unquote, urlencode

from lxml import etree

from conformance.mutation.messages import Request, Response
from conformance.selftest.generated.places import ITEM, Place

# Stands before the name of a member that is to be written twice.
_AGAIN = "@again@"
_NUMERIC = {"number", "integer"}


class UnusualError(ValueError):
    """A message that a reader and a writer would make another one of: it is left alone."""


class Slot(Protocol):
    """A field that is there."""

    def value(self) -> Any:
        """What it holds: a number, a text, or a copy of all that is in it."""

    def put(self, value: Any) -> None:
        """Give it another value, None for none."""

    def drop(self) -> None:
        """Take it out."""

    def rename(self, name: str) -> None:
        """Give it another name."""

    def double(self) -> None:
        """Write it a second time."""

    def beside(self, name: str) -> Slot | None:
        """The field of that name beside it."""


class JsonSlot:
    """A member of a JSON object, or of the parameters of a target."""

    def __init__(self, container: dict[str, Any], name: str) -> None:
        self._container, self._name = container, name

    def value(self) -> Any:
        """See Slot."""
        return copy.deepcopy(self._container[self._name])

    def put(self, value: Any) -> None:
        """See Slot."""
        self._container[self._name] = value

    def drop(self) -> None:
        """See Slot."""
        del self._container[self._name]

    def rename(self, name: str) -> None:
        """See Slot."""
        self._container[name] = self._container.pop(self._name)

    def double(self) -> None:
        """See Slot."""
        self._container[_AGAIN + self._name] = self._container[self._name]

    def beside(self, name: str) -> JsonSlot | None:
        """See Slot."""
        return JsonSlot(self._container, name) if name in self._container else None


class TextSlot(JsonSlot):
    """A parameter of a target, whose value is a text that may say a number."""

    def __init__(self, container: dict[str, Any], name: str, kind: str) -> None:
        super().__init__(container, name)
        self._kind = kind

    def value(self) -> Any:
        """See Slot."""
        return _read(self._container[self._name], self._kind)

    def put(self, value: Any) -> None:
        """See Slot."""
        self._container[self._name] = written(value)

    def beside(self, name: str) -> TextSlot | None:
        """See Slot."""
        return TextSlot(self._container, name, self._kind) if name in self._container else None


class XmlSlot:
    """Elements of one name below one element: several, where it is a list."""

    def __init__(self, parent: etree._Element, nodes: list[etree._Element], kind: str) -> None:
        self._parent, self._nodes, self._kind = parent, nodes, kind

    def value(self) -> Any:
        """See Slot."""
        if self._kind == "array":
            return [copy.deepcopy(node) for node in self._nodes]
        node = self._nodes[0]
        return copy.deepcopy(node) if self._kind == "object" else _read(node.text or "", self._kind)

    def put(self, value: Any) -> None:
        """See Slot."""
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
                node.text = written(value)

    def drop(self) -> None:
        """See Slot."""
        for node in self._nodes:
            self._parent.remove(node)

    def rename(self, name: str) -> None:
        """See Slot."""
        for node in self._nodes:
            node.tag = etree.QName(etree.QName(node).namespace, name).text

    def double(self) -> None:
        """See Slot."""
        for node in self._nodes:
            node.addnext(copy.deepcopy(node))

    def beside(self, name: str) -> XmlSlot | None:
        """See Slot."""
        nodes = _children(self._parent, name)
        return XmlSlot(self._parent, nodes, self._kind) if nodes else None


def _read(text: str, kind: str) -> Any:
    """A number where the field is one and the text says so; else the text."""
    if kind in _NUMERIC:
        try:
            return int(text) if kind == "integer" else float(text)
        except ValueError:
            return text
    return text


def written(value: Any) -> str:
    """A value as XML and targets have it."""
    if value is None:
        return ""
    return repr(value) if isinstance(value, float) else str(value)


def same(one: Any, other: Any) -> bool:
    """Whether no reader could tell two values of a field apart: numbers by value, the rest by what is written."""
    if etree.iselement(one) or etree.iselement(other):
        both = etree.iselement(one) and etree.iselement(other)
        return both and bool(etree.tostring(one, with_tail=False) == etree.tostring(other, with_tail=False))
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    numbers = isinstance(one, int | float) and isinstance(other, int | float)
    return bool(one == other) and (numbers or type(one) is type(other))


Edit = Callable[[list[Slot]], bool]


def edit_message(place: Place, message: Request | Response, edit: Edit) -> bool:
    """Alter the place in a message. Returns whether anything became another.

    What cannot be read as this medium, or would not survive reading and writing (a name twice, a DTD), stays as it is.
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
        parents = _items(parents) if step == ITEM else [one for parent in parents for one in _children(parent, step)]
    found = [(parent, _children(parent, place.steps[-1])) for parent in parents]
    if place.kind == "array" and place.medium == "xml":
        # A list may be nested in one element of the field's name.
        found = [(nodes[0], _children(nodes[0], "")) if _nested(nodes) else (parent, nodes) for parent, nodes in found]
    slots = [XmlSlot(parent, nodes, place.kind) for parent, nodes in found if nodes]
    if not slots or not edit(list(slots)):
        return False
    message.body = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return True


def _children(parent: etree._Element, name: str) -> list[etree._Element]:
    """Children with a local name; all, where it is empty."""
    elements = [node for node in parent if isinstance(node.tag, str)]
    return [node for node in elements if not name or etree.QName(node).localname == name]


def _nested(nodes: list[etree._Element]) -> bool:
    return len(nodes) == 1 and len({child.tag for child in nodes[0]}) == 1


def _items(parents: list[etree._Element]) -> list[etree._Element]:
    """The items of lists that are written as one element each, or nested in one."""
    found: list[etree._Element] = []
    for parent in parents:
        found += _children(parent, "") if _nested([parent]) and len(parent) else [parent]
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
