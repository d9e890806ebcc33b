"""Robots whose interfaces tell different stories, of what was asked for and of what is."""

from collections.abc import Callable
from typing import Any

from conformance.selftest.mutants.changes import (
    SENSORS,
    TNS,
    VELOCITY,
    altered,
    deliveries,
    inputs,
    named,
    plain,
    rest,
    rewritten,
    soap,
    tree,
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
    narrow_twist,
    rounded_soap,
    swapped_soap,
)
from conformance.selftest.mutants.mutant import Mutant
from conformance.selftest.mutants.soap_responses import enveloped

_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_BOTH = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")


def _shift(name: str, by: float) -> Callable[[Any], None]:
    def edit(root: Any) -> None:
        for node in named(root, name)[:1]:
            for axis in named(node, "x"):
                axis.text = repr(float(axis.text) + by)

    return edit


def _without_last(root: Any) -> None:
    for node in named(root, "return")[-1:]:
        node.getparent().remove(node)


def _straighter(root: Any) -> None:
    poses = named(root, "poses")
    for pose in poses[1:-1]:
        pose.getparent().remove(pose)
    for axis in named(poses[-1], "y")[:1] if poses else []:
        axis.text = repr(float(axis.text) + 0.05)


def _one_more(items: Any) -> Any:
    return [*items, {"name": "ghost", "topic": "/ghost", "type": "sensor_msgs/msg/Range"}]


def _mutant(
    name: str,
    says: str,
    ids: tuple[str, ...],
    make: Any,
    interface: str = "both",
    *,
    observer: bool = False,
    probe: bool = False,
) -> Mutant:
    return Mutant(
        name, says, tuple(f"equivalence/{id_}" for id_ in ids), interface, make, observer=observer, probe=probe
    )


_NO_GOAL = enveloped(f'<t:GetGoalResponse xmlns:t="{TNS}"/>')


MUTANTS = (
    _mutant(
        "same-rest-doubled",
        "A REST delivery is published twice.",
        ("delivery-rest",),
        doubled(deliveries),
        "rest",
        observer=True,
    ),
    _mutant(
        "same-rest-lost",
        "Each third REST delivery is never published.",
        ("delivery-rest",),
        lambda: EveryNth(deliveries, plain(204), 3),
        "rest",
        observer=True,
    ),
    _mutant(
        "same-rest-narrow",
        "REST deliveries go through 32-bit floats.",
        ("delivery-same",),
        rewritten(deliveries, segments(narrow)),
        "rest",
        observer=True,
    ),
    _mutant(
        "same-soap-doubled",
        "A SOAP delivery is published twice.",
        ("delivery-soap",),
        doubled(_DELIVERY),
        "soap",
        observer=True,
    ),
    _mutant(
        "same-soap-swapped",
        "Over SOAP, source_x and destination_x are exchanged.",
        ("delivery-soap", "delivery-same"),
        rewritten(_BOTH, swapped_soap),
        "soap",
        observer=True,
    ),
    _mutant(
        "same-soap-narrow",
        "SOAP deliveries go through 32-bit floats.",
        ("delivery-soap",),
        rewritten(_DELIVERY, narrow_soap),
        "soap",
        observer=True,
    ),
    _mutant(
        "same-coffee-code",
        "A coffee is published with code 3.",
        ("coffee-soap",),
        lambda: as_delivery,
        "soap",
        observer=True,
    ),
    _mutant(
        "same-coffee-lost",
        "Each second coffee is never published.",
        ("coffee-soap",),
        lambda: EveryNth(_COFFEE, enveloped(f'<t:ExecuteCoffeeRequestResponse xmlns:t="{TNS}"/>'), 2),
        "soap",
        observer=True,
    ),
    _mutant(
        "same-soap-rounded",
        "SOAP rounds to three digits, REST does not.",
        ("delivery-same",),
        rewritten(_BOTH, rounded_soap),
        "soap",
        observer=True,
    ),
    _mutant(
        "same-order",
        "A REST delivery is overtaken by the one after it.",
        ("delivery-order",),
        OutOfOrder,
        "rest",
        observer=True,
    ),
    _mutant(
        "same-velocity-narrow",
        "Velocities go through 32-bit floats.",
        ("velocity-message",),
        rewritten(rest("PUT", VELOCITY), inputs(narrow_twist)),
        "rest",
        probe=True,
    ),
    _mutant(
        "same-sensor-ghost",
        "A sensor is listed that nobody publishes.",
        ("sensors-graph",),
        altered(rest("GET", SENSORS), values(_one_more)),
        "rest",
        probe=True,
    ),
    _mutant(
        "same-pose",
        "SOAP's pose is 37 cm ahead of REST's.",
        ("pose",),
        altered(soap("GetPose"), tree(_shift("position", 0.37))),
        "soap",
    ),
    _mutant(
        "same-velocity",
        "SOAP's velocity is never zero.",
        ("velocity",),
        altered(soap("GetVelocity"), tree(_shift("linear", 0.1))),
        "soap",
    ),
    _mutant(
        "same-sensors",
        "SOAP lacks the last sensor.",
        ("sensors",),
        altered(soap("GetSensors"), tree(_without_last)),
        "soap",
    ),
    _mutant(
        "same-services",
        "SOAP lacks the last service.",
        ("services",),
        altered(soap("GetNavigationServices"), tree(_without_last)),
        "soap",
    ),
    _mutant(
        "same-goal",
        "SOAP never has a goal.",
        ("goal",),
        lambda: lambda request, forward: _NO_GOAL(request) if soap("GetGoal")(request) else forward(request),
        "soap",
    ),
    _mutant(
        "same-plan",
        "SOAP's plan is another one than REST's.",
        ("plan",),
        altered(soap("GetPlan"), tree(_straighter)),
        "soap",
    ),
)
