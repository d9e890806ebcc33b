"""Read any WSDL 1.1: ports for SOAP 1.1 or 1.2, operations of document or rpc style, and the types of their messages.

A description may be split by wsdl:import, and schemas may be inline or imported. An rpc message has a wrapper that no
schema declares (WSDL 1.1, 3.5). One is made for it, so that its messages are built and validated as all others are.
Services have addresses, and may demand WS-Addressing of requests.
"""

from __future__ import annotations

import re
import uuid
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from lxml import etree

from conformance.commandline.device_options import advice
from conformance.documents.wsdl_imports import Collected, Fetch, Locate, collect, gaps
from conformance.documents.xml import ADDRESSING, ENVELOPE, WSAM, WSAW, WSDL, WSDL_SOAP, XSD, Node, clark
from conformance.documents.xsd import SchemaError, Types
from conformance.documents.xsd_assembly import SchemaDocument, rpc_wrapper
from conformance.documents.xsd_shapes import Element, too_large
from conformance.transport.reach import server_of

ENVELOPE_12: Final = "http://www.w3.org/2003/05/soap-envelope"
_SPACES: Final = {WSDL_SOAP: ENVELOPE, "http://schemas.xmlsoap.org/wsdl/soap12/": ENVELOPE_12}
_MULTIPART, _PART, _CONTENT = (
    f"{{http://schemas.xmlsoap.org/wsdl/mime/}}{name}" for name in ("multipartRelated", "part", "content")
)
_PREFIXES: Final = {"w": WSDL, "s": WSDL_SOAP, "xs": XSD}
_DOCUMENTATION: Final = clark(WSDL, "documentation")
_ACTIONS: Final = tuple(clark(space, "Action") for space in (WSAM, WSAW, "http://www.w3.org/2005/08/addressing"))
_CONTROL: Final = re.compile(r"[\x00-\x1f\x7f]")


class WsdlError(ValueError):
    """Raised for a WSDL without a service that can be called; the message names what is missing."""


@dataclass(frozen=True)
class SoapOperation:
    """One operation of a port.

    Attributes:
        name: in the port type.
        action: soapAction, or empty.
        request: tag of the request's element, in Clark notation; empty if the Body is empty.
        response: tag of the response's element; None for a one-way operation.
        remark: why its messages cannot be made, or empty.
        headers: tags of the header blocks that its messages have (WSDL 1.1, 3.7).
        addressed: the WS-Addressing action, if its messages must have WS-Addressing's header blocks; else empty.
        input_action, output_action: wsam:Action of the input and of the output, or None.
        messages: local names of the input and output messages.
        parts: names of the parts of the input and the output message.
        faults: tags of the elements that its declared faults have in their detail.
        documentation: what its documentation element says.
    """

    name: str
    action: str
    request: str
    response: str | None
    remark: str = ""
    headers: tuple[str, ...] = ()
    addressed: str = ""
    input_action: str | None = None
    output_action: str | None = None
    messages: tuple[str, ...] = ()
    parts: tuple[tuple[str, ...], ...] = ()
    faults: frozenset[str] = frozenset()
    documentation: str = ""


@dataclass(frozen=True)
class SoapPort:
    """One port.

    Attributes:
        service, name: its names.
        url: address.
        envelope: namespace of SOAP 1.1 or 1.2.
        operations: in the binding's order.
        binding, port_type: the names of its binding and of its port type.
    """

    service: str
    name: str
    url: str
    envelope: str
    operations: tuple[SoapOperation, ...]
    binding: str = ""
    port_type: str = ""

    @property
    def is_12(self) -> bool:
        """Whether it speaks SOAP 1.2."""
        return self.envelope == ENVELOPE_12


