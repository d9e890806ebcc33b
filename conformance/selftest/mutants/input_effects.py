"""Robots that refuse what is invalid, and do it all the same."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from conformance.selftest.mutants.changes import DELIVERIES, GOAL, LINEAR, POSE, VELOCITY, deliveries, parsed, rest
from conformance.selftest.mutants.mutant import Fault

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Answer, Ask

    Forward = Callable[[Ask], Answer]

_ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}
_INVALID = {400, 415, 422}


def sent(ask: Ask, forward: Forward, method: str, target: str, value: Any = None) -> Answer:
    """A request of the proxy's own to the robot."""
    fields = [("Host", "robot"), ("Accept", "application/json")]
    body = b"" if value is None else json.dumps(value).encode()
    if body:
        fields.append(("Content-Type", "application/json"))
    made = ask.copy(side="rest", method=method, target=target, body=body, raw=None)
    made.fields = fields
    return forward(made)


def drive(ask: Ask, forward: Forward, speed: float) -> None:
    """Set the robot in motion, or stop it."""
    sent(ask, forward, "PUT", VELOCITY, {"linear": {**_ZERO, "x": speed}, "angular": _ZERO})


def goal_ahead(ask: Ask, forward: Forward, distance: float) -> None:
    """Send a goal beside where the robot stands, in the odometry's frame."""
    odometry = parsed(sent(ask, forward, "GET", POSE).body)
    at = odometry["pose"]["pose"]["position"]
    pose = {"position": {"x": at["x"] + distance, "y": at["y"], "z": 0.0}, "orientation": {**_ZERO, "w": 1.0}}
    target = {"header": {"frame_id": odometry["header"]["frame_id"]}, "pose": pose}
    sent(ask, forward, "PUT", GOAL, {"goal": {"target_pose": target}})


def _after_refusal(where: Callable[[Ask], bool], act: Callable[[Ask, Forward], None]) -> Callable[[], Any]:
    def change(ask: Ask, forward: Forward) -> Answer:
        answer = forward(ask)
        if where(ask) and answer.status in _INVALID:
            act(ask, forward)
        return answer

    return lambda: change


def _deliver(ask: Ask, forward: Forward) -> None:
    path = f"{DELIVERIES}3/depot_x/1/depot_y/2/dest_x/3/dest_y/4/source_x/5/source_y/6"
    sent(ask, forward, "PUT", path)


def _soap_refusal(ask: Ask, forward: Forward) -> Answer:
    """What is refused over SOAP is delivered all the same."""
    answer = forward(ask)
    if ask.side == "soap" and b"Execute" in ask.body and b"Fault" in answer.body:
        # Only SOAP's side is at hand here: a valid message in place of the refused one.
        values = "".join(f"<{name}>1</{name}>" for name in ("depot_x", "depot_y", "destination_x", "destination_y"))
        message = f"<arg0>{values}<message_code>3</message_code><source_x>1</source_x><source_y>1</source_y></arg0>"
        body = (
            '<e:Envelope xmlns:e="http://schemas.xmlsoap.org/soap/envelope/"><e:Body>'
            f'<t:ExecuteDeliveryRequest xmlns:t="http://soap.turtlebot.mybot.org/">{message}</t:ExecuteDeliveryRequest>'
            "</e:Body></e:Envelope>"
        )
        made = ask.copy(body=body.encode())
        made.put("Content-Type", "text/xml; charset=utf-8")
        forward(made)
    return answer


FAULTS = (
    Fault(
        "input-velocity-refused-and-driven",
        "An invalid velocity is refused, and the robot drives.",
        ("strict-input/velocity-refused",),
        "rest",
        _after_refusal(rest("PUT", VELOCITY, LINEAR), lambda ask, forward: drive(ask, forward, 0.2)),
    ),
    Fault(
        "input-goal-refused-and-taken",
        "An invalid goal is refused, and the robot has a goal.",
        ("strict-input/goal-refused",),
        "rest",
        _after_refusal(rest("PUT", GOAL), lambda ask, forward: goal_ahead(ask, forward, 0.5)),
    ),
    Fault(
        "input-delivery-refused-and-made",
        "An invalid delivery is refused, and published.",
        ("strict-input/delivery-refused",),
        "rest",
        _after_refusal(deliveries, _deliver),
        observer=True,
    ),
    Fault(
        "input-soap-refused-and-made",
        "An invalid SOAP delivery is refused, and published.",
        ("strict-input/delivery-refused",),
        "soap",
        lambda: _soap_refusal,
        observer=True,
    ),
)
