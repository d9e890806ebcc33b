"""Robots whose SOAP services answer something else than they were asked."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from lxml import etree

from conformance.selftest.mutants.changes import (
    SOAP,
    TNS,
    altered,
    instead,
    named,
    rewritten,
    soap,
    success,
    text,
    tree,
    wsdls,
)
from conformance.selftest.mutants.mutant import Fault
from conformance.selftest.wire import Answer

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Ask

    Forward = Callable[[Ask], Answer]

_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_ACT, _READ = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest"), soap("Get[A-Z][A-Za-z]+")


def enveloped(content: str, status: int = 200) -> Callable[[Ask], Answer]:
    """An envelope of one's own."""
    body = f'<s:Envelope xmlns:s="{SOAP}"><s:Body>{content}</s:Body></s:Envelope>'.encode()
    return lambda ask: Answer(status, [("Content-Type", "text/xml; charset=utf-8")], body, asked=ask.method)


def fault(code: str, string: str) -> Callable[[Ask], Answer]:
    """A well-made SOAP fault."""
    return enveloped(f"<s:Fault><faultcode>s:{code}</faultcode><faultstring>{string}</faultstring></s:Fault>", 500)


def _without(name: str) -> Callable[[Any], None]:
    def edit(root: Any) -> None:
        for node in named(root, name)[:1]:
            node.getparent().remove(node)

    return edit


def _said(name: str, value: str) -> Callable[[Any], None]:
    def edit(root: Any) -> None:
        for node in named(root, name):
            node.text = value

    return edit


def _content(root: Any) -> None:
    body = named(root, "Body")[0]
    for wrapper in body:
        etree.SubElement(wrapper, "accepted").text = "true"


def _other_namespace(root: Any) -> None:
    for wrapper in named(root, "Body")[0]:
        wrapper.tag = etree.QName("http://ros-ws.org", etree.QName(wrapper).localname).text


def _reversed_path(root: Any) -> None:
    poses = named(root, "poses")
    if len(poses) > 1:
        parent = poses[0].getparent()
        for pose in poses:
            parent.remove(pose)
        parent.extend(reversed(poses))


def _written(pattern: bytes) -> Callable[[Ask], bool]:
    compiled = re.compile(pattern)
    return lambda ask: _ACT(ask) and bool(compiled.search(ask.body))


def _code_three(ask: Ask) -> None:
    ask.body = re.sub(rb"(message_code>\s*)[+-]?(?!0*[34]\s*<)\d{1,9}(\s*<)", rb"\g<1>3\2", ask.body)


def _empty_plan(ask: Ask, forward: Forward) -> Answer:
    """Where there is no plan, GetPlan gives an empty one."""
    answer = forward(ask)
    if soap("GetPlan")(ask) and b"Fault" in answer.body:
        header = "<header><stamp><sec>1</sec><nanosec>0</nanosec></stamp><frame_id>map</frame_id></header>"
        return enveloped(
            f'<t:GetPlanResponse xmlns:t="{TNS}"><return><plan>{header}</plan></return></t:GetPlanResponse>'
        )(ask)
    return answer


def _no_goal_page(ask: Ask, forward: Forward) -> Answer:
    """Without a goal, GetGoal is a page with 404."""
    answer = forward(ask)
    if soap("GetGoal")(ask) and (not success(answer) or b"return" not in answer.body):
        return Answer(404, [("Content-Type", "text/html")], b"<html>no goal</html>", asked=ask.method)
    return answer


def _coffee_for_all(root: Any) -> None:
    for wrapper in named(root, "ExecuteDeliveryRequestResponse"):
        wrapper.tag = f"{{{TNS}}}ExecuteCoffeeRequestResponse"


def _fault(name: str, says: str, id_: str, make: Any) -> Fault:
    return Fault(name, says, (id_,), "soap", make)


# zeep writes what the description says: here, elements in the namespace, which the robot does not take.
_QUALIFIED = altered(wsdls, text(r"(<(?:\w+:)?schema\b)(?=[^>]*targetNamespace)", r'\1 elementFormDefault="qualified"'))

