"""Ways to lose, double, reorder and distort deliveries and velocities between a client and ROS."""

from __future__ import annotations

import re
import struct
import threading
from typing import TYPE_CHECKING, Any

from conformance.selftest.mutants.changes import deliveries, plain, soap

if TYPE_CHECKING:
    from collections.abc import Callable

    from conformance.selftest.wire import Answer, Ask

    Forward = Callable[[Ask], Answer]

_COFFEE = soap("ExecuteCoffeeRequest")
_BOTH = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")
_CODE_PLACE = 4
_DOUBLES = rb"(<(?:\w+:)?(?:depot|destination|source)_[xy][^>]*>\s*)([^<\s]+)(\s*<)"


def doubled(where: Callable[[Ask], bool]) -> Callable[[], Any]:
    """Every request is carried out twice, and answered once."""

    def change(ask: Ask, forward: Forward) -> Answer:
        if where(ask):
            forward(ask)
        return forward(ask)

    return lambda: change


class EveryNth:
    """Each nth is answered and forgotten."""

    def __init__(self, where: Callable[[Ask], bool], answer: Callable[[Ask], Answer], nth: int) -> None:
        self._where, self._answer, self._nth = where, answer, nth
        self._seen = 0

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        """See proxy.Change."""
        if self._where(ask):
            self._seen += 1
            if self._seen % self._nth == 0:
                return self._answer(ask)
        return forward(ask)


class OutOfOrder:
    """A REST delivery waits for the next delivery, which overtakes it, or until somebody looks what has arrived."""

    def __init__(self) -> None:
        self._held: tuple[Ask, Forward] | None = None
        self._lock = threading.Lock()

    def __call__(self, ask: Ask, forward: Forward) -> Answer:
        """See proxy.Change."""
        overtaking = deliveries(ask) or _BOTH(ask)
        with self._lock:
            held, self._held = self._held, None
            if held is None and deliveries(ask):
                self._held = (ask.copy(), forward)
                return plain(204)(ask)
        if held is not None and not overtaking:
            held[1](held[0])
        answer = forward(ask)
        if held is not None and overtaking:
            held[1](held[0])
        return answer


def float32(text: str) -> str:
    """A number as it comes out of a 32-bit float."""
    try:
        return repr(struct.unpack("f", struct.pack("f", float(text)))[0])
    except (ValueError, OverflowError, struct.error):
        return text


def narrow(place: int, text: str) -> str:
    """A value of a delivery path through a 32-bit float."""
    return text if place == _CODE_PLACE else float32(text)


def narrow_soap(ask: Ask) -> None:
    """The doubles of a SOAP delivery through 32-bit floats."""
    ask.body = re.sub(
        _DOUBLES, lambda found: found[1] + float32(found[2].decode("latin-1")).encode() + found[3], ask.body
    )


def rounded_soap(ask: Ask) -> None:
    """The doubles of a SOAP delivery cut after three digits."""

    def short(found: re.Match[bytes]) -> bytes:
        text = found[2].decode("latin-1")
        digits = re.fullmatch(r"([+-]?\d*\.\d{3})\d+", text)
        return found[1] + (digits[1] if digits else text).encode() + found[3]

    ask.body = re.sub(_DOUBLES, short, ask.body)


def swapped_soap(ask: Ask) -> None:
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


def as_delivery(ask: Ask, forward: Forward) -> Answer:
    """A coffee is published with the code that it came with, 3 as it happens."""
    if not _COFFEE(ask):
        return forward(ask)
    body = ask.body.replace(b"ExecuteCoffeeRequest", b"ExecuteDeliveryRequest")
    answer = forward(ask.copy(body=re.sub(rb"(message_code[^>]*>\s*)[+-]?\d+", rb"\g<1>3", body)))
    answer.body = answer.body.replace(b"ExecuteDeliveryRequest", b"ExecuteCoffeeRequest")
    return answer


def narrow_twist(twist: Any) -> None:
    """A velocity through 32-bit floats."""
    try:
        for part, axis in (("linear", "x"), ("angular", "z")):
            twist[part][axis] = float(float32(repr(float(twist[part][axis]))))
    except (TypeError, KeyError, ValueError):
        return
