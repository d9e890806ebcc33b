"""Mutants whose SOAP operations return wrong responses or refuse valid messages."""

import re
from collections.abc import Callable

from conformance.mutation.changes import Make, altered, soap, success, text, wsdls
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.table import Table
from conformance.mutation.xml_trees import each, gone, tree
from conformance.packs.table1.mutants.paths import TNS
from conformance.packs.table1.mutants.soap_responses import enveloped, fault

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