FAULTS = (
    _fault(
        "soap-delivery-refused",
        "ExecuteDeliveryRequest is always a fault.",
        "soap-delivery/delivery",
        instead(_DELIVERY, fault("Server", "no deliveries today")),
    ),
    _fault(
        "soap-delivery-cross-answer",
        "ExecuteDeliveryRequest is answered with the coffee's response.",
        "soap-delivery/delivery",
        altered(_DELIVERY, tree(_coffee_for_all)),
    ),
    _fault(
        "soap-coffee-unknown",
        "ExecuteCoffeeRequest is not known.",
        "soap-delivery/coffee",
        instead(_COFFEE, fault("Client", "Cannot find dispatch method")),
    ),
    _fault(
        "soap-response-full",
        "The response wrapper holds a value.",
        "soap-delivery/response-valid",
        altered(_ACT, tree(_content)),
    ),
    _fault(
        "soap-response-namespace",
        "The response is in the second listing's namespace.",
        "soap-delivery/response-valid",
        altered(_ACT, tree(_other_namespace)),
    ),
    _fault(
        "soap-response-soap12",
        "The response is a SOAP 1.2 envelope.",
        "soap-delivery/response-valid",
        altered(_ACT, text(re.escape(SOAP), "http://www.w3.org/2003/05/soap-envelope")),
    ),
    _fault(
        "soap-no-exponents",
        "Doubles with an exponent are a fault.",
        "soap-delivery/range",
        instead(_written(rb">\s*[+-]?[\d.]+[eE][+-]?\d+\s*<"), fault("Client", "no number")),
    ),
    _fault(
        "soap-no-negatives",
        "Negative doubles are a fault.",
        "soap-delivery/range",
        instead(_written(rb">\s*-[\d.]"), fault("Client", "negative")),
    ),
    _fault(
        "soap-no-white-space",
        "White space around a number is a fault.",
        "soap-delivery/range",
        instead(_written(rb"<(?:\w+:)?(?:depot|source|destination)_[xy]>\s+[\d.+-]"), fault("Client", "white space")),
    ),
    _fault(
        "soap-wants-prefixes",
        "A default namespace is a fault.",
        "soap-delivery/syntax",
        instead(_written(rb"\sxmlns=[\"']http"), fault("Client", "default namespace")),
    ),
    _fault(
        "soap-no-cdata",
        "CDATA is a fault.",
        "soap-delivery/syntax",
        instead(_written(rb"<!\[CDATA\["), fault("Client", "CDATA")),
    ),
    _fault(
        "soap-no-comments",
        "A comment is a fault.",
        "soap-delivery/syntax",
        instead(_written(rb"<!--"), fault("Client", "comment")),
    ),
    _fault(
        "soap-description-misleads",
        "The WSDL says that elements are qualified, and they are not.",
        "soap-delivery/interop",
        _QUALIFIED,
    ),
    _fault(
        "soap-no-addressing",
        "WS-Addressing headers are a MustUnderstand fault.",
        "soap-delivery/addressing",
        instead(_written(rb"www\.w3\.org/2005/08/addressing"), fault("MustUnderstand", "addressing")),
    ),
    _fault(
        "soap-any-code", "Any code is accepted over SOAP.", "soap-delivery/refuses-code", rewritten(_ACT, _code_three)
    ),
    _fault(
        "soap-pose-short",
        "GetPose has 35 covariances.",
        "soap-subscribers/pose",
        altered(soap("GetPose"), tree(_without("covariance"))),
    ),
    _fault(
        "soap-velocity-half",
        "GetVelocity has no angular part.",
        "soap-subscribers/velocity",
        altered(soap("GetVelocity"), tree(_without("angular"))),
    ),
    _fault(
        "soap-sensors-untyped",
        "GetSensors has no types.",
        "soap-subscribers/sensors",
        altered(soap("GetSensors"), tree(_without("type"))),
    ),
    _fault(
        "soap-services-fault",
        "GetNavigationServices is a fault.",
        "soap-subscribers/services",
        instead(soap("GetNavigationServices"), fault("Server", "not today")),
    ),
    _fault(
        "soap-services-unnamed",
        "GetNavigationServices lacks a name.",
        "soap-subscribers/services",
        altered(soap("GetNavigationServices"), tree(_without("name"))),
    ),
    _fault("soap-no-goal-page", "Without a goal, GetGoal is a page.", "soap-subscribers/goal", lambda: _no_goal_page),
    _fault(
        "soap-plan-reversed",
        "GetPlan gives the way back.",
        "soap-subscribers/plan",
        altered(soap("GetPlan"), tree(_reversed_path)),
    ),
    _fault(
        "soap-plan-other-frame",
        "GetPlan's path is in another frame.",
        "soap-subscribers/plan",
        altered(soap("GetPlan"), tree(_said("frame_id", "base_link"))),
    ),
    _fault(
        "soap-plan-none-empty",
        "Where there is no plan, GetPlan gives an empty one.",
        "soap-subscribers/plan-none",
        lambda: _empty_plan,
    ),
    _fault(
        "soap-read-namespace",
        "Responses of the subscribers service are in another namespace.",
        "soap-subscribers/response-valid",
        altered(_READ, tree(_other_namespace)),
    ),
    _fault(
        "soap-read-extra",
        "Responses of the subscribers service hold an element of the robot's own.",
        "soap-subscribers/response-valid",
        altered(_READ, tree(_content)),
    ),
    _fault(
        "soap-read-description-misleads",
        "The WSDL says that elements are qualified, and they are not.",
        "soap-subscribers/interop",
        _QUALIFIED,
    ),
)
