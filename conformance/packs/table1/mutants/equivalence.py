"""Mutants whose REST and SOAP interfaces disagree, or whose ROS messages differ from the requests."""

import re
import sys
from collections.abc import Callable
from typing import Any

from conformance.mutation.changes import Make, Where, becomes, guarded, inputs, plain, rest, soap, success, unwanted
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.table import Table
from conformance.mutation.xml_trees import each, gone, named, says
from conformance.packs.table1.mutants.delivery import OnlyOnce, segments
from conformance.packs.table1.mutants.distortion import (
    EveryNth,
    First,
    ListedOnly,
    OutOfOrder,
    as_delivery,
    doubled,
    narrow,
    narrow_soap,
    rounded_soap,
    swapped_soap,
)
from conformance.packs.table1.mutants.in_background import later
from conformance.packs.table1.mutants.paths import DELIVERIES, SENSORS, TNS, VELOCITY, deliveries
from conformance.packs.table1.mutants.soap_responses import enveloped
from conformance.packs.table1.mutants.velocity import times
from conformance.papers_robot.delivery import COFFEE, COORDINATES, PATH_NAMES

MUTANTS = Table()
_rest_delivery = MUTANTS.of_class("equivalence", "rest", observer=True)
_soap_delivery = MUTANTS.of_class("equivalence", "soap", observer=True)
_rest_state = MUTANTS.of_class("equivalence", "rest", probe=True)
_soap_state = MUTANTS.of_class("equivalence", "soap")

