"""Check whether GET returns the value that PUT sent."""

import math
import time
from http import HTTPStatus

from conformance.api.rest.calls import JSON, Call, example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.snapshot import flatten
from conformance.documents.openapi import operations_of
from conformance.documents.representation import flattened
from conformance.observe.clock import Patience

_PAUSE_S = 0.01


def reader_of(api: RestInterface, call: Call) -> Call | None:
    """Return the GET request of the resource that a PUT request writes, or None."""
    for operation in operations_of(api.run.contract):
        if operation.method == "GET" and operation.template == call.operation.template:
            read = example_call(api, operation)
            return Call(operation, {**read.values, **call.values})
    return None


def settles_at(api: RestInterface, call: Call) -> str | None:
    """Wait until GET returns the value that PUT sent.

    Returns:
        Empty if it does; what GET returns instead after the settle time (plus 25 % and 0.5 s for a loaded machine);
        None
        if the values cannot be compared.
    """
    patience = _patience(api)
    every_s = 0.4 * (api.device.hold_s or math.inf)
    renew_at = time.monotonic() + every_s
    while True:
        other = differs_from(api, call)
        if not other or patience.over:
            return other
        if time.monotonic() > renew_at:
            call.send(api)
            renew_at = time.monotonic() + every_s
        time.sleep(_PAUSE_S)


def differs_from(api: RestInterface, call: Call) -> str | None:
    """Return the value that GET returned if the PUT's differs; empty if equal; None if they cannot be compared."""
    read = reader_of(api, call)
    if read is None or not isinstance(call.value, dict):
        return None
    shown = flatten(read.send(api, ("Accept", JSON)))
    if shown["status"] == HTTPStatus.NOT_FOUND:  # the goal that was PUT has ended since, because the robot reached it
        return None
    other = (
        f"{shown.get(place, 'nothing')!r} as {place} instead of {value!r}"
        for place, value in flattened(call.value).items()
        if not place.endswith("[]") and not api.device.is_near(place, shown.get(place), value)
    )
    return next(other, "")


def takes_effect(api: RestInterface, call: Call) -> bool:
    """Return whether GET returns the value of a PUT at some time within the settle time; nothing is sent again."""
    patience = _patience(api)
    while differs_from(api, call) != "":
        if patience.over:
            return False
        time.sleep(_PAUSE_S)
    return True


def _patience(api: RestInterface) -> Patience:
    pace = api.client.connection.pace
    return Patience(pace, 1.25 * api.device.settle_s + 0.5 + 4 * pace.usual_s)
