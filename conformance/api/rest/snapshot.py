"""Find the parts of a robot's state that do not change by themselves, so that two readings can be compared."""

import time
from collections.abc import Iterable
from typing import Any

from conformance.api.rest.calls import Call
from conformance.api.rest.interface import RestInterface
from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json
from conformance.documents.representation import flattened
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


def changed(before: Snapshot, after: Snapshot) -> dict[str, tuple[Any, Any]]:
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
