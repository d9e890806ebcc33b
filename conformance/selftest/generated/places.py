"""Where a mutant can be: the fields of what is asked and answered, enumerated from the contract's files."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from lxml import etree

from conformance.contract.pack import Contract
from conformance.documents import wsdl
from conformance.documents.json_schema import Schema, kind_of
from conformance.documents.openapi import PARAMETER, Operation, operations_of
from conformance.documents.xsd_shapes import Complex, Element
from conformance.mutation.changes import soap
from conformance.mutation.messages import Request

ITEM = "[]"
_NUMBERS = {"double", "float", "decimal"}
_INTEGERS = {"int", "unsignedInt", "integer", "long", "short"}


@dataclass(frozen=True)
class Exchange:
    """One operation of the robot, over one interface.

    Attributes:
        name: operationId, or the name in the WSDL.
        side: "rest" or "soap".
        method: of HTTP.
        path: matches its path, and names the parameters in it; empty for SOAP.
        service: "publishers" or "subscribers" for SOAP, else empty.
        class_: the conformance class that it belongs to.
        statuses: what the description declares.
        formats: media types of a successful answer.
    """

    name: str
    side: str
    method: str
    path: str
    service: str
    class_: str
    statuses: tuple[int, ...]
    formats: tuple[str, ...]

    def concerns(self, request: Request) -> bool:
        """Whether a request is for this operation."""
        if self.side == "soap":
            return soap(self.name)(request)
        return (
            request.side == "rest"
            and request.method == self.method
            and re.fullmatch(self.path, request.path) is not None
        )


@dataclass(frozen=True)
class Place:
    """A field.

    Attributes:
        exchange: the operation.
        part: "answer" or "request".
        medium: how it is written: json, xml, soap, path or query.
        steps: names from the top, ``[]`` for the items of a list.
        kind: number, integer, string, object or array.
        siblings: names of the fields beside it that have the same kind, itself left out.
        required: whether it has to be there.
    """

    exchange: Exchange
    part: str
    medium: str
    steps: tuple[str, ...]
    kind: str
    siblings: tuple[str, ...] = ()
    required: bool = True

    @property
    def label(self) -> str:
        """Its name in that of a mutant, as ``answer.pose.pose.position.x``."""
        return ".".join((self.part, *self.steps)).replace("." + ITEM, ITEM)


@cache
def exchanges() -> tuple[Exchange, ...]:
    """Every operation of the contract, REST's first."""
    contract = Contract.load()
    found = [_rest(operation) for operation in operations_of(contract)]
    for service, path in (("publishers", contract.publishers_path), ("subscribers", contract.subscribers_path)):
        if path is not None:
            class_ = "soap-delivery" if service == "publishers" else "soap-subscribers"
            found += [
                Exchange(operation.name, "soap", "POST", "", service, class_, (200,), ("text/xml",))
                for operation in wsdl.read_file(path).operations
            ]
    return tuple(found)


def _rest(operation: Operation) -> Exchange:
    parts = PARAMETER.split(operation.template)
    pattern = "".join(re.escape(part) if i % 2 == 0 else f"(?P<{part}>[^/]*)" for i, part in enumerate(parts))
    statuses = [200 if key == "2XX" else int(key) for key in operation.responses if key.isdigit() or key == "2XX"]
    class_ = "rest-delivery" if "elivery" in operation.template and "app" in operation.template else "rest-resources"
    return Exchange(
        operation.id, "rest", operation.method, pattern, "", class_, tuple(statuses), tuple(operation.formats)
    )


@cache
def places() -> tuple[Place, ...]:
    """Every field of every operation, in every form in which the contract has it."""
    contract = Contract.load()
    by_name = {exchange.name: exchange for exchange in exchanges()}
    found: list[Place] = []
    for operation in operations_of(contract):
        exchange = by_name[operation.id]
        if operation.shape is not None:
            found += _of_schema(exchange, "answer", "json", operation.shape)
            found += _of_schema(exchange, "answer", "xml", operation.shape)
        body = operation.bodies.get("application/json")
        if body is not None:
            found += _of_schema(exchange, "request", "json", body.schema)
            found += _of_schema(exchange, "request", "xml", body.schema)
        for where in ("path", "query"):
            group = operation.parameter(where)
            for parameter in group:
                kind = kind_of(parameter.schema)
                beside = [item for item in group if item is not parameter and kind_of(item.schema) == kind]
                names = tuple(item.name for item in beside)
                found.append(Place(exchange, "request", where, (parameter.name,), kind, names, parameter.required))
    for path in (contract.publishers_path, contract.subscribers_path):
        if path is not None:
            found += _of_wsdl(wsdl.read_file(path), by_name)
    return tuple(found)


def _of_schema(exchange: Exchange, part: str, medium: str, schema: Schema) -> Iterator[Place]:
    for steps, item, siblings, required in _walk(schema, ()):
        yield Place(exchange, part, medium, steps, kind_of(item), siblings, required)


def _walk(schema: Schema, steps: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Schema, tuple[str, ...], bool]]:
    """Steps, schema, siblings and whether it is required, for each field below a schema."""
    properties: dict[str, Any] = schema.get("properties", {})
    for name, item in properties.items():
        siblings = tuple(other for other in properties if other != name and kind_of(properties[other]) == kind_of(item))
        yield (*steps, name), item, siblings, name in schema.get("required", ())
        yield from _walk(item, (*steps, name))
    items = schema.get("items")
    if isinstance(items, dict) and "properties" in items:
        yield from _walk(items, (*steps, ITEM))


def _of_wsdl(description: wsdl.Description, by_name: dict[str, Exchange]) -> Iterator[Place]:
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
