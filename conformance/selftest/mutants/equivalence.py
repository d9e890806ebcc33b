"""Robots whose interfaces tell different stories, of what was asked for and of what is."""

from collections.abc import Callable
from typing import Any

from conformance.selftest.mutants.changes import (
    SENSORS,
    TNS,
    VELOCITY,
    altered,
    deliveries,
    guarded,
    inputs,
    instead,
    plain,
    rest,
    rewritten,
    soap,
    values,
)
from conformance.selftest.mutants.delivery import segments
from conformance.selftest.mutants.distortion import (
    EveryNth,
    OutOfOrder,
    as_delivery,
    doubled,
    narrow,
    narrow_soap,
    rounded_soap,
    swapped_soap,
)
from conformance.selftest.mutants.mutant import of_class
from conformance.selftest.mutants.soap_responses import enveloped
from conformance.selftest.mutants.xml_trees import each, gone, named, tree

_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_BOTH = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")


def _shift(name: str, by: float) -> Callable[[Any], None]:
    def edit(root: Any) -> None:
        for node in named(root, name)[:1]:
            for axis in named(node, "x"):
                axis.text = repr(float(axis.text) + by)

    return edit


def _straighter(root: Any) -> None:
    poses = named(root, "poses")
    for pose in poses[1:-1]:
        pose.getparent().remove(pose)
    for axis in named(poses[-1], "y")[:1] if poses else []:
        axis.text = repr(float(axis.text) + 0.05)


def _halve(twist: Any) -> None:
    for part, axis in (("linear", "x"), ("angular", "z")):
        twist[part][axis] = twist[part][axis] / 2


def _one_more(items: Any) -> Any:
    return [*items, {"name": "ghost", "topic": "/ghost", "type": "sensor_msgs/msg/Range"}]


_rest_delivery = of_class("equivalence", "rest", observer=True)
_soap_delivery = of_class("equivalence", "soap", observer=True)
_rest_state = of_class("equivalence", "rest", probe=True)
_soap_state = of_class("equivalence", "soap")
_NO_GOAL = enveloped(f'<t:GetGoalResponse xmlns:t="{TNS}"/>')


MUTANTS = (
    _rest_delivery("same-rest-doubled", "A REST delivery is published twice.", "delivery-rest", doubled(deliveries)),
    _rest_delivery(
        "same-rest-lost",
        "Each third REST delivery is never published.",
        "delivery-rest",
        lambda: EveryNth(deliveries, plain(204), 3),
    ),
    _rest_delivery(
        "same-rest-narrow",
        "REST deliveries go through 32-bit floats.",
        "delivery-same",
        rewritten(deliveries, segments(narrow)),
    ),
    _soap_delivery("same-soap-doubled", "A SOAP delivery is published twice.", "delivery-soap", doubled(_DELIVERY)),
    _soap_delivery(
        "same-soap-swapped",
        "Over SOAP, source_x and destination_x are exchanged.",
        ("delivery-soap", "delivery-same"),
        rewritten(_BOTH, swapped_soap),
    ),
    _soap_delivery(
        "same-soap-narrow",
        "SOAP deliveries go through 32-bit floats.",
        "delivery-soap",
        rewritten(_DELIVERY, narrow_soap),
    ),
    _soap_delivery("same-coffee-code", "A coffee is published with code 3.", "coffee-soap", lambda: as_delivery),
    _soap_delivery(
        "same-coffee-lost",
        "Each second coffee is never published.",
        "coffee-soap",
        lambda: EveryNth(_COFFEE, enveloped(f'<t:ExecuteCoffeeRequestResponse xmlns:t="{TNS}"/>'), 2),
    ),
    _soap_delivery(
        "same-soap-rounded",
        "SOAP rounds to three digits, REST does not.",
        "delivery-same",
        rewritten(_BOTH, rounded_soap),
    ),
    _rest_delivery("same-order", "A REST delivery is overtaken by the one after it.", "delivery-order", OutOfOrder),
    _rest_state(
        "same-velocity-halved",
        "Half of a velocity reaches ROS.",
        "velocity-message",
        rewritten(rest("PUT", VELOCITY), inputs(guarded(_halve))),
    ),
    _rest_state(
        "same-sensor-ghost",
        "A sensor is listed that nobody publishes.",
        "sensors-graph",
        altered(rest("GET", SENSORS), values(_one_more)),
    ),
    _soap_state(
        "same-pose",
        "SOAP's pose is 37 cm ahead of REST's.",
        "pose",
        altered(soap("GetPose"), tree(_shift("position", 0.37))),
    ),
    _soap_state(
        "same-velocity",
        "SOAP's velocity is never zero.",
        "velocity",
        altered(soap("GetVelocity"), tree(_shift("linear", 0.1))),
    ),
    _soap_state(
        "same-sensors",
        "SOAP lacks the last sensor.",
        "sensors",
        altered(soap("GetSensors"), tree(each("return", gone, slice(-1, None)))),
    ),
    _soap_state(
        "same-services",
        "SOAP lacks the last service.",
        "services",
        altered(soap("GetNavigationServices"), tree(each("return", gone, slice(-1, None)))),
    ),
    _soap_state("same-goal", "SOAP never has a goal.", "goal", instead(soap("GetGoal"), _NO_GOAL)),
    _soap_state(
        "same-plan", "SOAP's plan is another one than REST's.", "plan", altered(soap("GetPlan"), tree(_straighter))
    ),
)
