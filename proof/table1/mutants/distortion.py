"""Changes that lose, double, reorder or distort deliveries on their way to ROS."""

import re
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

from conformance.papers_robot.delivery import COORDINATES, PATH_NAMES
from proof.mutation.changes import plain, rest, soap, success, unwanted, values
from proof.mutation.messages import Forward, Request, Response
from proof.table1.mutants.paths import DELIVERIES, deliveries

_NUMBER = r"([+-]?(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][+-]?\d{1,2})?)"
_DELIVERY = re.compile(DELIVERIES + r"\+?0*([34])" + "".join(f"/{name}/{_NUMBER}" for name in PATH_NAMES), re.ASCII)
_UNWANTED, _LIST = unwanted(deliveries), rest("GET", DELIVERIES)
_BOTH = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")
_CODE_PLACE = 4
_DOUBLES = rb"(<(?:\w+:)?(?:depot|destination|source)_[xy][^>]*>\s*)([^<\s]+)(\s*<)"


def doubled(where: Callable[[Request], bool]) -> Callable[[], Any]:
    """Return a change that forwards each request twice and returns the second response."""

    def change(request: Request, forward: Forward) -> Response:
        if where(request):
            forward(request)
        return forward(request)

    return lambda: change


class EveryNth:
    """A change that answers every nth request itself, without forwarding it."""

    def __init__(self, where: Callable[[Request], bool], response: Callable[[Request], Response], nth: int) -> None:
        self._where, self._answer, self._nth = where, response, nth
        self._seen = 0

    def __call__(self, request: Request, forward: Forward) -> Response:
        """Forward the request, or answer it if it is an nth one."""
        if self._where(request):
            self._seen += 1
            if self._seen % self._nth == 0:
                return self._answer(request)
        return forward(request)


class First:
    """A change that rewrites the first request that is accepted."""

    def __init__(self, where: Callable[[Request], bool], edit: Callable[[Request], object]) -> None:
        self._where, self._edit = where, edit
        self._done = False

    def __call__(self, request: Request, forward: Forward) -> Response:
        """Forward the request, rewritten if none before it was accepted."""
        if self._done or not self._where(request):
            return forward(request)
        request = request.copy()
        self._edit(request)
        response = forward(request)
        self._done = success(response)
        return response


class OutOfOrder:
    """A change that forwards a REST delivery only after the next delivery, or before the next other request."""

    def __init__(self) -> None:
        self._held: tuple[Request, Forward] | None = None
        self._lock = threading.Lock()

    def __call__(self, request: Request, forward: Forward) -> Response:
        """Hold a delivery back until the next request has been forwarded."""
        overtaking = deliveries(request) or _BOTH(request)
        with self._lock:
            held, self._held = self._held, None
            if held is None and deliveries(request):
                self._held = (request.copy(), forward)
                return plain(204)(request)
        if held is not None and not overtaking:
            held[1](held[0])
        response = forward(request)
        if held is not None and overtaking:
            held[1](held[0])
        return response


def valid_delivery(request: Request) -> re.Match[str] | None:
    """Return the match of a delivery that every robot takes, with code and coordinates as groups; None for others."""
    return _DELIVERY.fullmatch(request.path) if deliveries(request) and not _UNWANTED(request) else None


class ListedOnly:
    """A change that adds REST deliveries to the robot's list, and does not forward them."""

    def __init__(self) -> None:
        self._entries: list[dict[str, Any]] = []

    def __call__(self, request: Request, forward: Forward) -> Response:
        """List a valid delivery in its usual notation; forward every other request."""
        found = valid_delivery(request)
        if found:
            code, *numbers = found.groups()
            order = {"message_code": int(code)} | dict(zip(COORDINATES, map(float, numbers), strict=True))
            sec, nanosec = divmod(time.time_ns(), 10**9)
            accepted = {"sec": sec, "nanosec": nanosec}
            self._entries.insert(0, {"request": order, "state": "queued", "accepted": accepted, "interface": "rest"})
            return plain(204)(request)
        response = forward(request)
        if _LIST(request):
            values(lambda listed: [*self._entries, *listed])(response)
        return response


def float32(text: str) -> str:
    """Return a number as text after rounding it to a 32-bit float."""
    try:
        return repr(struct.unpack("f", struct.pack("f", float(text)))[0])
    except (ValueError, OverflowError, struct.error):
        return text


def narrow(place: int, text: str) -> str:
    """Return a value of a delivery's path rounded to a 32-bit float."""
    return text if place == _CODE_PLACE else float32(text)


def narrow_soap(request: Request) -> None:
    """Round the doubles of a SOAP delivery to 32-bit floats."""
    request.body = re.sub(
        _DOUBLES, lambda found: found[1] + float32(found[2].decode("latin-1")).encode() + found[3], request.body
    )


def rounded_soap(request: Request) -> None:
    """Cut the doubles of a SOAP delivery after three decimals."""

    def short(found: re.Match[bytes]) -> bytes:
        text = found[2].decode("latin-1")
        digits = re.fullmatch(r"([+-]?\d*\.\d{3})\d+", text)
        return found[1] + (digits[1] if digits else text).encode() + found[3]

    request.body = re.sub(_DOUBLES, short, request.body)


def swapped_soap(request: Request) -> None:
    """Swap the values of source_x and destination_x in a SOAP delivery."""
    found = {
        name: re.search(rb"<(?:\w+:)?%s[^>]*>([^<]*)<" % name, request.body) for name in (b"source_x", b"destination_x")
    }
    one, other = found[b"source_x"], found[b"destination_x"]
    if one and other:
        first, second = sorted((one, other), key=lambda match: match.start(1))
        request.body = (
            request.body[: first.start(1)]
            + second[1]
            + request.body[first.end(1) : second.start(1)]
            + first[1]
            + request.body[second.end(1) :]
        )


def as_delivery(request: Request, forward: Forward) -> Response:
    """Forward a coffee request as a delivery with message code 3."""
    if not soap("ExecuteCoffeeRequest")(request):
        return forward(request)
    body = request.body.replace(b"ExecuteCoffeeRequest", b"ExecuteDeliveryRequest")
    response = forward(request.copy(body=re.sub(rb"(message_code[^>]*>\s*)[+-]?\d+", rb"\g<1>3", body)))
    response.body = response.body.replace(b"ExecuteDeliveryRequest", b"ExecuteCoffeeRequest")
    return response
