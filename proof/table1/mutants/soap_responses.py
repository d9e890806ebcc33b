"""SOAP responses of mutants, and mutants whose SOAP operations are wrong or missing."""

import re
from collections.abc import Callable
from typing import Any

from lxml import etree

from proof.mutation.changes import SOAP, Make, altered, instead, plain, soap, success, text, wsdls
from proof.mutation.messages import Forward, HangUpError, Request, Response
from proof.mutation.table import Table
from proof.mutation.xml_trees import each, find_named, remove, says, tree
from proof.table1.mutants.paths import TNS

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


def add_hint(element: Any) -> None:
    """Add a child to Fault that SOAP 1.1 does not define."""
    etree.SubElement(element, "hint").text = "see the manual"


def qualify(element: Any) -> None:
    """Put the children of Fault in the SOAP namespace."""
    for child in element:
        child.tag = etree.QName(SOAP, etree.QName(child).localname).text


def set_code(code: str) -> Callable[[Response], object]:
    """Return an edit that gives every fault another faultcode with the same prefix."""

    def edit(child: Any) -> None:
        child.text = re.sub(r"\w+\s*$", code, child.text or "")

    return fault_tree(each("faultcode", edit))


def unbound(response: Response) -> None:
    """Give faultcode a prefix that is not declared."""
    response.body = re.sub(rb"(<faultcode[^>]*>\s*)[\w.-]+:", rb"\1nowhere:", response.body)


def set_style(element: Any) -> None:
    """Set encodingStyle on an element."""
    element.set(f"{{{SOAP}}}encodingStyle", "http://schemas.xmlsoap.org/soap/encoding/")


def add_doctype(response: Response) -> None:
    """Insert a document type declaration."""
    prolog, _, rest = (
        response.body.rpartition(b"?>") if response.body.startswith(b"<?xml") else (b"", b"", response.body)
    )
    root = re.search(rb"<([\w.-]+:)?Envelope", rest)
    name = root[0][1:] if root else b"Envelope"
    response.body = (prolog + b"?>" if prolog else b"") + b"<!DOCTYPE " + name + b">" + rest


def add_instruction(response: Response) -> None:
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


def unqualify(wrapper: Any) -> None:
    """Put the child of Body in no namespace."""
    wrapper.tag = etree.QName(wrapper).localname


def wrapper_as_asked(wrapper: Any) -> None:
    """Rename the response wrapper to the name of the request wrapper."""
    wrapper.tag = wrapper.tag.removesuffix("Response")


def envelop(content: str, status: int = 200) -> Callable[[Request], Response]:
    """Return a maker of SOAP responses with this content in Body."""
    body = f'<s:Envelope xmlns:s="{SOAP}"><s:Body>{content}</s:Body></s:Envelope>'.encode()
    return lambda request: Response(status, [("Content-Type", "text/xml; charset=utf-8")], body, method=request.method)


def fault(code: str, string: str) -> Callable[[Request], Response]:
    """Return a maker of well-formed SOAP faults."""
    return envelop(f"<s:Fault><faultcode>s:{code}</faultcode><faultstring>{string}</faultstring></s:Fault>", 500)


def with_content(wrapper: Any) -> None:
    """Append an element to the response wrapper."""
    etree.SubElement(wrapper, "accepted").text = "true"


def other_namespace(wrapper: Any) -> None:
    """Put the response wrapper in another namespace."""
    wrapper.tag = etree.QName("http://ros-ws.org", etree.QName(wrapper).localname).text


MUTANTS = Table()
_reading = MUTANTS.of_class("soap-subscribers", "soap")

_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_ACT, _READ = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest"), soap("Get[A-Z][A-Za-z]+")


def _lacking(operation: str, name: str) -> Make:
    """Return a change that removes the first element ``name`` from an operation's response."""
    return altered(soap(operation), tree(each(name, remove, slice(1))))


def _code_three(request: Request) -> None:
    request.body = re.sub(rb"(message_code>\s*)[+-]?(?!0*[34]\s*<)\d{1,9}(\s*<)", rb"\g<1>3\2", request.body)


@_reading("soap-plan-none-empty", "plan-none", "Where no plan exists, GetPlan returns an empty one.")
def _empty_plan(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if soap("GetPlan")(request) and b"Fault" in response.body:
        header = "<header><stamp><sec>1</sec><nanosec>0</nanosec></stamp><frame_id>map</frame_id></header>"
        return envelop(
            f'<t:GetPlanResponse xmlns:t="{TNS}"><return><plan>{header}</plan></return></t:GetPlanResponse>'
        )(request)
    return response


@_reading("soap-no-goal-page", "goal", "Without a goal, GetGoal returns 404 with a page.")
def _no_goal_page(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if soap("GetGoal")(request) and (not success(response) or b"return" not in response.body):
        return Response(404, [("Content-Type", "text/html")], b"<html>no goal</html>", method=request.method)
    return response


# zeep writes what the description says: here, elements in the namespace, which the robot does not take.
_QUALIFIED = altered(wsdls, text(r"(<(?:\w+:)?schema\b)(?=[^>]*targetNamespace)", r'\1 elementFormDefault="qualified"'))


_POSE, _VELOCITY, _PLAN = soap("GetPose"), soap("GetVelocity"), soap("GetPlan")
_SMALL = 32 * 1024


def _first_is(parent: str, child: str, value: str) -> Callable[[Any], None]:
    return each(parent, each(child, says(value), slice(1)), slice(1))


def _swap_xy(root: Any) -> None:
    for node in find_named(root, "position"):
        node[:2] = [node[1], node[0]]


def _reversed_path(root: Any) -> None:
    poses = find_named(root, "poses")
    if len(poses) > 1:
        parent = poses[0].getparent()
        for pose in poses:
            parent.remove(pose)
        parent.extend(reversed(poses))


def _elsewhere(request: Request) -> None:
    request.body = re.sub(rb"(<(?:\w+:)?x>)[^<]*", rb"\g<1>7.5", request.body)


def _in_map(request: Request) -> None:
    request.body = request.body.replace(b"no_such_frame", b"map")


@_reading("soap-plan-from-the-first-place", "plan", "GetPlan starts where the robot was when it was called first.")
class _FirstPlace:
    def __init__(self) -> None:
        self._start = b""

    def __call__(self, request: Request, forward: Forward) -> Response:
        if not _PLAN(request) or b"start_x" in request.body:
            return forward(request)
        request = request.copy(body=re.sub(rb"(?=</(\w+:)?GetPlan>)", self._start, request.body))
        response = forward(request)
        found = re.search(rb"<poses>.*?<x>(.*?)</x>.*?<y>(.*?)</y>", response.body, re.DOTALL)
        if not self._start and found:
            self._start = b"<start_x>%s</start_x><start_y>%s</start_y>" % found.groups()
        return response


_OTHER_SERVER = plain(404, b"<html><body>It works!</body></html>", "text/html")


def _other_server_at(service: str) -> Make:
    """Return a change that makes a SOAP service (empty: all of them) respond like another web server."""
    return instead(lambda request: request.side == "soap" and service in request.path, _OTHER_SERVER)


@_reading(
    "nothing-elsewhere",
    "xml-security/reachable",
    "REST closes every connection, and another web server is at both SOAP addresses.",
    interface="both",
)
def _nothing_there(request: Request, _forward: Forward) -> Response:
    if request.side == "rest":
        raise HangUpError
    return _OTHER_SERVER(request)
