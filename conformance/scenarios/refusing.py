"""Send to a thing what the device should refuse, and read the thing and its list: a refused request changes nothing."""

from __future__ import annotations

import re
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final

from conformance.api.rest.inputs import usual_inputs
from conformance.documents.openapi import Operation
from conformance.scenarios.living import ABSENT, Kind, Living, Look, State, Thing
from conformance.scenarios.special_bodies import half_valid
from conformance.scenarios.writing import members
from conformance.transport.exchange import Exchange

# A proxy may have sent 408 after the device has acted; 406 is about the response.
_UNCLEAR: Final = frozenset({HTTPStatus.NOT_ACCEPTABLE, HTTPStatus.REQUEST_TIMEOUT})
_ERRORS: Final = range(400, 500)
_TEXT: Final = "text/plain"
# The turns of the values in a series of requests are so far apart.
_STEP: Final = 10
# Texts that no client but the suite writes, as `another` makes them.
_OURS: Final = re.compile(r"(?:roaas |r)\d+")


def is_refused(exchange: Exchange) -> bool:
    """Return whether a device says that it has not done what a request asks."""
    status = exchange.response.status
    return status in _ERRORS and status not in _UNCLEAR


def _half_valid(living: Living, operation: Operation, turn: int, now: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield bodies with new valid values and one that the description forbids."""
    valid = next(iter(living.writer.bodies(operation, turn, now)), None)
    if valid is not None:
        yield from half_valid(operation, usual_inputs(operation, living.writer.values)[0], valid)


def refuse_changes(living: Living, change: Operation, thing: Thing, turn: int) -> None:
    """Send requests that should be refused to a thing, and read it after each."""
    writer = living.writer
    valid = next(iter(writer.bodies(change, turn, members(thing.last, ()))), None)
    if valid is not None:
        _look(living, thing, change, writer.send(change, thing.path, valid, media_type=_TEXT))
    for body in _half_valid(living, change, turn + _STEP, members(thing.last, ())):
        _look(living, thing, change, writer.send(change, thing.path, body))


def refuse_deletion(living: Living, delete: Operation, thing: Thing, absent: str) -> None:
    """Send a DELETE of a thing that does not exist, and read another thing."""
    if absent and living.writer.send(living.read, absent).response.status in ABSENT:
        _look(living, thing, delete, living.writer.send(delete, absent))


def _look(living: Living, thing: Thing, operation: Operation, sent: Exchange) -> None:
    """Read a thing after a request that should be refused; one that was accepted has written it."""
    if thing.state is not State.ALIVE:
        return
    if is_refused(sent):
        living.check(thing, sent, operation.label, Kind.REFUSED)
    elif operation.bodies:
        living.remember(thing, living.writer.read_back(operation, living.read, thing.path, sent), operation)


def refuse_creation(living: Living, create: Operation, turn: int) -> None:
    """Send a creation that should be refused, and look in the list for what it asks for."""
    body = next(_half_valid(living, create, turn, {}), None)
    if body is None or living.lister is None or living.listing is None or not living.things:
        return
    sent = living.writer.send(create, "", body)
    ours = {name: one for name, one in body.items() if isinstance(one, str) and _OURS.fullmatch(one)}
    if not is_refused(sent) or not ours:
        return
    before = living.listing.ids
    listing = living.list_of(living.things[-1])
    made = [
        one
        for one, id_ in zip(listing.items, listing.ids, strict=True)
        if id_ and id_ not in before and any(one.get(name) == text for name, text in ours.items())
    ]
    other = f"a list with {', '.join(f'{name} {text!r}' for name, text in ours.items())}" if made else ""
    expected = f"a list without what {create.label} with status {sent.response.status} asked for"
    living.looks.append(Look(Kind.REFUSED, create.label, listing.exchange, expected, other))
