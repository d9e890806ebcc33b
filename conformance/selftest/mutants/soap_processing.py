"""Robots that process envelopes, headers and encodings as SOAP 1.1 does not have it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from lxml import etree

from conformance.selftest.mutants.changes import SOAP, TNS, instead, rewritten, soap, xml
from conformance.selftest.mutants.mutant import Fault
from conformance.selftest.mutants.soap_profile import coded, is_fault
from conformance.selftest.mutants.soap_services import enveloped, fault

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Answer, Ask

    Forward = Callable[[Ask], Answer]


def posted(ask: Ask) -> bool:
    """SOAP requests."""
    return ask.side == "soap" and ask.method == "POST"


def _foreign(ask: Ask) -> bool:
    return posted(ask) and b"Envelope" in ask.body and SOAP.encode() not in ask.body


def _made_soap11(ask: Ask) -> None:
    root = xml(ask.body)
    if root is None:
        return
    namespace = etree.QName(root).namespace
    for node in root.iter():
        if isinstance(node.tag, str) and etree.QName(node).namespace == namespace:
            node.tag = f"{{{SOAP}}}{etree.QName(node).localname}"
    ask.body = etree.tostring(root)


def _mandatory(ask: Ask) -> bool:
    return posted(ask) and b"mustUnderstand" in ask.body


def without_headers(ask: Ask) -> Ask:
    """A request without its header blocks."""
    root = xml(ask.body)
    made = ask.copy()
    if root is not None:
        for block in root.findall(f"{{{SOAP}}}Header"):
            root.remove(block)
        made.body = etree.tostring(root)
    return made


def _acts_all_the_same(ask: Ask, forward: Forward) -> Answer:
    """A request is carried out, and answered with a MustUnderstand fault."""
    answer = forward(ask)
    if _mandatory(ask) and b"MustUnderstand" in answer.body:
        forward(without_headers(ask))
    return answer


def _recoded(ask: Ask, forward: Forward, was: bytes, code: str) -> Answer:
    answer = forward(ask)
    if posted(ask) and is_fault(answer) and was in answer.body:
        answer = answer.copy()
        coded(code)(answer)
    return answer


def _recode(was: bytes, code: str) -> Callable[[], Any]:
    return lambda: lambda ask, forward: _recoded(ask, forward, was, code)


def _order(ask: Ask, forward: Forward) -> Answer:
    """Header blocks are looked at before the envelope's version, and the body before them."""
    if _mandatory(ask) and _foreign(ask):
        return _recoded(ask, forward, b"VersionMismatch", "MustUnderstand")
    answer = forward(ask)
    if _mandatory(ask) and b"MustUnderstand" in answer.body:
        body = forward(without_headers(ask))
        if is_fault(body):
            return body
    return answer


def _by_action(ask: Ask, forward: Forward) -> Answer:
    """SOAPAction chooses the operation."""
    action = (ask.field("SOAPAction") or "").strip('"')
    wanted = next((name for name in ("ExecuteCoffeeRequest", "ExecuteDeliveryRequest") if name in action), None)
    if posted(ask) and wanted and b"Execute" in ask.body:
        ask = ask.copy(body=re.sub(rb"Execute(Coffee|Delivery)Request", wanted.encode(), ask.body))
    return forward(ask)


def _typeless(ask: Ask) -> bool:
    return soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")(ask) and not re.search(
        rb"XMLSchema-instance", ask.body
    )


def _named_action(ask: Ask) -> bool:
    action = ask.field("SOAPAction") or ""
    return posted(ask) and len(action) > 2


def _headed(ask: Ask) -> bool:
    """Requests with a header block that is not mandatory and not of WS-Addressing."""
    root = xml(ask.body) if posted(ask) else None
    header = root.find(f"{{{SOAP}}}Header") if root is not None else None
    return (
        header is not None and len(header) > 0 and b"mustUnderstand" not in ask.body and b"addressing" not in ask.body
    )


def _for_others(ask: Ask) -> bool:
    return _mandatory(ask) and b"actor" in ask.body and b"actor/next" not in ask.body


def _unknown(ask: Ask) -> bool:
    root = xml(ask.body) if posted(ask) else None
    body = root.find(f"{{{SOAP}}}Body") if root is not None else None
    child = body[0] if body is not None and len(body) == 1 else None
    if child is None or not isinstance(child.tag, str):
        return False
    local = etree.QName(child).localname
    return not re.fullmatch(
        r"Execute(Coffee|Delivery)Request|Get(Pose|Velocity|Sensors|NavigationServices|Goal|Plan)", local
    )


_NOTHING = f'<t:NothingResponse xmlns:t="{TNS}"/>'


def _fault(name: str, says: str, id_: str, make: Any, *, observer: bool = False) -> Fault:
    return Fault(name, says, (f"soap-basic-profile/{id_}",), "soap", make, observer=observer)


FAULTS = (
    _fault("bp-any-envelope", "An Envelope of any namespace is taken.", "R1015", rewritten(_foreign, _made_soap11)),
    _fault(
        "bp-version-client",
        "Another envelope's fault has the code Client.",
        "version-mismatch",
        _recode(b"VersionMismatch", "Client"),
    ),
    _fault(
        "bp-wants-types",
        "A request without xsi:type is a fault.",
        "R1017",
        instead(_typeless, fault("Client", "xsi:type is missing")),
    ),
    _fault(
        "bp-ignores-mandatory",
        "Mandatory header blocks are not looked at.",
        "R1027",
        lambda: lambda ask, forward: forward(without_headers(ask) if _mandatory(ask) else ask),
    ),
    _fault(
        "bp-mandatory-client",
        "The fault for a mandatory header block has the code Client.",
        "R1027",
        _recode(b"MustUnderstand", "Client"),
    ),
    _fault(
        "bp-acts-all-the-same",
        "A request that is answered MustUnderstand is carried out.",
        "R1028",
        lambda: _acts_all_the_same,
        observer=True,
    ),
    _fault(
        "bp-empty-action-only",
        "A SOAPAction that is not empty is a fault.",
        "R1109",
        instead(_named_action, fault("Client", "The given SOAPAction does not match an operation.")),
    ),
    _fault("bp-action-dispatch", "SOAPAction chooses the operation.", "R1127", lambda: _by_action),
    _fault("bp-fault-order", "Faults are checked for from the body outwards.", "R2725", lambda: _order),
    _fault(
        "bp-no-headers",
        "Every header block is a fault.",
        "R2739",
        instead(_headed, fault("Client", "no headers, please")),
    ),
    _fault(
        "bp-no-byte-order-mark",
        "A byte order mark is malformed.",
        "R4001",
        instead(
            lambda ask: posted(ask) and ask.body.startswith(b"\xef\xbb\xbf"),
            fault("Client", "content is not allowed in prolog"),
        ),
    ),
    _fault(
        "bp-no-utf-16",
        "UTF-16 is malformed.",
        "utf-16",
        instead(lambda ask: posted(ask) and ask.body[:2] in {b"\xff\xfe", b"\xfe\xff"}, fault("Client", "not UTF-8")),
    ),
    _fault(
        "bp-unknown-fine", "An unknown operation succeeds.", "unknown-operation", instead(_unknown, enveloped(_NOTHING))
    ),
    _fault(
        "bp-mandatory-for-others",
        "A mandatory header block for another actor is a fault.",
        "mustunderstand-actor",
        instead(_for_others, fault("MustUnderstand", "not understood")),
    ),
)
