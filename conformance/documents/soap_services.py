"""Read any WSDL 1.1: its ports over HTTP, SOAP 1.1 or 1.2, document or rpc style, and the types of their messages.

An rpc message has a wrapper that no schema declares (WSDL 1.1, 3.5). One is made for it, so that its messages are built
and validated as all others are.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from lxml import etree

from conformance.commandline.device_options import advice
from conformance.documents.addressing import addressing_action, is_http, wants_addressing
from conformance.documents.wsdl_gaps import gaps
from conformance.documents.wsdl_imports import Fetch, Locate, collect
from conformance.documents.xml_names import ENVELOPE, WSDL, WSDL_SOAP, XSD, clark
from conformance.documents.xsd import SchemaError, Types
from conformance.documents.xsd_assembly import SchemaDocument, rpc_wrapper
from conformance.documents.xsd_shapes import too_large
from conformance.transport.reach import server_of

ENVELOPE_12: Final = "http://www.w3.org/2003/05/soap-envelope"
_WSDL_SOAP_12: Final = "http://schemas.xmlsoap.org/wsdl/soap12/"
_SPACES: Final = {WSDL_SOAP: ENVELOPE, _WSDL_SOAP_12: ENVELOPE_12}
_MULTIPART, _PART, _CONTENT = (
    f"{{http://schemas.xmlsoap.org/wsdl/mime/}}{name}" for name in ("multipartRelated", "part", "content")
)
_PREFIXES: Final = {"w": WSDL, "xs": XSD}
_CONTROL: Final = re.compile(r"[\x00-\x1f\x7f]")


class WsdlError(ValueError):
    """Raised for a WSDL that describes no service that can be called; the message says what is missing."""


@dataclass(frozen=True)
class SoapOperation:
    """One operation of a port.

    Attributes:
        name: in the port type.
        action: soapAction, or empty.
        request: tag of the request's element, in Clark notation; empty: the Body is empty.
        response: tag of the response's element; None for a one-way operation.
        remark: why it cannot be called, or empty.
        headers: tags of the header blocks that its messages have (WSDL 1.1, 3.7).
        addressed: the WS-Addressing action, if its messages must have WS-Addressing's header blocks; else empty.
    """

    name: str
    action: str
    request: str
    response: str | None
    remark: str = ""
    headers: tuple[str, ...] = ()
    addressed: str = ""


@dataclass(frozen=True)
class SoapPort:
    """One port.

    Attributes:
        service, name: its names.
        url: soap:address.
        envelope: namespace of SOAP 1.1 or 1.2.
        operations: in the binding's order.
    """

    service: str
    name: str
    url: str
    envelope: str
    operations: tuple[SoapOperation, ...]

    @property
    def is_12(self) -> bool:
        """Whether it speaks SOAP 1.2."""
        return self.envelope == ENVELOPE_12


@dataclass(frozen=True)
class SoapDescription:
    """What a WSDL describes.

    Attributes:
        name: of the definitions or the first service.
        ports: those over HTTP.
        types: the compiled schemas.
        faults: what is wrong with the WSDL itself: documents that are missing, references without a target.
        notes: what the suite does not know of the WSDL, through no fault of the device.
        foreign: whether the WSDL is not the device's own, as that of a standard.
    """

    name: str
    ports: tuple[SoapPort, ...]
    types: Types
    faults: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    foreign: bool = False


def read_services(
    wsdl: bytes, location: str, fetch: Fetch, address: str = "", locate: Locate = lambda _: "", *, foreign: bool = False
) -> SoapDescription:
    """Read a WSDL and what it refers to.

    Args:
        wsdl: the document.
        location: its URL or file.
        fetch: loads the documents that it refers to.
        address: where the service is, whatever the WSDL says; a standard's WSDL (ONVIF) says nothing or an example.
        locate: returns where the schema of a namespace is to which no reference led.
        foreign: whether the WSDL is not the device's own, as that of a standard: its faults are then notes.

    Raises:
        WsdlError: it is none, has no port over HTTP, or its schemas do not compile.
    """
    try:
        found = collect(wsdl, location, fetch, locate)
    except ValueError as error:
        raise WsdlError(f"{location} is no WSDL, but {error}") from error
    reader = _Reader(found.definitions)
    ports = tuple(reader.ports())
    if address:
        ports = tuple(replace(port, url=address) for port in ports) or tuple(reader.bindings(address))
    if not ports:
        how = advice(" with --base-url", ", as in [api] base_url of a statement")
        raise WsdlError(f"{location} has no port over HTTP: name the address of the service{how}")
    calls = [(f"{one.name} of port {port.name}", one) for port in ports for one in port.operations]
    named = [(who, tag) for who, one in calls for tag in (one.request, one.response) if tag]
    try:
        types = Types.compiled([*found.schemas, *reader.wrappers])
        faults, notes = gaps(found, types, location, named)
    except SchemaError as error:
        raise WsdlError(f"the schemas of {location} do not compile: {error}") from error
    ports = tuple(replace(port, operations=tuple(_bounded(port.operations, types))) for port in ports)
    name = found.definitions[0].get("name") or ports[0].service
    faults, notes = ([], [*notes, *faults, *reader.faults]) if foreign else ([*faults, *reader.faults], notes)
    return SoapDescription(name, ports, types, tuple(dict.fromkeys(faults)), tuple(dict.fromkeys(notes)), foreign)


def _bounded(operations: tuple[SoapOperation, ...], types: Types) -> Iterator[SoapOperation]:
    for one in operations:
        yield replace(one, remark=one.remark or too_large(types.shape(one.request)))


class _Reader:
    """Reads definitions elements; ``wrappers`` are the schemas made for rpc, ``faults`` what refers to nothing."""

    def __init__(self, definitions: list[etree._Element]) -> None:
        self._definitions = definitions
        self.wrappers: list[SchemaDocument] = []
        self.faults: list[str] = []
        self._made: set[str] = set()
        self._by_name: dict[str, dict[str, etree._Element]] = {}

    def _all(self, path: str) -> list[etree._Element]:
        found: list[etree._Element] = []
        for root in self._definitions:
            result = root.xpath(path, namespaces=_PREFIXES)
            found += [one for one in result if etree.iselement(one)] if isinstance(result, list) else []
        return found

    def _named(self, path: str, reference: etree._Element, attribute: str) -> etree._Element | None:
        """Return what a QName in an attribute refers to."""
        wanted = _qname(reference, reference.get(attribute) or "")
        if path not in self._by_name:
            self._by_name[path] = {  # of two with one name the first counts
                clark(one.getroottree().getroot().get("targetNamespace") or "", one.get("name") or ""): one
                for one in reversed(self._all(path))
            }
        if wanted in self._by_name[path]:
            return self._by_name[path][wanted]
        self.faults.append(f"{attribute} of {reference.get('name') or 'a port'} names {wanted}, which is not there")
        return None

    def ports(self) -> Iterator[SoapPort]:
        """Yield the ports over HTTP."""
        for port in self._all("w:service/w:port"):
            address = next((one for space in _SPACES for one in port.iterfind(clark(space, "address"))), None)
            url = address.get("location", "") if address is not None else ""
            if not is_http(url):
                if url.startswith("http"):
                    self.faults.append(f"the address of port {port.get('name')} is no URL: {url}")
                continue
            binding = self._named("w:binding", port, "binding")
            service = port.getparent()
            if binding is not None:
                of = service.get("name", "") if service is not None else ""
                yield from self._port(binding, of, port.get("name", ""), url, port)

    def bindings(self, address: str) -> Iterator[SoapPort]:
        """Yield each SOAP binding as a port at an address."""
        for binding in self._all("w:binding"):
            yield from self._port(binding, "", binding.get("name", ""), address)

    def _port(
        self, binding: etree._Element, service: str, name: str, url: str, port: etree._Element | None = None
    ) -> Iterator[SoapPort]:
        soap, kind = _soap(binding, "binding"), self._named("w:portType", binding, "type")
        if soap is not None and kind is not None:
            envelope = _SPACES[etree.QName(soap).namespace or ""]
            operations = tuple(self._operations(binding, soap, kind))
            if not wants_addressing(
                [binding, *([] if port is None else [port])], self._all("//*[local-name()='Policy']")
            ):
                operations = tuple(replace(one, addressed="") for one in operations)
            yield SoapPort(service, name, url, envelope, operations)

    def _operations(
        self, binding: etree._Element, soap: etree._Element, kind: etree._Element
    ) -> Iterator[SoapOperation]:
        abstract = {one.get("name"): one for one in kind.iterfind(clark(WSDL, "operation"))}
        for bound in binding.iterfind(clark(WSDL, "operation")):
            name, own = bound.get("name", ""), _soap(bound, "operation")
            declared = abstract.get(bound.get("name"))
            if declared is None:
                self.faults.append(f"the binding has the operation {name}, which its port type has not")
                continue
            style = (own.get("style") if own is not None else None) or soap.get("style") or "document"
            tags: dict[str, str] = {}
            remark = ""
            for way in ("input", "output"):
                message = declared.find(clark(WSDL, way))
                if message is None:
                    continue
                part = bound.find(clark(WSDL, way))
                body = _soap(part, "body") if part is not None else None
                if way == "input" and part is not None and part.find(f".//{_CONTENT}") is not None:
                    remark = "its request has attachments, which the suite does not make"
                if body is not None and body.get("use") == "encoded":
                    remark = "its messages are encoded (WS-I BP R2706 allows literal alone)"
                    break
                tags[way] = self._tag(message, style, name if way == "input" else f"{name}Response", part)
            action = (own.get("soapAction") if own is not None else None) or ""
            if _CONTROL.search(action):
                remark = "its soapAction has a control character, which no header field can have"
            headers = tuple(self._headers(bound))
            addressed = addressing_action(declared, kind, action)
            yield SoapOperation(name, action, tags.get("input", ""), tags.get("output"), remark, headers, addressed)

    def _headers(self, bound: etree._Element) -> Iterator[str]:
        """Yield the tags of the header blocks of a request (WSDL 1.1, 3.7)."""
        for block in [
            one for space in _SPACES for one in bound.iterfind(f"{clark(WSDL, 'input')}/{clark(space, 'header')}")
        ]:
            message = self._named("w:message", block, "message")
            for part in message.iterfind(clark(WSDL, "part")) if message is not None else ():
                if part.get("name") == block.get("part") and part.get("element"):
                    yield _qname(part, part.get("element") or "")

    def _tag(self, reference: etree._Element, style: str, wrapper: str, bound: etree._Element | None) -> str:
        """Return the tag of a message's element; empty if the Body is empty."""
        body = _soap(bound, "body") if bound is not None else None
        message = self._named("w:message", reference, "message")
        parts = list(message.iterfind(clark(WSDL, "part"))) if message is not None else []
        listed = body.get("parts") if body is not None else None
        if listed is not None:
            parts = [part for part in parts if part.get("name") in listed.split()]
        elif bound is not None and len(parts) > 1:
            blocks = {one.get("part") for one in bound.iter("{*}header")}
            parts = [part for part in parts if part.get("name") not in blocks]
        if style == "rpc":
            return self._wrapper(wrapper, (body.get("namespace") if body is not None else None) or "", parts)
        element = parts[0].get("element") if parts else None
        return _qname(parts[0], element) if element else ""

    def _wrapper(self, name: str, space: str, parts: list[etree._Element]) -> str:
        """Make a schema with the wrapper of an rpc message; return its tag."""
        tag = clark(space, name)
        if tag in self._made:
            return tag
        self._made.add(tag)
        types = [_qname(part, part.get("type") or "") if part.get("type") else clark(XSD, "anyType") for part in parts]
        names = [part.get("name", "") for part in parts]
        self.wrappers.append(rpc_wrapper(name, space, list(zip(names, types, strict=True))))
        return tag


def _soap(parent: etree._Element, name: str) -> etree._Element | None:
    # SOAP with attachments has the body inside a mime:part (WSDL 1.1, 5.9).
    tags = [clark(space, name) for space in _SPACES]
    found = (parent.find(f"{place}{tag}") for tag in tags for place in ("", f"{_MULTIPART}/{_PART}/"))
    return next((one for one in found if one is not None), None)


def _qname(element: etree._Element, text: str) -> str:
    """Return a QName in an attribute in Clark notation."""
    prefix, colon, name = text.strip().rpartition(":")
    return clark(element.nsmap.get(prefix if colon else None), name)


def base_of(description: SoapDescription) -> str:
    """Return scheme and host of the first port."""
    return server_of(description.ports[0].url)
