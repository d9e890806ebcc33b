"""Edits of SOAP responses, of their XML trees, and ready-made responses, for mutants."""

import re
from collections.abc import Callable
from typing import Any

from lxml import etree

from conformance.mutation.changes import SOAP
from conformance.mutation.messages import Request, Response
from conformance.mutation.xml_trees import each, tree

TRACE = (
    "java.lang.NullPointerException\n\tat org.mybot.turtlebot.soap.Publishers.execute(Publishers.java:41)\n"
    "\tat com.sun.xml.ws.server.InvokerTube$2.invoke(InvokerTube.java:148)"
)


def is_fault(response: Response) -> bool:
    """Return whether a response contains a SOAP fault."""
    return b"Fault" in response.body and b"faultstring" in response.body


def fault_tree(edit: Callable[[Any], object]) -> Callable[[Response], object]:
    """Return an edit that applies ``edit`` to the Fault element."""
    return tree(each("Fault", edit))


def in_body(edit: Callable[[Any], object]) -> Callable[[Response], object]:
    """Return an edit that applies ``edit`` to each child of Body."""
    return tree(each("Body", lambda body: [edit(child) for child in body]))


def hinted(element: Any) -> None:
    """Add a child to Fault that SOAP 1.1 does not define."""
    etree.SubElement(element, "hint").text = "see the manual"


def qualified(element: Any) -> None:
    """Put the children of Fault in the SOAP namespace."""
    for child in element:
        child.tag = etree.QName(SOAP, etree.QName(child).localname).text


def coded(code: str) -> Callable[[Response], object]:
    """Return an edit that gives every fault another faultcode with the same prefix."""

    def edit(child: Any) -> None:
        child.text = re.sub(r"\w+\s*$", code, child.text or "")

    return fault_tree(each("faultcode", edit))


def unbound(response: Response) -> None:
    """Give faultcode a prefix that is not declared."""
    response.body = re.sub(rb"(<faultcode[^>]*>\s*)[\w.-]+:", rb"\1nowhere:", response.body)


def styled(element: Any) -> None:
    """Set encodingStyle on an element."""
    element.set(f"{{{SOAP}}}encodingStyle", "http://schemas.xmlsoap.org/soap/encoding/")


def declared(response: Response) -> None:
    """Insert a document type declaration."""
    prolog, _, rest = (
        response.body.rpartition(b"?>") if response.body.startswith(b"<?xml") else (b"", b"", response.body)
    )
    root = re.search(rb"<([\w.-]+:)?Envelope", rest)
    name = root[0][1:] if root else b"Envelope"
    response.body = (prolog + b"?>" if prolog else b"") + b"<!DOCTYPE " + name + b">" + rest


def instructed(response: Response) -> None:
    """Insert a processing instruction."""
    response.body = re.sub(rb"(<([\w.-]+:)?Envelope)", rb"<?robot drive?>\1", response.body, count=1)


def trailer(root: Any) -> None:
    """Append an element after Body."""
    etree.SubElement(root, "{urn:example:trailer}signature").text = "0"


def latin(response: Response) -> None:
    """Encode the response in ISO 8859-1."""
    body = re.sub(rb"^\s*<\?xml.*?\?>", b"", response.body)
    response.body = b'<?xml version="1.0" encoding="ISO-8859-1"?><!-- \xe9t\xe9 -->' + body
    response.put("Content-Type", "text/xml; charset=iso-8859-1")


def understood_true(root: Any) -> None:
    """Insert a header block with mustUnderstand="true"."""
    block = etree.Element(f"{{{SOAP}}}Header")
    child = etree.SubElement(block, "{urn:example:status}battery")
    child.set(f"{{{SOAP}}}mustUnderstand", "true")
    root.insert(0, block)


def unqualified(wrapper: Any) -> None:
    """Put the child of Body in no namespace."""
    wrapper.tag = etree.QName(wrapper).localname


def wrapper_as_asked(wrapper: Any) -> None:
    """Rename the response wrapper to the name of the request wrapper."""
    wrapper.tag = wrapper.tag.removesuffix("Response")


def enveloped(content: str, status: int = 200) -> Callable[[Request], Response]:
    """Return a maker of SOAP responses with this content in Body."""
    body = f'<s:Envelope xmlns:s="{SOAP}"><s:Body>{content}</s:Body></s:Envelope>'.encode()
    return lambda request: Response(status, [("Content-Type", "text/xml; charset=utf-8")], body, method=request.method)


def fault(code: str, string: str) -> Callable[[Request], Response]:
    """Return a maker of well-formed SOAP faults."""
    return enveloped(f"<s:Fault><faultcode>s:{code}</faultcode><faultstring>{string}</faultstring></s:Fault>", 500)


def with_content(wrapper: Any) -> None:
    """Append an element to the response wrapper."""
    etree.SubElement(wrapper, "accepted").text = "true"


def other_namespace(wrapper: Any) -> None:
    """Put the response wrapper in another namespace."""
    wrapper.tag = etree.QName("http://ros-ws.org", etree.QName(wrapper).localname).text
