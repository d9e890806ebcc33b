"""Read a WSDL and the documents it refers to: names, operations, and the types of messages.

Schemas may be inline or imported, by relative or absolute locations, and the description may be split by wsdl:import,
as JAX-WS RI does if interface and service have different namespaces.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

from lxml import etree

from conformance.documents.wsdl_imports import Collected, Fetch, collect
from conformance.documents.xml_names import WSAM, WSAW, WSDL, WSDL_SOAP, clark
from conformance.documents.xsd import SchemaError, Types
from conformance.documents.xsd_assembly import SchemaDocument
from conformance.documents.xsd_shapes import Element

_ACTIONS: Final = tuple(clark(space, "Action") for space in (WSAM, WSAW, "http://www.w3.org/2005/08/addressing"))


class DescriptionError(ValueError):
    """Raised for a WSDL that describes no service; the message says what is missing."""


@dataclass(frozen=True)
class Operation:
    """One operation of a WSDL.

    Attributes:
        name: name in the port type.
        request: tag of the request's element in Clark notation; None if the message names none.
        response: tag of the response's element; None for a one-way operation.
        input_action: wsam:Action of the input, or None; output_action: of the output.
        messages: local names of the input and output messages.
        parts: names of the parts of the input and the output message.
    """

    name: str
    request: str | None
    response: str | None
    input_action: str | None = None
    output_action: str | None = None
    messages: tuple[str, ...] = ()
    parts: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Description:
    """One service as its WSDL describes it.

    Attributes:
        definitions: the wsdl:definitions elements, that of the requested document first.
        schemas: all schema documents.
        missing: referenced documents that could not be fetched, with the reason.
    """

    definitions: tuple[etree._Element, ...]
    schemas: tuple[SchemaDocument, ...]
    missing: tuple[tuple[str, str], ...] = ()

    def all(self, path: str) -> list[etree._Element]:
        """Return the elements of all definitions that match an XPath; prefix ``w`` is WSDL, ``s`` its SOAP binding."""
        spaces = {"w": WSDL, "s": WSDL_SOAP}
        found: list[etree._Element] = []
        for root in self.definitions:
            result = root.xpath(path, namespaces=spaces)
            found += [item for item in result if etree.iselement(item)] if isinstance(result, list) else []
        return found

    @property
    def target_namespace(self) -> str:
        """The target namespace of the definitions with the port type."""
        for element in self.all("w:portType"):
            parent = element.getparent()
            return (parent.get("targetNamespace") or "") if parent is not None else ""
        return self.definitions[0].get("targetNamespace") or ""

    @cached_property
    def binding(self) -> etree._Element:
        """The SOAP/HTTP binding that a port uses, otherwise the first binding.

        Raises:
            DescriptionError: there is no binding.
        """
        bindings = {name(element): element for element in self.all("w:binding[s:binding]")}
        for port in self.all("w:service/w:port[s:address]"):
            bound = bindings.get(_local(port.get("binding")))
            if bound is not None:
                return bound
        for element in bindings.values():
            return element
        raise DescriptionError("no wsdl:binding with a soap:binding")

    @cached_property
    def port_type(self) -> etree._Element:
        """The port type of the binding.

        Raises:
            DescriptionError: there is no port type.
        """
        wanted = _local(self.binding.get("type"))
        for element in self.all("w:portType"):
            if name(element) == wanted:
                return element
        raise DescriptionError(f"a binding of the port type {wanted!r}, which is not there")

    @property
    def ports(self) -> list[etree._Element]:
        """The ports that use the binding."""
        bound = name(self.binding)
        return [port for port in self.all("w:service/w:port[s:address]") if _local(port.get("binding")) == bound]

    @cached_property
    def operations(self) -> tuple[Operation, ...]:
        """The operations of the port type.

        Raises:
            DescriptionError: there is no port type.
        """
        return tuple(self._operation(element) for element in self.port_type.findall(clark(WSDL, "operation")))

    @cached_property
    def types(self) -> Types:
        """The compiled schemas.

        Raises:
            SchemaError: they do not compile.
        """
        return Types.compiled(self.schemas)

    def shape(self, tag: str) -> Element | None:
        """Return the global element with a tag, or None.

        Raises:
            SchemaError: the schemas do not compile.
        """
        return self.types.shape(tag)

    def message(self, reference: str | None) -> etree._Element | None:
        """Return the wsdl:message of a QName, by its local name only, or None."""
        wanted = _local(reference)
        return next((element for element in self.all("w:message") if name(element) == wanted), None)

    def _operation(self, element: etree._Element) -> Operation:
        tags: list[str | None] = []
        actions: list[str | None] = []
        messages: list[str] = []
        parts: list[tuple[str, ...]] = []
        for direction in ("input", "output"):
            part = element.find(clark(WSDL, direction))
            message = self.message(part.get("message")) if part is not None else None
            declared = message.findall(clark(WSDL, "part")) if message is not None else []
            tags.append(qname(declared[0], declared[0].get("element")) if declared else None)
            actions.append(
                next((part.get(key) for key in _ACTIONS if part.get(key)), None) if part is not None else None
            )
            if message is not None:
                messages.append(name(message))
                parts.append(tuple(name(item) for item in declared))
        return Operation(name(element), tags[0], tags[1], actions[0], actions[1], tuple(messages), tuple(parts))


def name(element: etree._Element) -> str:
    """Return the name attribute, or empty."""
    return element.get("name") or ""


def qname(element: etree._Element, written: str | None) -> str | None:
    """Return a QName in an attribute in Clark notation; None if it is missing or its prefix is not declared."""
    if not written:
        return None
    prefix, _, local = written.strip().rpartition(":")
    space = element.nsmap.get(prefix or None)
    return None if prefix and space is None else clark(space, local)


def _local(written: str | None) -> str:
    return (written or "").strip().rpartition(":")[2]


def describe(wsdl: bytes, location: str, fetch: Fetch) -> Description:
    """Read a WSDL and the documents it refers to.

    Args:
        wsdl: the document.
        location: its URL or file name, the base of relative references.
        fetch: returns a further document by its resolved location.

    Raises:
        DescriptionError: it is not a WSDL.
    """
    try:
        found: Collected = collect(wsdl, location, fetch)
    except ValueError as error:
        raise DescriptionError(str(error)) from error
    return Description(tuple(found.definitions), tuple(found.schemas), tuple(found.missing.items()))


def read_file(path: Path) -> Description:
    """Return the description in a file of the contract.

    Raises:
        DescriptionError: it is not a WSDL, or refers to missing files.
    """

    def fetch(location: str) -> bytes:
        return Path(location).read_bytes()

    description = describe(path.read_bytes(), str(path), fetch)
    for place, reason in description.missing:
        raise DescriptionError(f"{path} refers to {place}: {reason}")
    return description


def faults(description: Description) -> Iterator[str]:
    """Yield why a description cannot be used: no binding, no port type, no operations, invalid schemas."""
    try:
        if not description.operations:
            yield "a port type without operations"
    except DescriptionError as error:
        yield str(error)
    try:
        _ = description.types
    except SchemaError as error:
        yield f"schemas that do not compile: {error}"
