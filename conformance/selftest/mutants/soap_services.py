"""Robots whose SOAP services answer something else than they were asked."""

import re
from collections.abc import Callable
from typing import Any

from conformance.selftest.change import Forward
from conformance.selftest.messages import Request, Response
from conformance.selftest.mutants.changes import (
    SOAP,
    TNS,
    altered,
    instead,
    rewritten,
    soap,
    success,
    text,
    tree,
    wsdls,
)
from conformance.selftest.mutants.mutant import Mutant
from conformance.selftest.mutants.soap_responses import (
    coffee_for_all,
    enveloped,
    fault,
    other_namespace,
    unavailable,
    with_content,
    without,
)

_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_ACT, _READ = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest"), soap("Get[A-Z][A-Za-z]+")


def _written(pattern: bytes) -> Callable[[Request], bool]:
    compiled = re.compile(pattern)
    return lambda request: _ACT(request) and bool(compiled.search(request.body))


def _code_three(request: Request) -> None:
    request.body = re.sub(rb"(message_code>\s*)[+-]?(?!0*[34]\s*<)\d{1,9}(\s*<)", rb"\g<1>3\2", request.body)


def _empty_plan(request: Request, forward: Forward) -> Response:
    """Where there is no plan, GetPlan gives an empty one."""
    response = forward(request)
    if soap("GetPlan")(request) and b"Fault" in response.body:
        header = "<header><stamp><sec>1</sec><nanosec>0</nanosec></stamp><frame_id>map</frame_id></header>"
        return enveloped(
            f'<t:GetPlanResponse xmlns:t="{TNS}"><return><plan>{header}</plan></return></t:GetPlanResponse>'
        )(request)
    return response


def _no_goal_page(request: Request, forward: Forward) -> Response:
    """Without a goal, GetGoal is a page with 404."""
    response = forward(request)
    if soap("GetGoal")(request) and (not success(response) or b"return" not in response.body):
        return Response(404, [("Content-Type", "text/html")], b"<html>no goal</html>", method=request.method)
    return response


def _mutant(name: str, says: str, id_: str, make: Any) -> Mutant:
    return Mutant(name, says, (id_,), "soap", make)


# zeep writes what the description says: here, elements in the namespace, which the robot does not take.
_QUALIFIED = altered(wsdls, text(r"(<(?:\w+:)?schema\b)(?=[^>]*targetNamespace)", r'\1 elementFormDefault="qualified"'))

