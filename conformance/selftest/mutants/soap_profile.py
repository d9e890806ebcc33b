"""Robots that break WS-I Basic Profile 1.1 and SOAP 1.1 in their messages and faults."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from lxml import etree

from conformance.selftest.mutants.changes import SOAP, altered, anything, header, named, soap, status, text, tree
from conformance.selftest.mutants.mutant import Mutant

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.change import Forward
    from conformance.selftest.messages import Request, Response

_ANY = soap()
_ACT = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")
_TRACE = (
    "java.lang.NullPointerException\n\tat org.mybot.turtlebot.soap.Publishers.execute(Publishers.java:41)\n"
    "\tat com.sun.xml.ws.server.InvokerTube$2.invoke(InvokerTube.java:148)"
)


def _posted(request: Request) -> bool:
    return request.side == "soap" and request.method == "POST"


def is_fault(response: Response) -> bool:
    """Answers that hold a SOAP fault."""
    return b"Fault" in response.body and b"faultstring" in response.body


def _plain_success(response: Response) -> bool:
    return response.status == 200 and not is_fault(response)


def _set_status(value: int) -> Callable[[Response], None]:
    def edit(response: Response) -> None:
        response.status, response.reason = value, ""

    return edit


def _fault_tree(edit: Callable[[Any], object]) -> Callable[[Response], object]:
    """Alter the Fault element."""

    def apply(root: Any) -> None:
        for element in named(root, "Fault"):
            edit(element)

    return tree(apply)


def _hinted(element: Any) -> None:
    etree.SubElement(element, "hint").text = "see the manual"


def _qualified(element: Any) -> None:
    for child in element:
        child.tag = etree.QName(SOAP, etree.QName(child).localname).text


def _dropped(name: str) -> Callable[[Any], None]:
    def edit(element: Any) -> None:
        for child in named(element, name):
            child.getparent().remove(child)

    return edit


def coded(code: str) -> Callable[[Response], object]:
    """Give every fault another code, in the prefix that it has."""

    def edit(element: Any) -> None:
        for child in named(element, "faultcode"):
            child.text = re.sub(r"\w+\s*$", code, child.text or "")

    return _fault_tree(edit)


def _unbound(response: Response) -> None:
    response.body = re.sub(rb"(<faultcode[^>]*>\s*)[\w.-]+:", rb"\1nowhere:", response.body)


def _styled(root: Any) -> None:
    root.set(f"{{{SOAP}}}encodingStyle", "http://schemas.xmlsoap.org/soap/encoding/")


def _styled_child(root: Any) -> None:
    for child in named(root, "Body")[0]:
        child.set(f"{{{SOAP}}}encodingStyle", "http://schemas.xmlsoap.org/soap/encoding/")


def _declared(response: Response) -> None:
    prolog, _, rest = (
        response.body.rpartition(b"?>") if response.body.startswith(b"<?xml") else (b"", b"", response.body)
    )
    root = re.search(rb"<([\w.-]+:)?Envelope", rest)
    name = root[0][1:] if root else b"Envelope"
    response.body = (prolog + b"?>" if prolog else b"") + b"<!DOCTYPE " + name + b">" + rest


def _instructed(response: Response) -> None:
    response.body = re.sub(rb"(<([\w.-]+:)?Envelope)", rb"<?robot drive?>\1", response.body, count=1)


def _trailer(root: Any) -> None:
    etree.SubElement(root, "{urn:example:trailer}signature").text = "0"


def _latin(response: Response) -> None:
    body = re.sub(rb"^\s*<\?xml.*?\?>", b"", response.body)
    response.body = b'<?xml version="1.0" encoding="ISO-8859-1"?><!-- \xe9t\xe9 -->' + body
    response.put("Content-Type", "text/xml; charset=iso-8859-1")


def _true(root: Any) -> None:
    block = etree.Element(f"{{{SOAP}}}Header")
    child = etree.SubElement(block, "{urn:example:status}battery")
    child.set(f"{{{SOAP}}}mustUnderstand", "true")
    root.insert(0, block)


def _unqualified(root: Any) -> None:
    for child in named(root, "Body")[0]:
        child.tag = etree.QName(child).localname


def _wrapper_as_asked(root: Any) -> None:
    for child in named(root, "Body")[0]:
        child.tag = child.tag.removesuffix("Response")


def _version(response: Response) -> None:
    response.version = "HTTP/1.2"


def _bare_500(response: Response) -> None:
    response.status, response.reason, response.body = 500, "", b"<html><body>Internal Server Error</body></html>"
    response.put("Content-Type", "text/html")


def _is_malformed(request: Request) -> bool:
    if not _posted(request):
        return False
    try:
        etree.fromstring(request.body, etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True))
    except (etree.XMLSyntaxError, ValueError):
        return not request.body.startswith((b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf"))
    return False


def _not_post(request: Request) -> bool:
    return (
        request.side == "soap"
        and request.method not in {"POST", "HEAD", "OPTIONS"}
        and "wsdl" not in request.query
        and "xsd" not in request.query
    )


def _traced(element: Any) -> None:
    for child in named(element, "faultstring"):
        child.text = _TRACE


def _mutant(name: str, says: str, id_: str, make: Any) -> Mutant:
    return Mutant(name, says, (f"soap-basic-profile/{id_}",), "soap", make)


def _empty(response: Response, value: int) -> None:
    response.status, response.reason, response.body = value, "", b""
    response.drop("Content-Type")


def _any_type(request: Request, forward: Forward) -> Response:
    if _posted(request) and request.media_type != "text/xml":
        request = request.copy()
        request.put("Content-Type", "text/xml; charset=utf-8")
    return forward(request)


MUTANTS = (
    _mutant(
        "bp-fault-hint",
        "A Fault has a child of the robot's own.",
        "R1000",
        altered(_posted, _fault_tree(_hinted), is_fault),
    ),
    _mutant(
        "bp-fault-qualified",
        "The children of a Fault are qualified.",
        "R1001",
        altered(_posted, _fault_tree(_qualified), is_fault),
    ),
    _mutant(
        "bp-fault-mute",
        "A Fault has no faultstring.",
        "fault-complete",
        altered(_posted, _fault_tree(_dropped("faultstring")), is_fault),
    ),
    _mutant(
        "bp-fault-codeless",
        "A Fault has no faultcode.",
        "fault-complete",
        altered(_posted, _fault_tree(_dropped("faultcode")), is_fault),
    ),
    _mutant(
        "bp-fault-own-code",
        "faultcode is a code that SOAP's namespace does not have.",
        "R1004",
        altered(_posted, coded("Oops"), is_fault),
    ),
    _mutant(
        "bp-fault-unbound",
        "The prefix of faultcode is not bound.",
        "faultcode-qualified",
        altered(_posted, _unbound, is_fault),
    ),
    _mutant(
        "bp-fault-code-bare",
        "faultcode has no prefix.",
        "faultcode-qualified",
        altered(_posted, text(r"(<faultcode[^>]*>\s*)[\w.-]+:", r"\1"), is_fault),
    ),
    _mutant("bp-encoding-style", "Envelope carries encodingStyle.", "R1005", altered(_ANY, tree(_styled), anything)),
    _mutant(
        "bp-encoding-style-child",
        "The child of Body carries encodingStyle.",
        "R1006",
        altered(_ANY, tree(_styled_child), anything),
    ),
    _mutant("bp-doctype", "Answers have a Document Type Declaration.", "R1008", altered(_ANY, _declared, anything)),
    _mutant("bp-instruction", "Answers have a processing instruction.", "R1009", altered(_ANY, _instructed, anything)),
    _mutant("bp-trailer", "Something follows Body.", "R1011", altered(_ANY, tree(_trailer), anything)),
    _mutant("bp-latin", "Answers are ISO 8859-1.", "R1012", altered(_ANY, _latin, anything)),
    _mutant(
        "bp-must-understand-true", "mustUnderstand is written true.", "R1013", altered(_ANY, tree(_true), anything)
    ),
    _mutant(
        "bp-body-unqualified",
        "The child of Body is in no namespace.",
        "R1014",
        altered(_ANY, tree(_unqualified), _plain_success),
    ),
    _mutant("bp-status-accepted", "Responses are 202.", "R1111", altered(_ANY, _set_status(202), _plain_success)),
    _mutant(
        "bp-malformed-422",
        "Malformed XML is 422.",
        "R1113",
        altered(_is_malformed, lambda response: _empty(response, 422), anything),
    ),
    _mutant("bp-status-redirect", "Responses are 500.", "R1124", altered(_ANY, _set_status(500), _plain_success)),
    _mutant(
        "bp-malformed-page", "Malformed XML is 500 with a page.", "R1125", altered(_is_malformed, _bare_500, anything)
    ),
    _mutant(
        "bp-malformed-fine",
        "Malformed XML is 200.",
        "R1125",
        altered(_is_malformed, lambda response: _empty(response, 200), anything),
    ),
    _mutant(
        "bp-get-200",
        "GET of the service is 200 with a page.",
        "R1114",
        altered(_not_post, lambda response: _empty(response, 200), anything),
    ),
    _mutant("bp-any-type", "Any media type is taken for text/xml.", "R1115", lambda: _any_type),
    _mutant("bp-fault-200", "Faults are 200.", "R1126", altered(_posted, _set_status(200), is_fault)),
    _mutant("bp-fault-400", "Faults are 400.", "R1126", altered(_posted, _set_status(400), is_fault)),
    _mutant("bp-http-1-2", "Answers say HTTP/1.2.", "R1141", altered(_posted, _version, anything)),
    _mutant(
        "bp-soap12-type",
        "Answers are application/soap+xml.",
        "content-type",
        altered(_posted, header("Content-Type", "application/soap+xml; charset=utf-8"), anything),
    ),
    _mutant(
        "bp-wrapper-as-asked",
        "The response's wrapper has the request's name.",
        "R2712",
        altered(_ANY, tree(_wrapper_as_asked), _plain_success),
    ),
    _mutant(
        "bp-server-to-blame",
        "What the client did wrong is a Server fault.",
        "R2724",
        altered(_ACT, coded("Server"), is_fault),
    ),
    _mutant(
        "bp-traceback",
        "Faults show a stack trace.",
        "fault-no-traceback",
        altered(_posted, _fault_tree(_traced), is_fault),
    ),
    _mutant(
        "bp-fault-sometimes-200",
        "One fault in 50 is 200.",
        "R1126",
        altered(_posted, _set_status(200), status(500), nth=50),
    ),
)
