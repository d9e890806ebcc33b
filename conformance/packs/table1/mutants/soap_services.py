"""Mutants whose SOAP operations return wrong responses, refuse valid messages or are not there."""

import re
from collections.abc import Callable
from typing import Any

from conformance.mutation.changes import Make, altered, instead, plain, rest, soap, success, text, wsdls
from conformance.mutation.messages import Forward, HangUpError, Request, Response
from conformance.mutation.table import Table
from conformance.mutation.xml_trees import each, gone, named, says, tree
from conformance.packs.table1.mutants.paths import GOAL, TNS
from conformance.packs.table1.mutants.soap_responses import enveloped

MUTANTS = Table()
_reading = MUTANTS.of_class("soap-subscribers", "soap")

_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_ACT, _READ = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest"), soap("Get[A-Z][A-Za-z]+")


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


_POSE, _VELOCITY, _PLAN = soap("GetPose"), soap("GetVelocity"), soap("GetPlan")
_SMALL = 32 * 1024


def _first_is(parent: str, child: str, value: str) -> Callable[[Any], None]:
    return each(parent, each(child, says(value), slice(1)), slice(1))


def _swapped(root: Any) -> None:
    for node in named(root, "position"):
        node[:2] = [node[1], node[0]]


def _reversed_path(root: Any) -> None:
    poses = named(root, "poses")
    if len(poses) > 1:
        parent = poses[0].getparent()
        for pose in poses:
            parent.remove(pose)
        parent.extend(reversed(poses))


def _elsewhere(request: Request) -> None:
    request.body = re.sub(rb"(<(?:\w+:)?x>)[^<]*", rb"\g<1>7.5", request.body)


def _in_map(request: Request) -> None:
    request.body = request.body.replace(b"no_such_frame", b"map")


@_reading("soap-goal-lingers", "equivalence/goal", "GetGoal returns a goal that was reached.", interface="both")
class _Lingering:
    def __init__(self) -> None:
        self._last: Response | None = None

    def __call__(self, request: Request, forward: Forward) -> Response:
        response = forward(request)
        if rest("DELETE PUT", GOAL)(request):
            self._last = None
        if soap("GetGoal")(request):
            if b"target_pose" in response.body:
                self._last = response.copy()
            elif self._last is not None:
                return self._last.copy()
        return response


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
