"""Mutants whose SOAP operations return wrong responses or refuse valid messages."""

import re
from collections.abc import Callable

from conformance.mutation.changes import SOAP, Make, altered, page, soap, success, text, wsdls
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.table import Table
from conformance.mutation.xml_trees import each, gone, tree
from conformance.packs.table1.mutants.paths import TNS
from conformance.packs.table1.mutants.soap_responses import enveloped, fault, in_body, other_namespace, with_content

MUTANTS = Table()
_acting = MUTANTS.of_class("soap-delivery", "soap")
_reading = MUTANTS.of_class("soap-subscribers", "soap")

_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_ACT, _READ = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest"), soap("Get[A-Z][A-Za-z]+")


def _written(pattern: bytes) -> Callable[[Request], bool]:
    compiled = re.compile(pattern)
    return lambda request: _ACT(request) and bool(compiled.search(request.body))


def _lacking(operation: str, name: str) -> Make:
    """Return a change that removes the first element ``name`` from an operation's response."""
    return altered(soap(operation), tree(each(name, gone, slice(1))))


def _code_three(request: Request) -> None:
    request.body = re.sub(rb"(message_code>\s*)[+-]?(?!0*[34]\s*<)\d{1,9}(\s*<)", rb"\g<1>3\2", request.body)


@_reading("soap-plan-none-empty", "plan-none", "Where no plan exists, GetPlan returns an empty one.")
def _empty_plan(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if soap("GetPlan")(request) and b"Fault" in response.body:
        header = "<header><stamp><sec>1</sec><nanosec>0</nanosec></stamp><frame_id>map</frame_id></header>"
        return enveloped(
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


_acting("soap-delivery-refused", "delivery", "ExecuteDeliveryRequest always returns a fault.").instead(
    _DELIVERY, fault("Server", "no deliveries today")
)
_acting(
    "soap-delivery-cross-answer",
    "delivery",
    "ExecuteDeliveryRequest returns the response element of the coffee operation.",
).altered(_DELIVERY, text("ExecuteDeliveryRequestResponse", "ExecuteCoffeeRequestResponse"))
_acting("soap-coffee-unknown", "coffee", "ExecuteCoffeeRequest returns a fault: unknown operation.").instead(
    _COFFEE, fault("Client", "Cannot find dispatch method")
)
_acting("soap-coffee-sometimes-503", "coffee", "One coffee in ten returns 503.").altered(_COFFEE, page(503), nth=10)
_acting("soap-response-full", "response-valid", "The response wrapper contains an element.").altered(
    _ACT, in_body(with_content)
)
_acting("soap-response-namespace", "response-valid", "The response wrapper is in another namespace.").altered(
    _ACT, in_body(other_namespace)
)
_acting("soap-response-soap12", "response-valid", "The response is a SOAP 1.2 envelope.").altered(
    _ACT, text(re.escape(SOAP), "http://www.w3.org/2003/05/soap-envelope")
)
for _name, _requirement, _says, _pattern in (
    ("soap-no-exponents", "range", "Doubles with an exponent return a fault.", rb">\s*[+-]?[\d.]+[eE][+-]?\d+\s*<"),
    ("soap-no-types", "typed-values", "A value with xsi:type returns a fault.", rb":type="),
    (
        "soap-no-entities",
        "syntax",
        "A message with a predefined entity returns a fault.",
        rb"&(?:amp|lt|gt|quot|apos);",
    ),
    ("soap-no-plus", "range", "Numbers with a plus sign return a fault.", rb">\s*\+[\d.]"),
    ("soap-no-negatives", "range", "Negative doubles return a fault.", rb">\s*-[\d.]"),
    (
        "soap-no-white-space",
        "range",
        "White space around a number returns a fault.",
        rb"<(?:\w+:)?(?:depot|source|destination)_[xy]>\s+[\d.+-]",
    ),
    ("soap-wants-prefixes", "syntax", "A default namespace declaration returns a fault.", rb"\sxmlns=[\"']http"),
    (
        "soap-one-prefix",
        "syntax",
        "An Envelope with a prefix other than soapenv returns a fault.",
        rb"<(?!soapenv:)(?:[\w.-]+:)?Envelope",
    ),
    ("soap-no-cdata", "syntax", "A CDATA section returns a fault.", rb"<!\[CDATA\["),
    ("soap-no-comments", "syntax", "A comment returns a fault.", rb"<!--"),
):
    _acting(_name, _requirement, _says).instead(_written(_pattern), fault("Client", _says))
_acting(
    "soap-description-misleads",
    "interop",
    'The WSDL declares elementFormDefault="qualified", but the service expects unqualified elements.',
).made(_QUALIFIED)
_acting("soap-no-addressing", "addressing", "WS-Addressing headers return a MustUnderstand fault.").instead(
    _written(rb"www\.w3\.org/2005/08/addressing"), fault("MustUnderstand", "addressing")
)
_acting("soap-any-code", "refuses-code", "The robot accepts every message code over SOAP.").rewritten(_ACT, _code_three)
_reading("soap-pose-short", "pose", "GetPose returns 35 covariance values.").made(_lacking("GetPose", "covariance"))
_reading("soap-velocity-half", "velocity", "GetVelocity returns no angular part.").made(
    _lacking("GetVelocity", "angular")
)
_reading("soap-sensors-untyped", "sensors", "GetSensors returns sensors without a type.").made(
    _lacking("GetSensors", "type")
)
_reading("soap-services-fault", "services", "GetNavigationServices returns a fault.").instead(
    soap("GetNavigationServices"), fault("Server", "not today")
)
_reading("soap-services-unnamed", "services", "GetNavigationServices returns a service without a name.").made(
    _lacking("GetNavigationServices", "name")
)
_reading(
    "soap-read-namespace", "response-valid", "Responses of the subscribers service are in another namespace."
).altered(_READ, in_body(other_namespace))
_reading(
    "soap-read-extra", "response-valid", "Responses of the subscribers service contain an undeclared element."
).altered(_READ, in_body(with_content))
_reading(
    "soap-read-description-misleads",
    "interop",
    'The WSDL declares elementFormDefault="qualified", but the service expects unqualified elements.',
).made(_QUALIFIED)
