"""Mutants that break the Basic Profile: messages, faults, headers and how they are processed."""

import re
from collections.abc import Callable
from typing import Any

from lxml import etree

from proof.mutation.changes import SOAP, Make, altered, anything, posted, problem, soap
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.mutation.xml_trees import xml
from proof.table1.mutants.paths import TNS
from proof.table1.mutants.soap_responses import is_fault, set_code

_SESAME = "open-sesame"
MUTANTS = Table()
_mutant = MUTANTS.of_class("soap-basic-profile", "soap")

_PAGE = b"<html><body>Internal Server Error</body></html>"
_ANY = soap()
_ACT = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")


def _answers(edit: Callable[[Response], object]) -> Make:
    """Return a change that applies ``edit`` to every response of an operation, faults too."""
    return altered(_ANY, edit, anything)


def _faults(edit: Callable[[Response], object]) -> Make:
    """Return a change that applies ``edit`` to faults."""
    return altered(posted, edit, is_fault)


def _plain_success(response: Response) -> bool:
    return response.status == 200 and not is_fault(response)


def _is_malformed(request: Request) -> bool:
    if not posted(request):
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


@_mutant("bp-any-type", "R1115", "The robot accepts every media type as text/xml.")
def _any_type(request: Request, forward: Forward) -> Response:
    if posted(request) and request.media_type != "text/xml":
        request = request.copy()
        request.put("Content-Type", "text/xml; charset=utf-8")
    return forward(request)


def _in_chunks(request: Request) -> bool:
    return posted(request) and request.field("Transfer-Encoding") is not None


def _first_part(request: Request) -> None:
    """Cut the body of a chunked request to 8 KiB."""
    request.body = request.body[:8192]


@_mutant(
    "bp-token-refused-and-made",
    "authentication",
    "A SOAP delivery without the token returns 401 and is published.",
    token=_SESAME,
    observer=True,
)
def _unauthorized_and_made(request: Request, forward: Forward) -> Response:
    if posted(request) and request.field("Authorization") != f"Bearer {_SESAME}":
        forward(request)
        return problem(401, "no token", ("WWW-Authenticate", "Bearer"))(request)
    return forward(request)


_mutant("bp-http-1-2", "R1141", "Responses have the version HTTP/1.2.").altered(
    posted, lambda response: setattr(response, "version", "HTTP/1.2"), anything
)


def _foreign(request: Request) -> bool:
    return posted(request) and b"Envelope" in request.body and SOAP.encode() not in request.body


def _made_soap11(request: Request) -> None:
    root = xml(request.body)
    if root is None:
        return
    namespace = etree.QName(root).namespace
    for node in root.iter():
        if isinstance(node.tag, str) and etree.QName(node).namespace == namespace:
            node.tag = f"{{{SOAP}}}{etree.QName(node).localname}"
    request.body = etree.tostring(root)


def _mandatory(request: Request) -> bool:
    return posted(request) and b"mustUnderstand" in request.body


def without_headers(request: Request) -> Request:
    """Return a copy of a request without its SOAP header blocks."""
    root = xml(request.body)
    made = request.copy()
    if root is not None:
        for block in root.findall(f"{{{SOAP}}}Header"):
            root.remove(block)
        made.body = etree.tostring(root)
    return made


@_mutant(
    "bp-acts-all-the-same",
    ("R1025", "R1028"),
    "The robot returns a MustUnderstand fault and carries the request out.",
    observer=True,
)
def _acts_all_the_same(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if _mandatory(request) and b"MustUnderstand" in response.body:
        forward(without_headers(request))
    return response


def _with_code(request: Request, forward: Forward, was: bytes, code: str) -> Response:
    response = forward(request)
    if posted(request) and is_fault(response) and was in response.body:
        response = response.copy()
        set_code(code)(response)
    return response


def _recode(was: bytes, code: str) -> Callable[[], Any]:
    return lambda: lambda request, forward: _with_code(request, forward, was, code)


@_mutant("bp-fault-order", "R2725", "The robot checks Body before it checks mandatory header blocks.")
def _order(request: Request, forward: Forward) -> Response:
    if _mandatory(request) and _foreign(request):
        return _with_code(request, forward, b"VersionMismatch", "MustUnderstand")
    response = forward(request)
    if _mandatory(request) and b"MustUnderstand" in response.body:
        body = forward(without_headers(request))
        if is_fault(body):
            return body
    return response


@_mutant("bp-action-dispatch", "R1127", "SOAPAction selects the operation, whatever is in Body.")
def _by_action(request: Request, forward: Forward) -> Response:
    action = (request.field("SOAPAction") or "").strip('"')
    wanted = next((name for name in ("ExecuteCoffeeRequest", "ExecuteDeliveryRequest") if name in action), None)
    if posted(request) and wanted and b"Execute" in request.body:
        request = request.copy(body=re.sub(rb"Execute(Coffee|Delivery)Request", wanted.encode(), request.body))
    return forward(request)


def _has_headers(request: Request) -> bool:
    """Return whether a request has header blocks, none of them mandatory or of WS-Addressing."""
    root = xml(request.body) if posted(request) else None
    header = root.find(f"{{{SOAP}}}Header") if root is not None else None
    return (
        header is not None
        and len(header) > 0
        and b"mustUnderstand" not in request.body
        and b"addressing" not in request.body
    )


def _for_others(request: Request) -> bool:
    return _mandatory(request) and b"actor" in request.body and b"actor/next" not in request.body


def _unknown(request: Request) -> bool:
    root = xml(request.body) if posted(request) else None
    body = root.find(f"{{{SOAP}}}Body") if root is not None else None
    child = body[0] if body is not None and len(body) == 1 else None
    if child is None or not isinstance(child.tag, str):
        return False
    local = etree.QName(child).localname
    return not re.fullmatch(
        r"Execute(Coffee|Delivery)Request|Get(Pose|Velocity|Sensors|NavigationServices|Goal|Plan)", local
    )


_NOTHING = f'<t:NothingResponse xmlns:t="{TNS}"/>'


_mutant("bp-ignores-mandatory", "R1027", "The robot ignores mandatory header blocks.")(
    lambda request, forward: forward(without_headers(request) if _mandatory(request) else request)
)
