"""Mutants that return an error and carry the request out nevertheless."""

import json
import re
from collections.abc import Callable, Container
from typing import Any

from proof.mutation.changes import SOAP, Make, parsed, posted, problem, rest, success, unwanted
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.table1.mutants.paths import DELIVERIES, GOAL, POSE, TNS, VELOCITY, deliveries
from proof.table1.mutants.soap_responses import envelop

MUTANTS = Table()
_mutant = MUTANTS.of_class("strict-input", "rest")

_ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}
_INVALID = {400, 415, 422}
# The namespace of the Envelope that one test sends in place of SOAP's.
_ENVELOPE = re.compile(rb"http://example\.com/unknown")


def send_own(request: Request, forward: Forward, method: str, target: str, value: Any = None) -> Response:
    """Send a request of the mutant's own to the robot."""
    fields = [("Host", "localhost"), ("Accept", "application/json")]
    body = b"" if value is None else json.dumps(value).encode()
    if body:
        fields.append(("Content-Type", "application/json"))
    made = request.copy(side="rest", method=method, target=target, body=body, raw=None)
    made.fields = fields
    return forward(made)


def drive(request: Request, forward: Forward, speed: float) -> None:
    """Send the robot a velocity of ``speed``, m/s; 0 stops it."""
    send_own(request, forward, "PUT", VELOCITY, {"linear": {**_ZERO, "x": speed}, "angular": _ZERO})


def goal_ahead(request: Request, forward: Forward, distance: float) -> None:
    """Send a goal ``distance`` m beside the robot, in the odometry's frame, where the robot accepts one."""
    odometry = parsed(send_own(request, forward, "GET", POSE).body)
    at = odometry["pose"]["pose"]["position"]
    for away in (distance, -distance):
        pose = {"position": {"x": at["x"] + away, "y": at["y"], "z": 0.0}, "orientation": {**_ZERO, "w": 1.0}}
        target = {"header": {"frame_id": odometry["header"]["frame_id"]}, "pose": pose}
        if send_own(request, forward, "PUT", GOAL, {"goal": {"target_pose": target}}).status in {200, 201, 202}:
            return


def _give_up(request: Request, forward: Forward) -> None:
    send_own(request, forward, "DELETE", GOAL)


def after_refusal(
    where: Callable[[Request], bool],
    act: Callable[[Request, Forward], None],
    statuses: Container[int] = frozenset(_INVALID),
) -> Make:
    """Return a change that calls ``act`` after the robot has refused a request with one of the statuses."""

    def change(request: Request, forward: Forward) -> Response:
        response = forward(request)
        if where(request) and response.status in statuses:
            act(request, forward)
        return response

    return lambda: change


def _deliver(request: Request, forward: Forward) -> None:
    path = f"{DELIVERIES}3/depot_x/1/depot_y/2/dest_x/3/dest_y/4/source_x/5/source_y/6"
    send_own(request, forward, "PUT", path)


@_mutant(
    "http-406-and-delivered", "http/not-acceptable-undone", "A delivery returns 406 and is published.", observer=True
)
def _delivered_in_vain(request: Request, forward: Forward) -> Response:
    response = forward(request)
    in_vain = unwanted(deliveries)(request) and success(response)
    return problem(406, "nothing that you would have")(request) if in_vain else response


def _ordered_by(method: str) -> Make:
    """Return a change that publishes a delivery when its path is requested with ``method``."""

    def change(request: Request, forward: Forward) -> Response:
        if deliveries(request.copy(method="PUT")) and request.method == method:
            forward(request.copy(method="PUT"))
        return forward(request)

    return lambda: change


@_mutant(
    "input-soap-refused-and-made",
    "delivery-refused",
    "An invalid SOAP delivery returns a fault and is published.",
    observer=True,
    interface="soap",
)
def _soap_refusal(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if request.side == "soap" and b"Execute" in request.body and b"Fault" in response.body:
        # Only the SOAP interface is available here: send a valid message in place of the refused one.
        values = "".join(f"<{name}>1</{name}>" for name in ("depot_x", "depot_y", "destination_x", "destination_y"))
        message = f"<arg0>{values}<message_code>3</message_code><source_x>1</source_x><source_y>1</source_y></arg0>"
        envelope = envelop(f'<t:ExecuteDeliveryRequest xmlns:t="{TNS}">{message}</t:ExecuteDeliveryRequest>')
        made = request.copy(body=envelope(request).body)
        made.put("Content-Type", "text/xml; charset=utf-8")
        forward(made)
    return response


@_mutant(
    "input-old-version-refused-and-made",
    "delivery-refused",
    "A delivery in an Envelope of another version returns a VersionMismatch fault and is published.",
    observer=True,
    interface="soap",
)
def _old_version(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if posted(request) and b"Execute" in request.body and b"VersionMismatch" in response.body:
        forward(request.copy(body=_ENVELOPE.sub(SOAP.encode(), request.body)))
    return response


@_mutant(
    "input-other-media-type-refused-and-made",
    "delivery-refused",
    "A delivery in a message under another media type returns 415 and is published.",
    observer=True,
    interface="soap",
)
def _other_media_type(request: Request, forward: Forward) -> Response:
    response = forward(request)
    if posted(request) and b"Execute" in request.body and response.status == 415:
        fields = [pair for pair in request.fields if pair[0].lower() != "content-type"]
        forward(request.copy(fields=[*fields, ("Content-Type", "text/xml; charset=utf-8")]))
    return response


@_mutant(
    "input-delivery-with-a-slash",
    "delivery-refused",
    "A delivery with a slash at the end of its path returns 404 and is published.",
    observer=True,
)
def _slash(request: Request, forward: Forward) -> Response:
    if deliveries(request) and request.path.endswith("/"):
        send_own(request, forward, "PUT", request.path[:-1])
        return problem(404, "nothing is there")(request)
    return forward(request)


@_mutant("input-goal-without-slash", "goal-refused", "A goal to the path without its slash returns 404 and is taken.")
def _no_slash(request: Request, forward: Forward) -> Response:
    if rest("PUT", GOAL.rstrip("/"))(request):
        send_own(request, forward, "PUT", GOAL, parsed(request.body))
        return problem(404, "nothing is there")(request)
    return forward(request)
