"""``roaas certify --init``: a motion map as the names in a description suggest one, for a person to complete."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from conformance.contract.toml_file import basic_string
from conformance.documents.json_schema import Schema
from conformance.documents.openapi import Operation
from conformance.engine.commanded import (
    Commanded,
    axis_of,
    body_schema,
    bounds_of,
    commanded_by,
    is_velocity,
    numbers_in,
    parts_of,
    unit_of,
    with_query,
)
from conformance.engine.finding import stop_beside
from conformance.engine.map_text import direction_line, inline, key, template_of

_GOES: Final = re.compile(r"goto|go_to|go-to|move|target|goal|pose|position|joint", re.IGNORECASE)
_STAMP: Final = re.compile(r"stamp|timestamp", re.IGNORECASE)
_MEASURED: Final = re.compile(r"twist|velocit|speed", re.IGNORECASE)


class _Pair(NamedTuple):
    """What is sent and where it is read: the numbers that are commanded, by their places in a state, or in one each."""

    state: Operation
    sent: Operation
    places: Mapping[str, Commanded]
    reads: Mapping[str, Operation] = {}


def proposed_map(operations: Sequence[Operation]) -> Iterator[str]:
    """Yield the lines of a map; nothing where no names suggest one.

    What is sent and what is read are taken for one axis if they have the same name.
    """
    reading = [item for item in operations if item.safe and item.shape]
    acting = [with_query(item) for item in operations if not (item.safe or item.never)]
    sending = [(item, numbers) for item in acting if (numbers := commanded_by(item))]
    goes = _best(reading, [one for one in sending if not is_velocity(*one) and _GOES.search(one[0].label)], _position)
    drives = _best(reading, [one for one in sending if is_velocity(*one)], _velocity)
    goes = goes or max(
        (pair for item in sending if not is_velocity(*item) if (pair := _axis_by_axis(reading, *item))),
        key=lambda pair: len(pair.places),
        default=None,
    )
    first = goes or drives
    if first is None:
        return
    # One reading tells all of a map.
    drives = drives if drives and drives.state is first.state else None
    schemas = dict(numbers_in(first.state.shape or {}))
    schemas |= {at: one.shape or {} for at, one in first.reads.items()}
    driven = {at: one for at, one in (drives.places if drives else {}).items() if not _MEASURED.search(at)}
    axes = {at: one.name for at, one in {**driven, **(goes.places if goes else {})}.items()}
    yield "[motion.state]"
    yield f"read = {basic_string(first.state.label)}"
    yield from (f"stamp = {basic_string(at)}" for at in _stamps(first.state.shape or {}))
    yield ""
    yield "[motion.state.axes]  # limits and units: yours"
    for at, name in axes.items():
        number = goes.places.get(at) if goes else None
        least, most = (number and not number.is_relative and number.bounds) or bounds_of(schemas[at]) or (-0.1, 0.1)
        own = "" if goes else ", tolerance = 0.05"
        unit = basic_string(unit_of(at, schemas[at]))
        read = first.reads.get(at, first.state)
        own += "" if read is first.state else f", read = {basic_string(read.label)}"
        place = basic_string(at.rpartition("#")[2])
        yield f"{key(name)} = {{ at = {place}, unit = {unit}, limits = [{least:g}, {most:g}]{own} }}"
    if goes:
        yield ""
        yield "[motion.goto]"
        yield from _sending_lines(goes)
        if any(command.is_relative for command in goes.places.values()):
            yield "relative = true"
        yield "tolerance = 0.05"
        yield from _stop(operations, goes.sent)
    if drives:
        yield ""
        yield "[motion.velocity]"
        yield from _sending_lines(drives)
        yield "tolerance = 0.05"
        yield "# hold_s = 0.5  # so long after the last command it goes on"
        yield ""
        yield "[motion.velocity.axes]  # of: the axis that it changes, by scale at velocity 1"
        for at, one in drives.places.items():
            least, most = one.bounds or (-0.1, 0.1)
            where = f"of = {basic_string(axes[at])}" if at in axes else f"at = {basic_string(at)}"
            yield f"{key(one.name)} = {{ limits = [{least:g}, {most:g}], {where} }}"


def why_no_map(operations: Sequence[Operation]) -> Iterator[str]:
    """Yield a sentence on each operation that may move the device, where no map is proposed."""
    for operation in (item for item in operations if not item.safe):
        named = "" if operation.never else ", ".join(number.name for number in commanded_by(operation))
        why = f"no GET tells numbers called {named}; --drive '{operation.label}' finds what shows them"
        none = "it must never be called" if operation.never else "it takes no numbers"
        yield f"{operation.label}: {why if named else none}."


def _sending_lines(pair: _Pair) -> Iterator[str]:
    """Yield how an operation is sent."""
    yield f"send = {basic_string(pair.sent.label)}"
    schema, numbers = body_schema(pair.sent), list(pair.places.values())
    if schema is not None:
        yield f"body = {inline(template_of(schema, {command.place: f'{{{command.name}}}' for command in numbers}))}"
    yield from (direction_line(command) for command in numbers if command.direction)


def _stop(operations: Sequence[Operation], move: Operation) -> Iterator[str]:
    """Propose the stop beside a move."""
    if (found := stop_beside(operations, move)) is not None:
        yield ""
        yield "[motion.stop]"
        yield f"send = {basic_string(found.label)}"
        body = body_schema(found)
        if body is not None:
            yield f"body = {inline(template_of(body, {}))}  # an id of the move: " + '"{goto:/id}"'
        yield "rests_within_s = 0.5"


def _belongs(state: Operation, sent: Operation) -> bool:
    """Return whether whoever knows the path of what is sent can read a state."""
    return {item.name for item in state.parameters if item.required} <= {item.name for item in sent.parameter("path")}


def _axis_by_axis(reading: Sequence[Operation], sent: Operation, numbers: Sequence[Commanded]) -> _Pair | None:
    """Return a pair of which an operation of its own, called as the number, tells each; None: some have none."""
    folder, reads, places = posixpath.dirname(sent.template), dict[str, Operation](), dict[str, Commanded]()
    for number in numbers:
        for state in reading:
            named = posixpath.basename(state.template).lower() == axis_of(number.place)
            values = [at for at, _ in numbers_in(state.shape or {}) if at.rpartition("/")[2].lower() == "value"]
            if named and values and posixpath.dirname(state.template) == folder and _belongs(state, sent):
                at = f"{number.name}#{values[0]}"
                reads[at], places[at] = state, number
                break
    return _Pair(next(iter(reads.values())), sent, places, reads) if len(places) == len(numbers) else None


def _best(
    reading: Sequence[Operation],
    sending: Sequence[tuple[Operation, Sequence[Commanded]]],
    place_of: Callable[[Commanded, Sequence[str]], str | None],
) -> _Pair | None:
    """Return the two operations of which most of what one commands is in the response of the other."""
    found = []
    for state in reading:
        told = [at for at, _ in numbers_in(state.shape or {})]
        for sent, numbers in ((sent, numbers) for sent, numbers in sending if _belongs(state, sent)):
            # The first of several numbers of one name: in an ONVIF vector, pan comes before zoom.
            places = {at: command for command in reversed(numbers) if (at := place_of(command, told)) is not None}
            found.append(_Pair(state, sent, places))
    return max(
        (pair for pair in found if pair.places),
        key=lambda pair: (len(pair.places), not any(one.is_relative for one in pair.places.values())),
        default=None,
    )


def _position(number: Commanded, told: Sequence[str]) -> str | None:
    """Return where a state tells the position of what is commanded."""
    return next((at for at in told if not _MEASURED.search(at) and axis_of(at) == axis_of(number.place)), None)


def _velocity(number: Commanded, told: Sequence[str]) -> str | None:
    """Return where a state tells a velocity, or else the position that it changes."""
    measured = (at for at in told if _MEASURED.search(at) and f"{at}/".endswith(f"{number.place}/"))
    changed = (at for at in told if not _MEASURED.search(at) and axis_of(at) == axis_of(number.place))
    return next(measured, None) or (next(changed, None) if axis_of(number.place).strip("xyz") else None)


def _stamps(schema: Schema) -> list[str]:
    found = [f"/{name}" for part in parts_of(schema) for name in part.get("properties", {}) if _STAMP.search(name)]
    return found[:1]