@dataclass(frozen=True, eq=False)
class Wsdl:
    """A WSDL and the documents that it refers to; parts are read when they are needed.

    Attributes:
        documents: the WSDL and the documents that it refers to.
        location: its URL or file.
        address: where the service is, whatever the WSDL says; a standard's WSDL (ONVIF) says nothing or an example.
        foreign: whether it is not the device's own, as that of a standard: its faults are then notes.
    """

    documents: Collected
    location: str
    address: str = ""
    foreign: bool = False

    @property
    def documentation(self) -> str:
        """What the WSDL says of the whole service."""
        parts = (*self.definitions, *self.all("w:portType"), *self.all("w:service"))
        return " ".join(" ".join(part.findtext(_DOCUMENTATION, "").split()) for part in parts)

    @property
    def definitions(self) -> list[etree._Element]:
        """The wsdl:definitions elements, that of the requested document first."""
        return self.documents.definitions

    @property
    def schemas(self) -> list[SchemaDocument]:
        """The schema documents."""
        return self.documents.schemas

    @property
    def name(self) -> str:
        """The name of the definitions or of the first service."""
        return self.definitions[0].get("name") or self.ports[0].service

    @property
    def target_namespace(self) -> str:
        """The target namespace of the definitions with the port type."""
        return _space_of((self.all("w:portType") or self.definitions)[0])

    def all(self, path: str) -> list[etree._Element]:
        """Return the elements of all definitions that match an XPath; prefix ``w`` is WSDL, ``s`` its SOAP binding."""
        found: list[etree._Element] = []
        for root in self.definitions:
            result = root.xpath(path, namespaces=_PREFIXES)
            found += [element for element in result if etree.iselement(element)] if isinstance(result, list) else []
        return found

    @property
    def soap_address(self) -> str:
        """Return the first soap:address as written, even if the rest is broken; empty if there is none."""
        written = ((element.get("location") or "").strip() for element in self.all("//s:address"))
        return next(filter(None, written), "")

    def find(self, path: str, reference: etree._Element, attribute: str) -> etree._Element | None:
        """Return the component that a QName in an attribute refers to, or None."""
        return self._reader.find(path, reference, attribute)

    @cached_property
    def _reader(self) -> _Reader:
        return _Reader(self)

    @property
    def ports(self) -> tuple[SoapPort, ...]:
        """The ports over HTTP."""
        return self._reader.at(self.address) if self.address else self._reader.over_http

    @property
    def base(self) -> str:
        """Scheme and host of the first port over HTTP."""
        return server_of(self.ports[0].url)

    @cached_property
    def bound(self) -> tuple[SoapPort, ...]:
        """The SOAP 1.1 ports that share the first binding, whatever their address; without one, the first binding.

        Raises:
            WsdlError: there is no SOAP 1.1 binding whose port type is there.
        """
        known = [port for port in self._reader.ports if not port.is_12]
        known = known or [port for port in self._reader.bindings if not port.is_12][:1]
        if not known:
            raise WsdlError("; ".join(["no wsdl:binding with a soap:binding and a port type", *self._reader.faults]))
        return tuple(port for port in known if port.binding == known[0].binding)

    @property
    def operations(self) -> tuple[SoapOperation, ...]:
        """The operations of the first SOAP 1.1 binding.

        Raises:
            WsdlError: there is none.
        """
        return self.bound[0].operations

    @cached_property
    def types(self) -> Types:
        """The compiled schemas.

        Raises:
            SchemaError: they do not compile.
        """
        _ = self.ports, self._reader.ports  # which make wrappers
        return Types.compile([*self.schemas, *self._reader.wrappers])

    def shape(self, tag: str) -> Element | None:
        """Return the global element with a tag, or None.

        Raises:
            SchemaError: the schemas do not compile.
        """
        return self.types.shape(tag)

    def remark(self, operation: SoapOperation) -> str:
        """Return why an operation cannot be called, or an empty text."""
        return operation.remark or too_large(self.types.shape(operation.request))

    @property
    def faults(self) -> tuple[str, ...]:
        """Return the faults of the WSDL itself: missing documents, references without a target."""
        return () if self.foreign else self._faults_and_notes[0]

    @property
    def notes(self) -> tuple[str, ...]:
        """Parts of the WSDL that the suite does not support, which is no fault of the device."""
        faults, notes = self._faults_and_notes
        return (*notes, *(faults if self.foreign else ()))

    @cached_property
    def _faults_and_notes(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        calls = [
            (f"{operation.name} of port {port.name}", operation) for port in self.ports for operation in port.operations
        ]
        named = [(who, tag) for who, one in calls for tag in (one.request, one.response) if tag]
        faults, notes = gaps(self.documents, self.types, self.location, named)
        return tuple(dict.fromkeys([*faults, *self._reader.faults])), tuple(dict.fromkeys(notes))


class _Reader:
    """Reads definitions elements; ``wrappers`` are schemas made for rpc, ``faults`` are references without a target."""

    def __init__(self, wsdl: Wsdl) -> None:
        self._all = wsdl.all
        self.wrappers: list[SchemaDocument] = []
        self.faults: list[str] = []
        self._made: set[str] = set()
        self._by_name: dict[str, dict[str, etree._Element]] = {}

    def find(self, path: str, reference: etree._Element, attribute: str) -> etree._Element | None:
        """Return the component that a QName in an attribute refers to, or None."""
        if path not in self._by_name:
            self._by_name[path] = {  # of two parts with the same name, the first counts
                clark(_space_of(element), element.get("name") or ""): element for element in reversed(self._all(path))
            }
        return self._by_name[path].get(qname(reference, reference.get(attribute)) or "")

    def _target(self, path: str, reference: etree._Element, attribute: str) -> etree._Element | None:
        """Return the element that a QName in an attribute names; record a fault if there is none."""
        found = self.find(path, reference, attribute)
        if found is None:
            written = reference.get(attribute) or ""
            wanted = qname(reference, written) or written
            self.faults.append(f"{attribute} of {reference.get('name') or 'a port'} names {wanted}, which is not there")
        return found

    @cached_property
    def ports(self) -> tuple[SoapPort, ...]:
        """The ports with an address, whatever that is."""
        return tuple(self._ports())

    @cached_property
    def over_http(self) -> tuple[SoapPort, ...]:
        """The ports over HTTP."""
        return tuple(port for port in self.ports if is_http(port.url))

    @cached_property
    def bindings(self) -> tuple[SoapPort, ...]:
        """Each SOAP binding as a port without an address."""
        return tuple(port for binding in self._all("w:binding") for port in self._port(binding))

    def at(self, address: str) -> tuple[SoapPort, ...]:
        """Return the ports, or else the bindings, at an address."""
        return tuple(replace(port, url=address) for port in self.over_http or self.bindings)

    def _ports(self) -> Iterator[SoapPort]:
        for port in self._all("w:service/w:port"):
            address = next((element for space in _SPACES for element in port.iterfind(clark(space, "address"))), None)
            if address is None:
                continue
            url = address.get("location", "").strip()
            if url.startswith("http") and not is_http(url):
                self.faults.append(f"the address of port {port.get('name')} is no URL: {url}")
            binding = self._target("w:binding", port, "binding")
            if binding is not None:
                yield from self._port(binding, port, url)

    def _port(self, binding: etree._Element, port: etree._Element | None = None, url: str = "") -> Iterator[SoapPort]:
        soap, kind = _soap(binding, "binding"), self._target("w:portType", binding, "type")
        if soap is not None and kind is not None:
            operations = tuple(self._operations(binding, soap, kind))
            places = [binding, *([] if port is None else [port])]
            if not wants_addressing(places, self._all("//*[local-name()='Policy']")):
                operations = tuple(replace(operation, addressed="") for operation in operations)
            service = None if port is None else port.getparent()
            envelope = _SPACES[etree.QName(soap).namespace or ""]
            own = name(binding if port is None else port)
            of = "" if service is None else name(service)
            yield SoapPort(of, own, url, envelope, operations, name(binding), name(kind))

    def _operations(
        self, binding: etree._Element, soap: etree._Element, kind: etree._Element
    ) -> Iterator[SoapOperation]:
        abstract = {element.get("name"): element for element in kind.iterfind(clark(WSDL, "operation"))}
        for bound in binding.iterfind(clark(WSDL, "operation")):
            declared = abstract.get(bound.get("name"))
            if declared is None:
                self.faults.append(f"the binding has the operation {name(bound)}, which its port type has not")
            else:
                yield self._operation(bound, declared, soap, kind)

    def _operation(
        self, bound: etree._Element, declared: etree._Element, soap: etree._Element, kind: etree._Element
    ) -> SoapOperation:
        own = _soap(bound, "operation")
        style = (own.get("style") if own is not None else None) or soap.get("style") or "document"
        tags: dict[str, str] = {}
        actions: dict[str, str | None] = {}
        messages: list[etree._Element] = []
        remark = ""
        for way in ("input", "output"):
            given = declared.find(clark(WSDL, way))
            if given is None:
                continue
            actions[way] = next((given.get(key) for key in _ACTIONS if given.get(key)), None)
            message = self._target("w:message", given, "message")
            messages += [] if message is None else [message]
            part = bound.find(clark(WSDL, way))
            body = _soap(part, "body") if part is not None else None
            if way == "input" and part is not None and part.find(f".//{_CONTENT}") is not None:
                remark = "its request has attachments, which the suite does not make"
            if body is not None and body.get("use") == "encoded":
                remark = "its messages are encoded (WS-I BP R2706 allows literal alone)"
            elif "encoded" not in remark:
                tags[way] = self._tag(message, style, name(bound) if way == "input" else f"{name(bound)}Response", part)
        action = (own.get("soapAction") if own is not None else None) or ""
        if _CONTROL.search(action):
            remark = "its soapAction has a control character, which no header field can have"
        return SoapOperation(
            name(bound),
            action,
            tags.get("input", ""),
            tags.get("output"),
            remark,
            tuple(self._headers(bound)),
            addressing_action(declared, kind, action),
            actions.get("input"),
            actions.get("output"),
            tuple(map(name, messages)),
            tuple(tuple(map(name, element.iterfind(clark(WSDL, "part")))) for element in messages),
            frozenset(self._faults(declared)),
            " ".join(declared.findtext(_DOCUMENTATION, "").split()),
        )

    def _faults(self, declared: etree._Element) -> Iterator[str]:
        for given in declared.iterfind(clark(WSDL, "fault")):
            message = self._target("w:message", given, "message")
            for part in message.iterfind(clark(WSDL, "part")) if message is not None else ():
                yield qname(part, part.get("element")) or ""

    def _headers(self, bound: etree._Element) -> Iterator[str]:
        """Yield the tags of the header blocks of a request (WSDL 1.1, 3.7)."""
        for block in [
            element
            for space in _SPACES
            for element in bound.iterfind(f"{clark(WSDL, 'input')}/{clark(space, 'header')}")
        ]:
            message = self._target("w:message", block, "message")
            for part in message.iterfind(clark(WSDL, "part")) if message is not None else ():
                tag = qname(part, part.get("element"))
                if part.get("name") == block.get("part") and tag:
                    yield tag

    def _tag(self, message: etree._Element | None, style: str, wrapper: str, bound: etree._Element | None) -> str:
        """Return the tag of a message's element; empty if the Body is empty."""
        body = _soap(bound, "body") if bound is not None else None
        parts = list(message.iterfind(clark(WSDL, "part"))) if message is not None else []
        listed = body.get("parts") if body is not None else None
        if listed is not None:
            parts = [part for part in parts if part.get("name") in listed.split()]
        elif bound is not None and len(parts) > 1:
            blocks = {element.get("part") for element in bound.iter("{*}header")}
            parts = [part for part in parts if part.get("name") not in blocks]
        if style == "rpc":
            return self._wrapper(wrapper, (body.get("namespace") if body is not None else None) or "", parts)
        return (qname(parts[0], parts[0].get("element")) or "") if parts else ""

    def _wrapper(self, own: str, space: str, parts: list[etree._Element]) -> str:
        """Make a schema with the wrapper of an rpc message; return its tag."""
        tag = clark(space, own)
        if tag not in self._made:
            self._made.add(tag)
            types = [qname(part, part.get("type")) or part.get("type") or clark(XSD, "anyType") for part in parts]
            self.wrappers.append(rpc_wrapper(own, space, list(zip(map(name, parts), types, strict=True))))
        return tag


def _space_of(element: etree._Element) -> str:
    return element.getroottree().getroot().get("targetNamespace") or ""


def _soap(parent: etree._Element, kind: str) -> etree._Element | None:
    # SOAP with attachments has the body inside a mime:part (WSDL 1.1, 5.9).
    tags = [clark(space, kind) for space in _SPACES]
    found = (parent.find(f"{place}{tag}") for tag in tags for place in ("", f"{_MULTIPART}/{_PART}/"))
    return next((element for element in found if element is not None), None)


def name(element: etree._Element) -> str:
    """Return the name attribute, or empty."""
    return element.get("name") or ""


def qname(element: etree._Element, written: str | None) -> str | None:
    """Return a QName in an attribute in Clark notation; None if it is missing or its prefix is not declared."""
    if not written:
        return None
    prefix, _, own = written.strip().rpartition(":")
    space = element.nsmap.get(prefix or None)
    return None if prefix and space is None else clark(space, own)


def describe(
    wsdl: bytes, location: str, fetch: Fetch, address: str = "", locate: Locate = lambda _: "", *, foreign: bool = False
) -> Wsdl:
    """Read a WSDL and the documents it refers to, whatever they describe.

    Args:
        wsdl: the document.
        location: its URL or file name, the base of relative references.
        fetch: returns a further document by its resolved location.
        address: where the service is, whatever the WSDL says.
        locate: returns where the schema of a namespace is to which no reference led.
        foreign: whether the WSDL is not the device's own.

    Raises:
        WsdlError: it is not a WSDL.
    """
    try:
        return Wsdl(collect(wsdl, location, fetch, locate), location, address, foreign)
    except ValueError as error:
        raise WsdlError(f"{location} is no WSDL, but {error}") from error


def unread(place: str) -> bytes:
    """Fetch nothing: for a description of which only the first document is needed.

    Raises:
        OSError: always.
    """
    raise OSError(f"{place} is not needed")


def read_services(
    wsdl: bytes, location: str, fetch: Fetch, address: str = "", locate: Locate = lambda _: "", *, foreign: bool = False
) -> Wsdl:
    """Read a WSDL whose services can be called; the arguments are those of describe().

    Raises:
        WsdlError: it is none, has no port over HTTP, or its schemas do not compile.
    """
    found = describe(wsdl, location, fetch, address, locate, foreign=foreign)
    if not found.ports:
        how = advice(" with --base-url", ", as in [api] base_url of a statement")
        raise WsdlError(f"{location} has no port over HTTP: name the address of the service{how}")
    try:
        _ = found.faults, found.notes
    except SchemaError as error:
        raise WsdlError(f"the schemas of {location} do not compile: {error}") from error
    return found


def read_file(path: Path) -> Wsdl:
    """Return the description in a file of the contract.

    Raises:
        WsdlError: it is not a WSDL, or refers to missing files.
    """
    found = describe(path.read_bytes(), str(path), lambda location: Path(location).read_bytes())
    for place, reason in found.documents.missing.items():
        raise WsdlError(f"{path} refers to {place}: {reason}")
    return found


def unusable(wsdl: Wsdl) -> Iterator[str]:
    """Yield why a WSDL cannot be used as the description of one service: no binding, no operations, wrong schemas."""
    try:
        if not wsdl.operations:
            yield "a port type without operations"
    except WsdlError as error:
        yield str(error)
    try:
        _ = wsdl.types
    except SchemaError as error:
        yield f"schemas that do not compile: {error}"


_ANONYMOUS: Final = f"{ADDRESSING}/anonymous"
_TRUE: Final = frozenset({"true", "1"})
_POLICIES: Final = ("http://www.w3.org/ns/ws-policy", "http://schemas.xmlsoap.org/ws/2004/09/policy")


def is_http(address: str) -> bool:
    """Return whether an address is a URL over HTTP that can be called."""
    try:
        parts = urlsplit(address)
        return bool(parts.hostname) and parts.scheme in {"http", "https"} and parts.port != 0
    except ValueError:
        return False


def wants_addressing(places: Sequence[etree._Element], policies: Sequence[etree._Element]) -> bool:
    """Return whether messages must have WS-Addressing's header blocks (its Metadata, 3.1).

    Args:
        places: the binding, and the port.
        policies: all policies of the WSDL, which those may refer to.
    """
    wanted = {
        element.get("URI", "").removeprefix("#") for place in places for element in place.iter("{*}PolicyReference")
    }
    named = [element for element in policies if set(element.attrib.values()) & wanted]
    marks = (clark(WSAW, "UsingAddressing"), clark(WSAM, "Addressing"))
    return any(_is_required(mark) for place in (*places, *named) for mark in place.iter(*marks))


def _is_required(mark: etree._Element) -> bool:
    """Return whether an extension or a policy assertion on WS-Addressing demands it of each message.

    An extension does where `wsdl:required` says so; an assertion does unless it is optional.
    """
    if mark.tag == clark(WSAW, "UsingAddressing"):
        return mark.get(clark(WSDL, "required")) in _TRUE
    return not any(mark.get(clark(space, "Optional")) in _TRUE for space in _POLICIES)


def addressing_action(operation: etree._Element, port_type: etree._Element, soap_action: str) -> str:
    """Return a request's action: the one of its input, that of SOAP, or the default (WS-Addressing Metadata, 4.4)."""
    given = operation.find(clark(WSDL, "input"))
    if given is None:
        return ""
    said = next(
        (given.get(clark(space, "Action")) for space in (WSAM, WSAW) if given.get(clark(space, "Action"))), None
    )
    if said or soap_action:
        return said or soap_action
    bound = port_type.getparent()
    space = (bound.get("targetNamespace") or "") if bound is not None else ""
    mark = ":" if space.startswith("urn:") else "/"
    suffix = "" if operation.find(clark(WSDL, "output")) is None else "Request"
    name = given.get("name") or f"{operation.get('name')}{suffix}"
    return mark.join((space.rstrip(mark), port_type.get("name") or "", name))


def addressing_blocks(action: str, address: str) -> tuple[Node, ...]:
    """Return the header blocks of a request (WS-Addressing Core, 3.1), with a message id of its own."""
    reply = Node(clark(ADDRESSING, "ReplyTo"), children=(Node(clark(ADDRESSING, "Address"), _ANONYMOUS),))
    return (
        Node(clark(ADDRESSING, "Action"), action),
        Node(clark(ADDRESSING, "To"), address),
        Node(clark(ADDRESSING, "MessageID"), f"urn:uuid:{uuid.uuid4()}"),
        reply,
    )