_LATER_S, _SOON_S = 0.4, 0.05
_NUMBER = re.compile(r"[+-]?(\d+(\.\d+)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_COORDINATES = re.compile(rb"<(?:\w+:)?(\w+_[xy])(?:\s[^>]*)?>\s*([^<\s]+)\s*<")
_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_BOTH = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")


def _shift(name: str, by: float) -> Callable[[Any], None]:
    def edit(root: Any) -> None:
        for node in named(root, name)[:1]:
            for axis in named(node, "x"):
                axis.text = repr(float(axis.text) + by)

    return edit


def _mirrored(root: Any) -> None:
    """Give a heading that is more than 90 degrees from x as the same to the other side."""
    for turn in named(root, "orientation")[:1]:
        parts = {axis: named(turn, axis)[0] for axis in "zw"}
        z, w = (float(part.text) for part in parts.values())
        if abs(z) > abs(w):
            parts["z"].text = repr(-z)


def _unsigned(root: Any) -> None:
    for part in named(root, "linear"):
        for axis in named(part, "x"):
            axis.text = repr(abs(float(axis.text)))


def _straighter(root: Any) -> None:
    poses = named(root, "poses")
    for pose in poses[1:-1]:
        pose.getparent().remove(pose)
    for axis in named(poses[-1], "y")[:1] if poses else []:
        axis.text = repr(float(axis.text) + 0.05)


def _followed(where: Where, after_s: float, second: Callable[[Request], Request | None]) -> Make:
    """Return a change that sends a second request some time after a successful one, where there is one to send."""

    def change(request: Request, forward: Forward) -> Response:
        response = forward(request)
        other = second(request) if where(request) and success(response) else None
        if other is not None:
            later(after_s, forward, other)
        return response

    return lambda: change


def _elsewhere(request: Request) -> Request:
    return request.copy(target=f"{request.target.rpartition('/')[0]}/99.5")


def _by_rest(request: Request) -> Request | None:
    """Return a coffee as a REST request; None for one that is written in another encoding, or with entities in it."""
    values = {name.decode(): text.decode() for name, text in _COORDINATES.findall(request.body)}
    if not values.keys() >= set(COORDINATES):
        return None
    pairs = "".join(f"/{name}/{values[field]}" for name, field in zip(PATH_NAMES, COORDINATES, strict=True))
    fields = [("Host", "localhost"), ("Content-Length", "0")]
    return Request("rest", "PUT", f"{DELIVERIES}{COFFEE}{pairs}", fields=fields)


def _normal(_place: int, text: str) -> str:
    return "0" if _NUMBER.fullmatch(text) and 0 < abs(float(text)) < sys.float_info.min else text


def _unsigned_zero(_place: int, text: str) -> str:
    return text.lstrip("-") if _NUMBER.fullmatch(text) and float(text) == 0 else text


def _put_off(response: Response) -> None:
    becomes(503)(response)
    response.put("Retry-After", "1")


_NO_GOAL = enveloped(f'<t:GetGoalResponse xmlns:t="{TNS}"/>')


def _cut(request: Request) -> None:
    """Cut a number in a SOAP request at the comment inside it, like a parser that reads only the first text node."""
    request.body = re.sub(rb"(>[^<>]+)<!--[^>]*-->[^<>]+<", rb"\1<", request.body)


_rest_delivery("same-rest-again-later", "delivery-only", "A REST delivery is published again 0.4 s later.").made(
    _followed(deliveries, _LATER_S, Request.copy)
)
_rest_delivery(
    "same-rest-another-later",
    "delivery-only",
    "Shortly after a REST delivery, the robot publishes another delivery to another place.",
).made(_followed(deliveries, _SOON_S, _elsewhere))
_soap_delivery(
    "same-coffee-again-by-rest",
    "delivery-only",
    "A coffee that is ordered over SOAP is ordered again over REST 0.4 s later.",
).made(_followed(_COFFEE, _LATER_S, _by_rest))
_soap_delivery(
    "same-soap-cut-by-comments", "delivery-soap", "A number with a comment in it is read only up to the comment."
).rewritten(_DELIVERY, _cut)
_rest_delivery("same-rest-doubled", "delivery-rest", "A REST delivery is published twice.").made(doubled(deliveries))
_rest_delivery(
    "same-rest-unwanted-lost",
    "delivery-rest",
    "A REST delivery with an unacceptable Accept header returns 204 without any effect.",
).instead(unwanted(deliveries), plain(204))
_rest_delivery(
    "same-rest-any-key",
    "idempotency-other-key",
    "The same REST delivery with another Idempotency-Key returns 204 without any effect.",
).made(lambda: OnlyOnce(plain(204), keyed=True))
_rest_delivery(
    "same-rest-deduplicated",
    "delivery-repeated",
    "Sending the same REST delivery again returns 204 without any effect.",
).made(lambda: OnlyOnce(plain(204)))
_rest_delivery("same-rest-no-subnormals", "delivery-rest", "Numbers closer to zero than 2.2e-308 become 0.").rewritten(
    deliveries, segments(_normal)
)
_rest_delivery("same-rest-no-negative-zero", "delivery-rest", "The sign of -0 is lost.", probe=True).rewritten(
    deliveries, segments(_unsigned_zero)
)
_rest_delivery("same-rest-lost", "delivery-rest", "Every third REST delivery is lost.").made(
    lambda: EveryNth(deliveries, plain(204), 3)
)
_rest_delivery(
    "same-rest-put-off-and-made", "delivery-rest", "Every fifth REST delivery is put off by 503, and published."
).altered(deliveries, _put_off, nth=5)
_rest_delivery(
    "same-rest-listed-only", "delivery-rest", "REST deliveries are listed as accepted, and never published.", probe=True
).made(ListedOnly)
_rest_delivery("same-rest-narrow", "delivery-same", "REST deliveries go through 32-bit floats.").rewritten(
    deliveries, segments(narrow)
)
_soap_delivery("same-soap-doubled", "delivery-soap", "A SOAP delivery is published twice.").made(doubled(_DELIVERY))
_soap_delivery(
    "same-soap-swapped", ("delivery-soap", "delivery-same"), "Over SOAP, source_x and destination_x are swapped."
).rewritten(_BOTH, swapped_soap)
_soap_delivery("same-soap-narrow", "delivery-soap", "SOAP deliveries go through 32-bit floats.").rewritten(
    _DELIVERY, narrow_soap
)
_soap_delivery("same-coffee-code", "coffee-soap", "A coffee is published with code 3.")(as_delivery)
_soap_delivery("same-coffee-lost", "coffee-soap", "Every second coffee is lost.").made(
    lambda: EveryNth(_COFFEE, enveloped(f'<t:ExecuteCoffeeRequestResponse xmlns:t="{TNS}"/>'), 2)
)
_soap_delivery(
    "same-coffee-first-swapped", "coffee-soap", "The first coffee has the values of source_x and destination_x swapped."
).made(lambda: First(_COFFEE, swapped_soap))
_soap_delivery("same-soap-rounded", "delivery-same", "SOAP rounds to three digits; REST does not.").rewritten(
    _BOTH, rounded_soap
)
_rest_delivery("same-order", "delivery-order", "A REST delivery is published after the next one.").made(OutOfOrder)
_rest_state(
    "same-velocity-halved", "velocity-message", "The velocity message on ROS has half of the commanded values."
).rewritten(rest("PUT", VELOCITY), inputs(guarded(times(0.5))))
_rest_state("same-sensor-ghost", "sensors-graph", "The list of sensors has a sensor that does not exist.").json(
    rest("GET", SENSORS), lambda items: [*items, {"name": "ghost", "topic": "/ghost", "type": "sensor_msgs/msg/Range"}]
)
_soap_state("same-pose", "pose", "The pose over SOAP is 37 cm ahead of the pose over REST.").xml(
    soap("GetPose"), _shift("position", 0.37)
)
_soap_state("same-velocity", "velocity", "The velocity over SOAP is never zero.").xml(
    soap("GetVelocity"), _shift("linear", 0.1)
)
_soap_state("same-pose-mirrored", "pose", "GetPose mirrors a heading more than 90 degrees from x.").xml(
    soap("GetPose"), _mirrored
)
_soap_state("same-velocity-unsigned", "velocity", "GetVelocity returns a linear part without its sign.").xml(
    soap("GetVelocity"), _unsigned
)
_soap_state(
    "same-velocity-sometimes", "velocity", "One velocity in 60 over SOAP is 0.1 m/s higher than the odometry's."
).xml(soap("GetVelocity"), _shift("linear", 0.1), nth=60)
_soap_state("same-sensors", "sensors", "SOAP lacks the last sensor.").xml(
    soap("GetSensors"), each("return", gone, slice(-1, None))
)
_soap_state("same-services", "services", "SOAP lacks the last service.").xml(
    soap("GetNavigationServices"), each("return", gone, slice(-1, None))
)
_soap_state("same-goal", "goal", "GetGoal never returns a goal.").instead(soap("GetGoal"), _NO_GOAL)
_soap_state("same-goal-sometimes", "goal", "One goal in seven over SOAP is 1 cm off.").xml(
    soap("GetGoal"), _shift("position", 0.01), nth=7
)
_soap_state("same-pose-stamp-stuck", "pose", "One pose in 20 over SOAP has a stamp of the first second.").xml(
    soap("GetPose"), each("sec", says("1")), nth=20
)
_soap_state("same-plan", "plan", "The plan over SOAP differs from the plan over REST.").xml(
    soap("GetPlan"), _straighter
)
