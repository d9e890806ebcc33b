"""Robots whose SOAP services answer something else than they were asked."""

import re
from collections.abc import Callable

from conformance.mutation.changes import SOAP, Make, altered, instead, page, rewritten, soap, success, text, wsdls
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.mutant import of_class
from conformance.packs.table1.mutants.paths import TNS
from conformance.packs.table1.mutants.soap_responses import enveloped, fault, in_body, other_namespace, with_content
from conformance.packs.table1.mutants.xml_trees import each, gone, tree

_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_ACT, _READ = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest"), soap("Get[A-Z][A-Za-z]+")


def _written(pattern: bytes) -> Callable[[Request], bool]:
    compiled = re.compile(pattern)
    return lambda request: _ACT(request) and bool(compiled.search(request.body))


def _refused(pattern: bytes, why: str) -> Make:
    """Requests in which something is written so are Client faults."""
    return instead(_written(pattern), fault("Client", why))


def _lacking(operation: str, name: str) -> Make:
    """The first element with a name is not in the response."""
    return altered(soap(operation), tree(each(name, gone, slice(1))))


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


# zeep writes what the description says: here, elements in the namespace, which the robot does not take.
_QUALIFIED = altered(wsdls, text(r"(<(?:\w+:)?schema\b)(?=[^>]*targetNamespace)", r'\1 elementFormDefault="qualified"'))

_acting, _reading = of_class("soap-delivery", "soap"), of_class("soap-subscribers", "soap")

MUTANTS = (
    _acting(
        "soap-delivery-refused",
        "ExecuteDeliveryRequest is always a fault.",
        "delivery",
        instead(_DELIVERY, fault("Server", "no deliveries today")),
    ),
    _acting(
        "soap-delivery-cross-answer",
        "ExecuteDeliveryRequest is answered with the coffee's response.",
        "delivery",
        altered(_DELIVERY, text("ExecuteDeliveryRequestResponse", "ExecuteCoffeeRequestResponse")),
    ),
    _acting(
        "soap-coffee-unknown",
        "ExecuteCoffeeRequest is not known.",
        "coffee",
        instead(_COFFEE, fault("Client", "Cannot find dispatch method")),
    ),
    _acting(
        "soap-coffee-sometimes-503",
        "One coffee in ten is refused with 503.",
        "coffee",
        altered(_COFFEE, page(503), nth=10),
    ),
    _acting(
        "soap-response-full",
        "The response wrapper holds a value.",
        "response-valid",
        altered(_ACT, in_body(with_content)),
    ),
    _acting(
        "soap-response-namespace",
        "The response is in the second listing's namespace.",
        "response-valid",
        altered(_ACT, in_body(other_namespace)),
    ),
    _acting(
        "soap-response-soap12",
        "The response is a SOAP 1.2 envelope.",
        "response-valid",
        altered(_ACT, text(re.escape(SOAP), "http://www.w3.org/2003/05/soap-envelope")),
    ),
    _acting(
        "soap-no-exponents",
        "Doubles with an exponent are a fault.",
        "range",
        _refused(rb">\s*[+-]?[\d.]+[eE][+-]?\d+\s*<", "no number"),
    ),
    _acting(
        "soap-no-types", "A value that says its type is a fault.", "typed-values", _refused(rb":type=", "an attribute")
    ),
    _acting(
        "soap-no-entities",
        "A message with a predefined entity is a fault.",
        "syntax",
        _refused(rb"&(?:amp|lt|gt|quot|apos);", "entities are dangerous"),
    ),
    _acting("soap-no-plus", "Numbers with a plus sign are a fault.", "range", _refused(rb">\s*\+[\d.]", "plus sign")),
    _acting("soap-no-negatives", "Negative doubles are a fault.", "range", _refused(rb">\s*-[\d.]", "negative")),
    _acting(
        "soap-no-white-space",
        "White space around a number is a fault.",
        "range",
        _refused(rb"<(?:\w+:)?(?:depot|source|destination)_[xy]>\s+[\d.+-]", "white space"),
    ),
    _acting(
        "soap-wants-prefixes",
        "A default namespace is a fault.",
        "syntax",
        _refused(rb"\sxmlns=[\"']http", "default namespace"),
    ),
    _acting(
        "soap-one-prefix",
        "An Envelope of another prefix than soapenv is a fault.",
        "syntax",
        _refused(rb"<(?!soapenv:)(?:[\w.-]+:)?Envelope", "no soapenv:Envelope"),
    ),
    _acting("soap-no-cdata", "CDATA is a fault.", "syntax", _refused(rb"<!\[CDATA\[", "CDATA")),
    _acting("soap-no-comments", "A comment is a fault.", "syntax", _refused(rb"<!--", "comment")),
    _acting(
        "soap-description-misleads",
        "The WSDL says that elements are qualified, and they are not.",
        "interop",
        _QUALIFIED,
    ),
    _acting(
        "soap-no-addressing",
        "WS-Addressing headers are a MustUnderstand fault.",
        "addressing",
        instead(_written(rb"www\.w3\.org/2005/08/addressing"), fault("MustUnderstand", "addressing")),
    ),
    _acting("soap-any-code", "Any code is accepted over SOAP.", "refuses-code", rewritten(_ACT, _code_three)),
    _reading("soap-pose-short", "GetPose has 35 covariances.", "pose", _lacking("GetPose", "covariance")),
    _reading("soap-velocity-half", "GetVelocity has no angular part.", "velocity", _lacking("GetVelocity", "angular")),
    _reading("soap-sensors-untyped", "GetSensors has no types.", "sensors", _lacking("GetSensors", "type")),
    _reading(
        "soap-services-fault",
        "GetNavigationServices is a fault.",
        "services",
        instead(soap("GetNavigationServices"), fault("Server", "not today")),
    ),
    _reading(
        "soap-services-unnamed",
        "GetNavigationServices lacks a name.",
        "services",
        _lacking("GetNavigationServices", "name"),
    ),
    _reading("soap-no-goal-page", "Without a goal, GetGoal is a page.", "goal", lambda: _no_goal_page),
    _reading(
        "soap-plan-none-empty", "Where there is no plan, GetPlan gives an empty one.", "plan-none", lambda: _empty_plan
    ),
    _reading(
        "soap-read-namespace",
        "Responses of the subscribers service are in another namespace.",
        "response-valid",
        altered(_READ, in_body(other_namespace)),
    ),
    _reading(
        "soap-read-extra",
        "Responses of the subscribers service hold an element of the robot's own.",
        "response-valid",
        altered(_READ, in_body(with_content)),
    ),
    _reading(
        "soap-read-description-misleads",
        "The WSDL says that elements are qualified, and they are not.",
        "interop",
        _QUALIFIED,
    ),
)
