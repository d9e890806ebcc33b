"""Parts of a robot's state that do not change by themselves, and whether GET returns the value that PUT sent."""

import math
import time
from collections.abc import Iterable
from dataclasses import replace
from http import HTTPStatus
from typing import Any

from conformance.api.rest.calls import JSON, Call, example_call
from conformance.api.rest.interface import RestInterface
from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json, operations_of
from conformance.documents.representation import flattened
from conformance.observe.clock import Patience
from conformance.transport.exchange import Exchange

Snapshot = dict[str, Any]
_READINGS = 3
_PAUSE_S = 0.04
# How many times the suite waits for a value that still changes to come to rest.
_WINDOWS = 12


def flatten(exchange: Exchange) -> Snapshot:
    """Return the status and every single value of a JSON response, by place."""
    answer = exchange.response
    shown: Snapshot = {"status": answer.status}
    if answer.ok and is_json(answer.media_type):
        text = read_json(answer.body)
        if not text.problem:
            shown.update(flattened(text.value))
    return shown


def steady(snapshots: Iterable[Snapshot]) -> Snapshot:
    """Return the values that are the same in all snapshots."""
    first, *others = snapshots
    return {
        place: value
        for place, value in first.items()
        if all(place in other and other[place] == value for other in others)
    }


def take_snapshots(api: RestInterface, calls: Iterable[Call]) -> dict[str, tuple[Snapshot, Exchange]]:
    """Read each operation several times; return its steady values by its id, with the last exchange.

    With a pause between the readings: a robot's sensors speak tens of times a second, and a client asks faster.
    """
    taken: dict[str, list[Exchange]] = {}
    for turn in range(_READINGS):
        if turn:
            time.sleep(_PAUSE_S)
        for call in calls:
            exchange = call.send(api, ("Accept", "application/json"))
            taken.setdefault(call.operation.id, []).append(exchange)
    return {id_: (steady(flatten(one) for one in exchanges), exchanges[-1]) for id_, exchanges in taken.items()}


def deltas(before: Snapshot, after: Snapshot) -> dict[str, tuple[Any, Any]]:
    """Return the values that changed, with old and new; missing places count only where the status is the same."""
    if before.get("status") != after.get("status"):
        return {"status": (before.get("status"), after.get("status"))} if "status" in before else {}
    return {place: (value, after.get(place, "nothing")) for place, value in before.items() if after.get(place) != value}


def changes_by_itself(api: RestInterface, call: Call, place: str, seconds: float) -> bool:
    """Return whether a value of a resource keeps changing while the suite sends nothing else.

    What has set it going may take a while to end (a robot that was set in motion): only a value that does not come
    to rest in any of several such times changes by itself.
    """
    return all(_changes(api, call, place, seconds) for _ in range(_WINDOWS))


def _changes(api: RestInterface, call: Call, place: str, seconds: float) -> bool:
    until = time.monotonic() + seconds
    first = flatten(call.send(api, ("Accept", "application/json")))
    while time.monotonic() < until:
        time.sleep(_PAUSE_S)
        if flatten(call.send(api, ("Accept", "application/json"))).get(place) != first.get(place):
            return True
    return False


_READ_AGAIN_S = 0.01


def reader_of(api: RestInterface, call: Call) -> Call | None:
    """Return the GET request of the resource that a PUT request writes, or None."""
    for operation in operations_of(api.run.contract):
        if operation.method == "GET" and operation.template == call.operation.template:
            read = example_call(api, operation)
            for item in operation.parameters:
                if item.name in call.inputs.at(item.where):
                    value = call.inputs.at(item.where)[item.name]
                    read = replace(read, inputs=read.inputs.having(item.where, item.name, value))
            return read
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
        time.sleep(_READ_AGAIN_S)


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
        time.sleep(_READ_AGAIN_S)
    return True


def _patience(api: RestInterface) -> Patience:
    pace = api.client.connection.pace
    return Patience(pace, 1.25 * api.device.settle_s + 0.5 + 4 * pace.usual_s)
