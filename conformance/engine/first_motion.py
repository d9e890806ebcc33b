"""``roaas certify --init``: a motion map as the names in a description suggest one, for a person to complete."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator, Sequence
from typing import Any, Final

from conformance.contract.toml_file import basic_string
from conformance.documents.json_schema import Schema, is_numeric
from conformance.documents.openapi import Operation, is_json
from conformance.engine.commanded import commanded_by, is_axis
from conformance.engine.map_text import inline, key

_GOES: Final = re.compile(r"goto|go_to|go-to|move|target|goal|pose|position|joint", re.IGNORECASE)
_DRIVES: Final = re.compile(r"velocity|cmd_?vel|twist|drive|jog", re.IGNORECASE)
_STOPS: Final = re.compile(r"stop|halt|cancel|abort", re.IGNORECASE)
_LASTS: Final = re.compile(r"duration|seconds", re.IGNORECASE)
_STAMP: Final = re.compile(r"stamp|timestamp", re.IGNORECASE)
_DEPTH: Final = 6


def proposed_map(operations: Sequence[Operation]) -> Iterator[str]:
    """Yield the lines of a map; nothing where no names suggest one.

    What is sent and what is read are taken for one axis if they have the same name.
    """
    reading = [item for item in operations if item.method == "GET" and not item.parameter("path") and item.shape]
    sending = [(item, body) for item in operations if (body := body_of(item)) is not None and _acts(item)]
    goes = _best(reading, [one for one in sending if _GOES.search(one[0].label)])
    drives = next((one for one in sending if _DRIVES.search(one[0].label) and dict(_numbers(one[1]))), None)
    if goes is None:
        return
    state, (move, body), axes = goes
    read = dict(_numbers(state.shape or {}))
    yield "[motion.state]"
    yield f"read = {basic_string(state.label)}"
    yield from (f"stamp = {basic_string(at)}" for at in _stamps(state.shape or {}))
    yield ""
    yield "[motion.state.axes]  # limits and units: yours"
    sent = {at.rpartition("/")[2]: schema for at, schema in _numbers(body)}
    for name in axes:
        at = next(at for at in read if at.rpartition("/")[2] == name)
        least, most = sent[name].get("minimum", -0.1), sent[name].get("maximum", 0.1)
        yield f'{key(name)} = {{ at = {basic_string(at)}, unit = "", limits = [{least}, {most}] }}'
    yield ""
    yield "[motion.goto]"
    yield f"send = {basic_string(move.label)}"
    yield f"body = {inline(_template(body, set(axes)))}"
    yield "tolerance = 0.05"
    yield from _stop(operations, move)
    if drives is not None:
        yield from _velocity(*drives)


def why_no_map(operations: Sequence[Operation]) -> Iterator[str]:
    """Yield a sentence on each operation that may move the device, where no map is proposed."""
    for one in operations:
        if one.safe or not (_GOES.search(one.label) or _DRIVES.search(one.label)):
            continue
        numbers = commanded_by(one)
        if one.never or not numbers:
            yield f"{one.label}: {'it must never be called' if one.never else 'it takes no numbers'}."
            continue
        named = ", ".join(number.name for number in numbers)
        yield f"{one.label}: no GET tells numbers called {named}; --drive '{one.label}' finds what shows them."


def _velocity(drive: Operation, body: Schema) -> Iterator[str]:
    names = {name for at, _ in _numbers(body) if is_axis(name := at.rpartition("/")[2])}
    yield ""
    yield "[motion.velocity]"
    yield f"send = {basic_string(drive.label)}"
    yield f"body = {inline(_template(body, names))}"
    yield "tolerance = 0.05"
    yield "# hold_s = 0.5  # so long after the last command it goes on"
    yield ""
    yield "[motion.velocity.axes]  # at: where the state has it; or of: the axis that it changes"
    for name in sorted(names):
        yield f'{key(name)} = {{ limits = [-0.1, 0.1], at = "/" }}'


def _stop(operations: Sequence[Operation], move: Operation) -> Iterator[str]:
    """Propose the stop whose path is nearest to that of the move."""
    stops = [item for item in operations if _acts(item) and _STOPS.search(item.label)]
    found = max(stops, key=lambda item: len(posixpath.commonpath([item.template, move.template])), default=None)
    if found is not None:
        yield ""
        yield "[motion.stop]"
        yield f"send = {basic_string(found.label)}"
        body = body_of(found)
        if body is not None:
            yield f"body = {inline(_template(body, set()))}  # an id of the move: " + '"{goto:/id}"'
        yield "rests_within_s = 0.5"


def _acts(operation: Operation) -> bool:
    return not operation.safe and not operation.never and "{" not in operation.template


def body_of(operation: Operation) -> Schema | None:
    """Return the schema of the JSON body that an operation accepts, or None."""
    return next((one.schema for name, one in operation.bodies.items() if is_json(name)), None)


def _best(
    reading: Sequence[Operation], sending: Sequence[tuple[Operation, Schema]]
) -> tuple[Operation, tuple[Operation, Schema], list[str]] | None:
    """Return the two operations that have the most names of numbers in common, and these names."""
    found = []
    for state in reading:
        names = {at.rpartition("/")[2] for at, _ in _numbers(state.shape or {})}
        for one in sending:
            sent = dict.fromkeys(at.rpartition("/")[2] for at, _ in _numbers(one[1]))
            found.append((state, one, [name for name in sent if name in names and is_axis(name)]))
    best = max(found, key=lambda one: len(one[2]), default=None)
    return best if best and best[2] else None


def parts_of(schema: Schema) -> Iterator[Schema]:
    """Yield a schema and its alternatives."""
    yield schema
    for word in ("allOf", "anyOf", "oneOf"):
        for part in schema.get(word, ()):
            if isinstance(part, dict):
                yield from parts_of(part)


def _numbers(schema: Schema, at: str = "", depth: int = _DEPTH) -> Iterator[tuple[str, Schema]]:
    """Yield the JSON pointers of the numbers in an object, with their schemas."""
    for part in parts_of(schema) if depth else ():
        for name, member in part.get("properties", {}).items():
            place = f"{at}/{name.replace('~', '~0').replace('/', '~1')}"
            if isinstance(member, dict) and is_numeric(member):
                yield place, member
            elif isinstance(member, dict):
                yield from _numbers(member, place, depth - 1)


def _stamps(schema: Schema) -> list[str]:
    found = [f"/{name}" for part in parts_of(schema) for name in part.get("properties", {}) if _STAMP.search(name)]
    return found[:1]


def _template(schema: Schema, axes: set[str], depth: int = _DEPTH) -> dict[str, Any]:
    """Return a body with a name for each axis, and a value for what else is required."""
    made: dict[str, Any] = {}
    for part in _chosen(schema, axes) if depth else ():
        required = part.get("required", ())
        for name, member in part.get("properties", {}).items():
            if not isinstance(member, dict) or name in made:
                continue
            if name in axes:
                made[name] = f"{{{name}}}"
            elif is_numeric(member) and _LASTS.search(name):
                made[name] = "{seconds}"
            elif inner := _template(member, axes, depth - 1):
                made[name] = inner
            elif name in required:
                made[name] = member.get("default", 0.0 if is_numeric(member) else "")
    return made if _names(made) or not axes else {}


def _chosen(schema: Schema, axes: set[str]) -> Iterator[Schema]:
    """Yield a schema's parts, and of its alternatives the one with the most axes."""
    yield schema
    for part in schema.get("allOf", ()):
        yield from _chosen(part, axes)
    for word in ("anyOf", "oneOf"):
        ranked = sorted(
            (part for part in schema.get(word, ()) if isinstance(part, dict)),
            key=lambda part: sum(at.rpartition("/")[2] in axes for at, _ in _numbers(part)),
        )
        if ranked:
            yield from _chosen(ranked[-1], axes)


def _names(made: dict[str, Any]) -> bool:
    return any(_names(one) if isinstance(one, dict) else "{" in str(one) for one in made.values())