MUTANTS = (
    _mutant(
        "soap-delivery-refused",
        "ExecuteDeliveryRequest is always a fault.",
        "soap-delivery/delivery",
        instead(_DELIVERY, fault("Server", "no deliveries today")),
    ),
    _mutant(
        "soap-delivery-cross-answer",
        "ExecuteDeliveryRequest is answered with the coffee's response.",
        "soap-delivery/delivery",
        altered(_DELIVERY, tree(coffee_for_all)),
    ),
    _mutant(
        "soap-coffee-unknown",
        "ExecuteCoffeeRequest is not known.",
        "soap-delivery/coffee",
        instead(_COFFEE, fault("Client", "Cannot find dispatch method")),
    ),
    _mutant(
        "soap-coffee-sometimes-503",
        "One coffee in ten is refused with 503.",
        "soap-delivery/coffee",
        altered(_COFFEE, unavailable, nth=10),
    ),
    _mutant(
        "soap-response-full",
        "The response wrapper holds a value.",
        "soap-delivery/response-valid",
        altered(_ACT, tree(with_content)),
    ),
    _mutant(
        "soap-response-namespace",
        "The response is in the second listing's namespace.",
        "soap-delivery/response-valid",
        altered(_ACT, tree(other_namespace)),
    ),
    _mutant(
        "soap-response-soap12",
        "The response is a SOAP 1.2 envelope.",
        "soap-delivery/response-valid",
        altered(_ACT, text(re.escape(SOAP), "http://www.w3.org/2003/05/soap-envelope")),
    ),
    _mutant(
        "soap-no-exponents",
        "Doubles with an exponent are a fault.",
        "soap-delivery/range",
        instead(_written(rb">\s*[+-]?[\d.]+[eE][+-]?\d+\s*<"), fault("Client", "no number")),
    ),
    _mutant(
        "soap-no-plus",
        "Numbers with a plus sign are a fault.",
        "soap-delivery/range",
        instead(_written(rb">\s*\+[\d.]"), fault("Client", "plus sign")),
    ),
    _mutant(
        "soap-no-negatives",
        "Negative doubles are a fault.",
        "soap-delivery/range",
        instead(_written(rb">\s*-[\d.]"), fault("Client", "negative")),
    ),
    _mutant(
        "soap-no-white-space",
        "White space around a number is a fault.",
        "soap-delivery/range",
        instead(_written(rb"<(?:\w+:)?(?:depot|source|destination)_[xy]>\s+[\d.+-]"), fault("Client", "white space")),
    ),
    _mutant(
        "soap-wants-prefixes",
        "A default namespace is a fault.",
        "soap-delivery/syntax",
        instead(_written(rb"\sxmlns=[\"']http"), fault("Client", "default namespace")),
    ),
    _mutant(
        "soap-one-prefix",
        "An Envelope of another prefix than soapenv is a fault.",
        "soap-delivery/syntax",
        instead(_written(rb"<(?!soapenv:)(?:[\w.-]+:)?Envelope"), fault("Client", "no soapenv:Envelope")),
    ),
    _mutant(
        "soap-no-cdata",
        "CDATA is a fault.",
        "soap-delivery/syntax",
        instead(_written(rb"<!\[CDATA\["), fault("Client", "CDATA")),
    ),
    _mutant(
        "soap-no-comments",
        "A comment is a fault.",
        "soap-delivery/syntax",
        instead(_written(rb"<!--"), fault("Client", "comment")),
    ),
    _mutant(
        "soap-description-misleads",
        "The WSDL says that elements are qualified, and they are not.",
        "soap-delivery/interop",
        _QUALIFIED,
    ),
    _mutant(
        "soap-no-addressing",
        "WS-Addressing headers are a MustUnderstand fault.",
        "soap-delivery/addressing",
        instead(_written(rb"www\.w3\.org/2005/08/addressing"), fault("MustUnderstand", "addressing")),
    ),
    _mutant(
        "soap-any-code", "Any code is accepted over SOAP.", "soap-delivery/refuses-code", rewritten(_ACT, _code_three)
    ),
    _mutant(
        "soap-pose-short",
        "GetPose has 35 covariances.",
        "soap-subscribers/pose",
        altered(soap("GetPose"), tree(without("covariance"))),
    ),
    _mutant(
        "soap-velocity-half",
        "GetVelocity has no angular part.",
        "soap-subscribers/velocity",
        altered(soap("GetVelocity"), tree(without("angular"))),
    ),
    _mutant(
        "soap-sensors-untyped",
        "GetSensors has no types.",
        "soap-subscribers/sensors",
        altered(soap("GetSensors"), tree(without("type"))),
    ),
    _mutant(
        "soap-services-fault",
        "GetNavigationServices is a fault.",
        "soap-subscribers/services",
        instead(soap("GetNavigationServices"), fault("Server", "not today")),
    ),
    _mutant(
        "soap-services-unnamed",
        "GetNavigationServices lacks a name.",
        "soap-subscribers/services",
        altered(soap("GetNavigationServices"), tree(without("name"))),
    ),
    _mutant("soap-no-goal-page", "Without a goal, GetGoal is a page.", "soap-subscribers/goal", lambda: _no_goal_page),
    _mutant(
        "soap-plan-none-empty",
        "Where there is no plan, GetPlan gives an empty one.",
        "soap-subscribers/plan-none",
        lambda: _empty_plan,
    ),
    _mutant(
        "soap-read-namespace",
        "Responses of the subscribers service are in another namespace.",
        "soap-subscribers/response-valid",
        altered(_READ, tree(other_namespace)),
    ),
    _mutant(
        "soap-read-extra",
        "Responses of the subscribers service hold an element of the robot's own.",
        "soap-subscribers/response-valid",
        altered(_READ, tree(with_content)),
    ),
    _mutant(
        "soap-read-description-misleads",
        "The WSDL says that elements are qualified, and they are not.",
        "soap-subscribers/interop",
        _QUALIFIED,
    ),
)
