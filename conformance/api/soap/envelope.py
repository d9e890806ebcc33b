"""SOAP 1.1 envelopes: make them from body and header elements, and read a robot's responses as frozen values."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from lxml import etree

from conformance.documents.xml import ENVELOPE, Node, NotXmlError, clark, elements, local, parse, text_of

# A SOAP message without content: a server that answers it handles SOAP, and does nothing.
EMPTY: Final = b'<e:Envelope xmlns:e="http://schemas.xmlsoap.org/soap/envelope/"><e:Body/></e:Envelope>'


class NotSoapError(ValueError):
    """Raised for a response that is no SOAP 1.1 message; the message names the fault."""


@dataclass(frozen=True)
class Fault:
    """A SOAP 1.1 fault as it was sent.

    Attributes:
        element: the Fault.
        code_namespace: of faultcode's QName; None where its prefix is not bound; empty where it has no namespace.
        code: local part of faultcode's QName, with what follows a dot (``Client.Authentication``); empty without one.
        string: faultstring, or empty.
        names: tags of the element children, in Clark notation, in their order.
    """

    element: etree._Element
    code_namespace: str | None
    code: str
    string: str
    names: tuple[str, ...]

    @property
    def standard(self) -> str:
        """Return the standard fault code to which this one belongs (SOAP 1.1, 4.4.1), or an empty text."""
        return self.code.split(".", 1)[0] if self.code_namespace == ENVELOPE else ""


@dataclass(frozen=True)
class Envelope:
    """A SOAP 1.1 message.

    Attributes:
        root: the Envelope.
        headers: the header blocks.
        body: the Body.
        payload: its element children.
        fault: the fault, if that is what the Body holds.
    """

    root: etree._Element
    headers: tuple[etree._Element, ...]
    body: etree._Element
    payload: tuple[etree._Element, ...]
    fault: Fault | None

    @property
    def first(self) -> etree._Element | None:
        """The Body's first child, which identifies a message (BP R2710), or None."""
        return self.payload[0] if self.payload else None


def read(document: bytes) -> Envelope:
    """Read a message.

    Raises:
        NotSoapError: it is no XML, or no SOAP 1.1 envelope with a Body.
    """
    try:
        # A DOCTYPE breaks R1008, which another check reports; the rest of the message is judged all the same.
        root = parse(document, doctype=True)
    except NotXmlError as error:
        raise NotSoapError(str(error)) from error
    return read_root(root)


def read_root(root: etree._Element) -> Envelope:
    """Read a message that is parsed already.

    Raises:
        NotSoapError: it is no SOAP 1.1 envelope with a Body.
    """
    if root.tag != clark(ENVELOPE, "Envelope"):
        raise NotSoapError(f"the root element {root.tag} instead of SOAP 1.1's Envelope")
    parts = elements(root)
    headers: list[etree._Element] = []
    if parts and parts[0].tag == clark(ENVELOPE, "Header"):
        headers = elements(parts.pop(0))
    if not parts or parts[0].tag != clark(ENVELOPE, "Body"):
        raise NotSoapError(f"an Envelope with {parts[0].tag if parts else 'nothing'} in place of its Body")
    payload = tuple(elements(parts[0]))
    fault = _fault(payload[0]) if payload and payload[0].tag == clark(ENVELOPE, "Fault") else None
    return Envelope(root, tuple(headers), parts[0], payload, fault)


def _fault(element: etree._Element) -> Fault:
    children = elements(element)
    # R1001 demands unqualified children; a fault with qualified ones is read too, so that it can be judged.
    by_name: dict[str, etree._Element] = {}
    for child in children:
        by_name.setdefault(local(str(child.tag)), child)
    code_element = by_name.get("faultcode")
    written = text_of(code_element).strip() if code_element is not None else ""
    prefix, colon, name = written.rpartition(":")
    space: str | None = ""
    if code_element is not None:
        space = code_element.nsmap.get(prefix) if colon else code_element.nsmap.get(None, "")
    string = text_of(by_name["faultstring"]).strip() if "faultstring" in by_name else ""
    return Fault(element, space, name, string, tuple(str(child.tag) for child in children))


def envelope(body: Iterable[Node], headers: Iterable[Node] | None = None, space: str = ENVELOPE) -> Node:
    """Make a message of children of the Body and header blocks (None: no Header), in SOAP's namespace or another."""
    header = () if headers is None else (Node(clark(space, "Header"), children=tuple(headers)),)
    return Node(clark(space, "Envelope"), children=(*header, Node(clark(space, "Body"), children=tuple(body))))
