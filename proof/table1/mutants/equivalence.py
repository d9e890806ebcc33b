"""Mutants whose REST and SOAP interfaces disagree, or whose ROS messages differ from the requests."""

import re
import sys
from collections.abc import Callable
from typing import Any

from conformance.papers_robot.delivery import COFFEE, COORDINATES, PATH_NAMES
from proof.mutation.changes import Make, Where, becomes, rest, soap, success
from proof.mutation.messages import Forward, Request, Response
from proof.mutation.table import Table
from proof.mutation.xml_trees import find_named
from proof.table1.mutants.crowd import later
from proof.table1.mutants.paths import DELIVERIES, SENSORS, TNS, deliveries
from proof.table1.mutants.soap_responses import envelop

MUTANTS = Table()
_rest_delivery = MUTANTS.of_class("equivalence", "rest", observer=True)
_rest_state = MUTANTS.of_class("equivalence", "rest", probe=True)

_LATER_S, _SOON_S = 0.4, 0.05
_NUMBER = re.compile(r"[+-]?(\d+(\.\d+)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_COORDINATES = re.compile(rb"<(?:\w+:)?(\w+_[xy])(?:\s[^>]*)?>\s*([^<\s]+)\s*<")
_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_BOTH = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")


def _shift(name: str, by: float) -> Callable[[Any], None]:
    def edit(root: Any) -> None:
        for node in find_named(root, name)[:1]:
            for axis in find_named(node, "x"):
                axis.text = repr(float(axis.text) + by)

    return edit


def _mirror(root: Any) -> None:
    """Give a heading that is more than 90 degrees from x as the same to the other side."""
    for turn in find_named(root, "orientation")[:1]:
        parts = {axis: find_named(turn, axis)[0] for axis in "zw"}
        z, w = (float(part.text) for part in parts.values())
        if abs(z) > abs(w):
            parts["z"].text = repr(-z)


def _drop_sign(root: Any) -> None:
    for part in find_named(root, "linear"):
        for axis in find_named(part, "x"):
            axis.text = repr(abs(float(axis.text)))


def _straighter(root: Any) -> None:
    poses = find_named(root, "poses")
    for pose in poses[1:-1]:
        pose.getparent().remove(pose)
    for axis in find_named(poses[-1], "y")[:1] if poses else []:
        axis.text = repr(float(axis.text) + 0.05)


def _follow_by(where: Where, after_s: float, second: Callable[[Request], Request | None]) -> Make:
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


_NO_GOAL = envelop(f'<t:GetGoalResponse xmlns:t="{TNS}"/>')


def _cut(request: Request) -> None:
    """Cut a number in a SOAP request at the comment inside it, like a parser that reads only the first text node."""
    request.body = re.sub(rb"(>[^<>]+)<!--[^>]*-->[^<>]+<", rb"\1<", request.body)


_rest_delivery("same-rest-again-later", "delivery-only", "A REST delivery is published again 0.4 s later.").made(
    _follow_by(deliveries, _LATER_S, Request.copy)
)
_rest_state("same-sensor-ghost", "sensors-graph", "The list of sensors has a sensor that does not exist.").json(
    rest("GET", SENSORS), lambda items: [*items, {"name": "ghost", "topic": "/ghost", "type": "sensor_msgs/msg/Range"}]
)
