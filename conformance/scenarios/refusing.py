"""Send requests to a thing that the device should refuse, and read the thing and its list unchanged."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

from conformance.api.rest.inputs import request_of, usual_inputs
from conformance.api.rest.statuses import refuses
from conformance.api.rest.variations import NO_FORMAT
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation
from conformance.scenarios.living import ABSENT, Kind, Living, Look, State, Thing
from conformance.scenarios.special_bodies import half_valid
from conformance.scenarios.whole_list import WholeList
from conformance.scenarios.writing import members
from conformance.transport.exchange import Exchange

_TEXT: Final = "text/plain"
# Distance between the numbers from which a series of requests is made.
_STEP: Final = 10
# Texts that only the suite writes, as `another` makes them.
_OURS: Final = re.compile(r"(?:roaas |r)\d+")


def is_refused(exchange: Exchange, operation: Operation | None = None) -> bool:
    """Return whether a device reports that it has not performed a request."""
    return refuses(exchange.response.status, operation)


def is_ours(value: Any) -> bool:
    """Return whether a value is a text that no client but the suite writes."""
    return isinstance(value, str) and _OURS.fullmatch(value) is not None


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
        look_refused(living, thing, change, writer.send(change, thing.path, valid, media_type=_TEXT))
    for body in _half_valid(living, change, turn + _STEP, members(thing.last, ())):
        look_refused(living, thing, change, writer.send(change, thing.path, body))


def refuse_deletion(living: Living, delete: Operation, thing: Thing, absent: str) -> None:
    """Send a DELETE of a thing that does not exist, and read another thing."""
    if absent and living.writer.send(living.read, absent).response.status in ABSENT:
        look_refused(living, thing, delete, living.writer.send(delete, absent))


def look_refused(living: Living, thing: Thing, operation: Operation, sent: Exchange) -> None:
    """Read a thing after a request that should be refused; one that was accepted has written it."""
    if thing.state is not State.ALIVE:
        return
    if is_refused(sent):
        living.check(thing, sent, operation.label, Kind.REFUSED)
    elif operation.bodies:
        living.remember(thing, living.writer.read_back(operation, living.read, thing.path, sent), operation)


def _new_again(living: Living, create: Operation, body: Any, before: WholeList) -> tuple[str, WholeList]:
    """Return what is new in a list after a refused creation is sent once more, and the list: it may have been ours."""
    if not is_refused(living.writer.send(create, living.at, body), create):
        return "", before
    after = living.list_of(living.things[-1])
    new = [id_ for id_ in after.ids if id_ and id_ not in before.ids]
    # Of a list that also grows without a request, another client creates the items.
    if new and set(living.list_of(living.things[-1]).ids) - set(after.ids):
        new = []
    return (f"a list with {new[0]}, which is new", after) if new else ("", before)


def refuse_creation(living: Living, create: Operation, turn: int) -> None:
    """Send creations that should be refused, and look for each in the list."""
    if living.lister is None or living.listing is None or not living.things:
        return
    writer, tried = living.writer, list[Exchange]()
    if (body := next(_half_valid(living, create, turn, {}), None)) is not None:
        tried.append(writer.send(create, living.at, body))
    other = [next(iter(writer.bodies(create, turn + number * _STEP, {})), None) for number in (1, 2)]
    if other[0] is not None and other[1] is not None:
        tried.append(writer.send(create, living.at, other[0], media_type=_TEXT))
        if "406" in create.responses:
            tried.append(writer.send(create, living.at, other[1], headers=(("Accept", NO_FORMAT),)))
    thing, names = living.things[-1], writer.values.unique.names(create)
    taken = {name: one for name, one in members(thing.last, names).items() if name in names}
    new = next(iter(writer.bodies(create, turn + 3 * _STEP, {})), None)
    if new is not None and taken:
        usual = usual_inputs(create, writer.values)[0]
        request = request_of(create, replace(usual, body={**new, **taken}))
        tried.append(writer.api.send(replace(request, target=living.at or request.target)))
        if is_refused(tried[-1]):
            living.check(thing, tried[-1], create.label, Kind.REFUSED)
    refused = [exchange for exchange in tried if is_refused(exchange, create)]
    before = living.listing.ids
    listing = living.list_of(living.things[-1]) if refused else living.listing
    for sent in refused:
        value = read_json(sent.request.body).value
        ours = {name: one for name, one in value.items() if is_ours(one)} if isinstance(value, dict) else {}
        made = ours and [
            one
            for one, id_ in zip(listing.items, listing.ids, strict=True)
            if id_ and id_ not in before and any(one.get(name) == text for name, text in ours.items())
        ]
        found = f"a list with {', '.join(f'{name} {text!r}' for name, text in ours.items())}" if made else ""
        if not found and body is not None and sent is tried[0] and set(listing.ids) - set(before):
            found, listing = _new_again(living, create, body, listing)
        expected = f"a list without what {create.label} with status {sent.response.status} asked for"
        doubt = "" if made or not found else "another client may have created it"
        living.looks.append(Look(Kind.REFUSED, create.label, listing.exchange, expected, found, doubt=doubt))
