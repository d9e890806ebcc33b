"""Enumerate where a generated mutant can be: the fields of requests and responses in a pack's descriptions."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from lxml import etree

from conformance.contract.classes import Interface
from conformance.contract.generic import generic_classes
from conformance.contract.pack import Contract
from conformance.documents import wsdl
from conformance.documents.json_schema import Schema, kind_of
from conformance.documents.openapi import PARAMETER, Body, Operation, is_json, is_xml, operations_of
from conformance.documents.representation import flat
from conformance.documents.xsd_shapes import Complex, Element
from proof.mutation.changes import soap
from proof.mutation.messages import Request
from proof.mutation.self_test import self_test_of

ITEM = "[]"
_NUMBERS = {"double", "float", "decimal"}
_INTEGERS = {"int", "unsignedInt", "integer", "long", "short"}


@dataclass(frozen=True)
class Exchange:
    """One operation of the device over one interface.

    Attributes:
        name: operationId, or the operation's name in the WSDL.
        side: "rest" or "soap".
        method: HTTP method.
        path: pattern of its path with a group for each parameter; empty for SOAP.
        parameters: names of its path parameters.
        classes: conformance classes of the pack that read its messages, the operation's own class first.
        statuses: statuses that the description declares.
        formats: media types of a successful response.
        clause: the clause of the contract that it keeps, where the pack names one.
    """

    name: str
    side: str
    method: str
    path: str
    parameters: tuple[str, ...]
    classes: tuple[str, ...]
    statuses: tuple[int, ...]
    formats: tuple[str, ...]
    clause: str = ""

    @property
    def class_(self) -> str:
        """Return the conformance class that the operation belongs to."""
        return self.classes[0]

    def concerns(self, request: Request) -> bool:
        """Return whether a request is for this operation."""
        if self.side == "soap":
            return soap(self.name)(request)
        return (
            request.side == "rest"
            and request.method == self.method
            and re.fullmatch(self.path, request.path) is not None
        )


@dataclass(frozen=True)
class Place:
    """A field of an operation's request or response.

    Attributes:
        exchange: the operation.
        part: "answer" (the response) or "request".
        medium: notation of the message: json, xml, soap, path or query.
        steps: names from the message's root to the field, ``[]`` for the items of a list.
        kind: number, integer, boolean, string, object or array.
        siblings: names of the other fields of the same kind in the same object.
        required: whether the description requires the field.
        example: the description's example value, or None.
    """

    exchange: Exchange
    part: str
    medium: str
    steps: tuple[str, ...]
    kind: str
    siblings: tuple[str, ...] = ()
    required: bool = True
    example: str | float | bool | None = None

    @property
    def label(self) -> str:
        """Return the field's part of a mutant's name, such as ``answer.position.x``."""
        return ".".join((self.part, *self.steps)).replace("." + ITEM, ITEM)


def classes_of(contract: Contract, operation: str, interface: Interface) -> tuple[str, ...]:
    """Return the conformance classes whose checks read an operation's messages, the operation's own class first.

    A pack may name them (SelfTest.classes). Otherwise they are the pack's own classes that judge the interface,
    followed
    by those that judge the description; for a pack without own classes, all that judge the interface.
    """
    if said := self_test_of(contract).classes_of(operation):
        return said
    there = [name for name, class_ in contract.classes.items() if interface in class_.interfaces]
    own = [name for name in there if name not in generic_classes()]
    return (*own, *(name for name in there if name == "describe")) if own else tuple(there) or tuple(contract.classes)


@cache
def exchanges(contract: Contract) -> tuple[Exchange, ...]:
    """Return every operation of a contract, REST before SOAP."""
    found = [rest_exchange(contract, operation) for operation in operations_of(contract)]
    for interface, description in _services(contract):
        for operation in description.operations:
            classes = classes_of(contract, operation.name, interface)
            clause = self_test_of(contract).clause_of(operation.name)
            found.append(Exchange(operation.name, "soap", "POST", "", (), classes, (200,), ("text/xml",), clause))
    return tuple(found)


def _services(contract: Contract) -> Iterator[tuple[Interface, wsdl.Wsdl]]:
    for interface, path in (
        (Interface.PUBLISHERS, contract.publishers_path),
        (Interface.SUBSCRIBERS, contract.subscribers_path),
    ):
        if path is not None:
            yield interface, wsdl.read_file(path)


def rest_exchange(contract: Contract, operation: Operation, base: str = "") -> Exchange:
    """Return the exchange of an operation below a base path."""
    parts = PARAMETER.split(base + operation.template)
    pattern = "".join(re.escape(part) if i % 2 == 0 else "([^/]*)" for i, part in enumerate(parts))
    statuses = [
        status
        for key in operation.responses
        for status in ((200, 204) if key.upper() == "2XX" else (int(key),) if key.isdigit() else ())
    ]
    return Exchange(
        operation.id,
        "rest",
        operation.method,
        pattern,
        tuple(parts[1::2]),
        classes_of(contract, operation.id, Interface.REST),
        tuple(statuses),
        tuple(operation.formats),
        self_test_of(contract).clause_of(operation.id),
    )


@cache
def places(contract: Contract) -> tuple[Place, ...]:
    """Return every field of every operation, once for each notation that the contract describes."""
    by_name = {exchange.name: exchange for exchange in exchanges(contract)}
    found: list[Place] = []
    for operation in operations_of(contract):
        exchange = by_name[operation.id]
        body = next((body for name, body in operation.bodies.items() if is_json(name)), None)
        for medium, is_medium in (("json", is_json), ("xml", is_xml)):
            if operation.shape is not None and any(map(is_medium, operation.formats)):
                found += _of_schema(exchange, "answer", medium, operation.shape)
        for medium, is_medium in (("json", is_json), ("xml", is_xml)):
            if body is not None and any(map(is_medium, operation.bodies)):
                found += _of_schema(exchange, "request", medium, body.schema, _example(body))
        for where in ("path", "query"):
            found += _of_parameters(exchange, operation, where)
    for _, description in _services(contract):
        found += _of_wsdl(description, by_name)
    return tuple(found)


def _example(body: Body) -> Any:
    return next((example for example in body.examples if not isinstance(example, str)), None)


def _of_parameters(exchange: Exchange, operation: Operation, where: str) -> Iterator[Place]:
    group = operation.parameter(where)
    for parameter in group:
        kind = kind_of(parameter.schema)
        beside = [item for item in group if item is not parameter and kind_of(item.schema) == kind]
        names = tuple(item.name for item in beside)
        yield Place(exchange, "request", where, (parameter.name,), kind, names, parameter.required)


def _of_schema(exchange: Exchange, part: str, medium: str, schema: Schema, example: Any = None) -> Iterator[Place]:
    for steps, item, siblings, required in _walk(schema, ()):
        value = example
        for step in steps:
            value = value.get(step) if isinstance(value, dict) else None
        known = value if isinstance(value, str | int | float) else None
        yield Place(exchange, part, medium, steps, kind_of(item), siblings, required, known)


def fields_of(exchange: Exchange, schema: Schema) -> Iterator[tuple[Place, Schema]]:
    """Yield each member of the JSON responses of a schema, with its own schema."""
    for steps, item, siblings, required in _walk(schema, ()):
        yield Place(exchange, "answer", "json", steps, kind_of(item), siblings, required), item


def _walk(schema: Schema, steps: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Schema, tuple[str, ...], bool]]:
    """Yield for each field in a schema its path, its schema, its siblings' names and whether it is required."""
    schema = flat(schema)
    properties: dict[str, Schema] = {name: flat(item) for name, item in schema.get("properties", {}).items()}
    for name, item in properties.items():
        siblings = tuple(other for other in properties if other != name and kind_of(properties[other]) == kind_of(item))
        yield (*steps, name), item, siblings, name in schema.get("required", ())
        yield from _walk(item, (*steps, name))
    items = schema.get("items")
    if isinstance(items, dict):
        yield from _walk(items, (*steps, ITEM))


def _of_wsdl(description: wsdl.Wsdl, by_name: dict[str, Exchange]) -> Iterator[Place]:
    for operation in description.operations:
        for part, tag in (("request", operation.request), ("answer", operation.response)):
            declared = description.shape(tag) if tag else None
            if declared is not None:
                yield from _of_element(by_name[operation.name], part, declared, ())


def _of_element(exchange: Exchange, part: str, parent: Element, steps: tuple[str, ...]) -> Iterator[Place]:
    children = parent.children
    for child in children:
        name = etree.QName(child.tag).localname
        many = child.maximum is None or child.maximum > 1
        kind = "array" if many else _kind(child)
        siblings = tuple(
            etree.QName(other.tag).localname
            for other in children
            if other is not child and _kind(other) == kind and other.maximum == 1
        )
        yield Place(exchange, part, "soap", (*steps, name), kind, siblings, child.minimum > 0)
        yield from _of_element(exchange, part, child, (*steps, name, *((ITEM,) if many else ())))


def _kind(element: Element) -> str:
    if isinstance(element.type, Complex):
        return "object"
    builtin = element.type.builtin
    return "number" if builtin in _NUMBERS else "integer" if builtin in _INTEGERS else "string"
