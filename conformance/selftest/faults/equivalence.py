"""Robots whose interfaces tell different stories, of what was asked for and of what is."""

from __future__ import annotations

import re
import struct
import threading
from typing import TYPE_CHECKING, Any

from conformance.selftest.faults.changing import (
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
from conformance.selftest.faults.delivery import segments
from conformance.selftest.faults.fault import Fault
from conformance.selftest.faults.soap_services import enveloped

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Answer, Ask

    Forward = Callable[[Ask], Answer]

_COFFEE, _DELIVERY = soap("ExecuteCoffeeRequest"), soap("ExecuteDeliveryRequest")
_BOTH = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")
_CODE_PLACE = 4
_DOUBLES = rb"(<(?:\w+:)?(?:depot|destination|source)_[xy][^>]*>\s*)([^<\s]+)(\s*<)"


def _doubled(where: Callable[[Ask], bool]) -> Callable[[], Any]:
    def change(ask: Ask, forward: Forward) -> Answer:
        if where(ask):
            forward(ask)
        return forward(ask)

    return lambda: change


class _EveryNth:
    """Each nth is answered and forgotten."""

    def __init__(self, where: Callable[[Ask], bool], answer: Callable[[Ask], Answer], nth: int) -> None:
        self._where, self._answer, self._nth = where, answer, nth
        self._seen = 0

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        if self._where(ask):
            self._seen += 1
            if self._seen % self._nth == 0:
                return self._answer(ask)
        return forward(ask)


class _OutOfOrder:
    """A delivery waits for the one after it, which overtakes it (or for a moment, when there is none)."""

    def __init__(self) -> None:
        self._held: tuple[Ask, Forward] | None = None
        self._lock = threading.Lock()

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        if not deliveries(ask):
            # Whoever looks at what has arrived finds everything, in the wrong order.
            self._let_go(forward)
            return forward(ask)
        with self._lock:
            held, self._held = self._held, None
            if held is None:
                self._held = (ask.copy(), forward)
                return plain(204)(ask)
        answer = forward(ask)
        forward(held[0])
        return answer

    def _let_go(self, forward: Forward) -> None:
        with self._lock:
            held, self._held = self._held, None
        if held is not None:
            forward(held[0])


def _float32(text: str) -> str:
    try:
        return repr(struct.unpack("f", struct.pack("f", float(text)))[0])
    except (ValueError, OverflowError, struct.error):
        return text


def _narrow(place: int, text: str) -> str:
    return text if place == _CODE_PLACE else _float32(text)


def _narrow_soap(ask: Ask) -> None:
    ask.body = re.sub(
        _DOUBLES, lambda found: found[1] + _float32(found[2].decode("latin-1")).encode() + found[3], ask.body
    )


def _rounded_soap(ask: Ask) -> None:
    def short(found: re.Match[bytes]) -> bytes:
        text = found[2].decode("latin-1")
        digits = re.fullmatch(r"([+-]?\d*\.\d{3})\d+", text)
        return found[1] + (digits[1] if digits else text).encode() + found[3]

    ask.body = re.sub(_DOUBLES, short, ask.body)


def _swapped_soap(ask: Ask) -> None:
    """Source and destination are exchanged, in their places."""
    found = {
        name: re.search(rb"<(?:\w+:)?%s[^>]*>([^<]*)<" % name, ask.body) for name in (b"source_x", b"destination_x")
    }
    one, other = found[b"source_x"], found[b"destination_x"]
    if one and other:
        first, second = sorted((one, other), key=lambda match: match.start(1))
        ask.body = (
            ask.body[: first.start(1)]
            + second[1]
            + ask.body[first.end(1) : second.start(1)]
            + first[1]
            + ask.body[second.end(1) :]
        )


def _as_delivery(ask: Ask, forward: Forward) -> Answer:
    """A coffee is published with the code that it came with, 3 as it happens."""
    if not _COFFEE(ask):
        return forward(ask)
    body = ask.body.replace(b"ExecuteCoffeeRequest", b"ExecuteDeliveryRequest")
    answer = forward(ask.copy(body=re.sub(rb"(message_code[^>]*>\s*)[+-]?\d+", rb"\g<1>3", body)))
    answer.body = answer.body.replace(b"ExecuteDeliveryRequest", b"ExecuteCoffeeRequest")
    return answer


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


def _fault(
    name: str,
    says: str,
    ids: tuple[str, ...],
    make: Any,
    interface: str = "both",
    *,
    observer: bool = False,
    probe: bool = False,
) -> Fault:
    return Fault(
        name, says, tuple(f"equivalence/{id_}" for id_ in ids), interface, make, observer=observer, probe=probe
    )


_NO_GOAL = enveloped(f'<t:GetGoalResponse xmlns:t="{TNS}"/>')


def _narrow_twist(twist: Any) -> None:
    try:
        for part, axis in (("linear", "x"), ("angular", "z")):
            twist[part][axis] = float(_float32(repr(float(twist[part][axis]))))
    except (TypeError, KeyError, ValueError):
        return


FAULTS = (
    _fault(
        "same-rest-doubled",
        "A REST delivery is published twice.",
        ("delivery-rest",),
        _doubled(deliveries),
        "rest",
        observer=True,
    ),
    _fault(
        "same-rest-lost",
        "Each third REST delivery is never published.",
        ("delivery-rest",),
        lambda: _EveryNth(deliveries, plain(204), 3),
        "rest",
        observer=True,
    ),
    _fault(
        "same-rest-narrow",
        "REST deliveries go through 32-bit floats.",
        ("delivery-rest",),
        rewritten(deliveries, segments(_narrow)),
        "rest",
        observer=True,
    ),
    _fault(
        "same-soap-doubled",
        "A SOAP delivery is published twice.",
        ("delivery-soap",),
        _doubled(_DELIVERY),
        "soap",
        observer=True,
    ),
    _fault(
        "same-soap-swapped",
        "Over SOAP, source_x and destination_x are exchanged.",
        ("delivery-soap", "delivery-same"),
        rewritten(_BOTH, _swapped_soap),
        "soap",
        observer=True,
    ),
    _fault(
        "same-soap-narrow",
        "SOAP deliveries go through 32-bit floats.",
        ("delivery-soap",),
        rewritten(_DELIVERY, _narrow_soap),
        "soap",
        observer=True,
    ),
    _fault(
        "same-coffee-code",
        "A coffee is published with code 3.",
        ("coffee-soap",),
        lambda: _as_delivery,
        "soap",
        observer=True,
    ),
    _fault(
        "same-coffee-lost",
        "Each second coffee is never published.",
        ("coffee-soap",),
        lambda: _EveryNth(_COFFEE, enveloped(f'<t:ExecuteCoffeeRequestResponse xmlns:t="{TNS}"/>'), 2),
        "soap",
        observer=True,
    ),
    _fault(
        "same-soap-rounded",
        "SOAP rounds to three digits, REST does not.",
        ("delivery-same",),
        rewritten(_BOTH, _rounded_soap),
        "soap",
        observer=True,
    ),
    _fault(
        "same-order",
        "A REST delivery is overtaken by the one after it.",
        ("delivery-order",),
        _OutOfOrder,
        "rest",
        observer=True,
    ),
    _fault(
        "same-velocity-narrow",
        "Velocities go through 32-bit floats.",
        ("velocity-message",),
        rewritten(rest("PUT", VELOCITY), inputs(_narrow_twist)),
        "rest",
        probe=True,
    ),
    _fault(
        "same-sensor-ghost",
        "A sensor is listed that nobody publishes.",
        ("sensors-graph",),
        altered(rest("GET", SENSORS), values(_one_more)),
        "rest",
        probe=True,
    ),
    _fault(
        "same-pose",
        "SOAP's pose is 37 cm ahead of REST's.",
        ("pose",),
        altered(soap("GetPose"), tree(_shift("position", 0.37))),
        "soap",
    ),
    _fault(
        "same-velocity",
        "SOAP's velocity is never zero.",
        ("velocity",),
        altered(soap("GetVelocity"), tree(_shift("linear", 0.1))),
        "soap",
    ),
    _fault(
        "same-sensors",
        "SOAP lacks the last sensor.",
        ("sensors",),
        altered(soap("GetSensors"), tree(_without_last)),
        "soap",
    ),
    _fault(
        "same-services",
        "SOAP lacks the last service.",
        ("services",),
        altered(soap("GetNavigationServices"), tree(_without_last)),
        "soap",
    ),
    _fault(
        "same-goal",
        "SOAP never has a goal.",
        ("goal",),
        lambda: lambda ask, forward: _NO_GOAL(ask) if soap("GetGoal")(ask) else forward(ask),
        "soap",
    ),
    _fault(
        "same-plan",
        "SOAP's plan is another one than REST's.",
        ("plan",),
        altered(soap("GetPlan"), tree(_straighter)),
        "soap",
    ),
)
