"""Write to resources that always exist, such as settings: several values per member, read on two connections."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from conformance.api.call_rules import HARMFUL, words_of
from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.inputs import usual_inputs
from conformance.api.rest.samples import alike_and_apart, fits
from conformance.api.rest.things import another, differences, is_devices
from conformance.documents.json_schema import Schema, is_number, kinds_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.scenarios.living import Life
from conformance.scenarios.writing import Write, Writer, members
from conformance.transport.exchange import Exchange, NoAnswerError

# Words in names of members that could make the device unreachable.
_CONNECTING: Final = frozenset(
    {
        "address", "addresses", "host", "hostname", "ip", "ipv", "port", "ports", "ssid", "wlan", "baud", "baudrate",
        "bitrate", "gateway", "dns", "netmask", "subnet", "mac", "dhcp", "vlan", "vpn", "proxy", "domain", "cors",
        "tls", "ssl", "https", "certificate", "user", "username", "key", "pin", "lock", "locked", "power", "remote",
        "server", "broker", "protocol", "firewall", "url", "uri", "endpoint",
    }
)  # fmt: skip
# Words in paths of resources that store what is written; others may show what the device does.
_KEEPING: Final = frozenset(
    {
        "settings", "setting", "config", "configuration", "preferences", "options", "parameters", "setup", "limits",
        "profile", "setpoint", "setpoints", "schedule", "calendar", "program", "rules", "thresholds", "calibration",
    }
)  # fmt: skip
_MOST_VALUES, _MOST_ITEMS = 5, 10
# Added to numbers that may have a fraction.
_PART: Final = 0.375
_FEW_MEMBERS = 4  # members of one resource that are written at quick; otherwise _MEMBERS
_MEMBERS = 30
_RESOURCES = 6  # resources that are written
_ACCEPTED: Final = 202
_BUDGETS = 2  # multiple of an exploration's time that one resource may take
_TURNS = 3  # other values of an object that are tried


def singletons(writer: Writer, operations: Mapping[tuple[str, str], Operation]) -> list[Life]:
    """Return the outcomes of resources that always exist and can be read and written."""
    lives = list[Life]()
    for (method, path), read in operations.items():
        write = operations.get(("PUT", path)) or operations.get(("PATCH", path))
        if method != "GET" or read.parameter("path") or write is None or not write.bodies:
            continue
        if not is_free(write, path) or len(lives) >= _RESOURCES:
            continue
        writer.api.run.limit.check()
        with writer.api.run.limit.lift(), suppress(NoAnswerError):  # the survey reports a broken connection
            if writes := _write_values(writer, read, write):
                lives.append(Life("", read.label, writes[0].sent, writes[0].found, writes=tuple(writes)))
    return lives


def is_free(write: Operation, path: str) -> bool:
    """Return whether a client may write a resource freely: that moves nothing, and the device stays reachable."""
    return not (write.motion or words_of(path) & _CONNECTING)


def _write_values(writer: Writer, read: Operation, write: Operation) -> list[Write]:
    """Write values of each member one after another, and restore the first values at the end."""
    media_type, before = usual_inputs(write, writer.values)[0].media_type, writer.send(read)
    if not is_json(media_type) or not before.response.ok or before.response.cut:
        return []
    schema = write.bodies[media_type].schema
    value = read_json(before.response.body).value
    if not isinstance(value, dict):
        others = list(values_of(schema, value, writer.values.collections)) if fits(schema, value) else []
        sent = [(one, _write(writer, read, write, one, before)) for one in others if write.method == "PUT"]
        restored = _write(writer, read, write, value, before) if sent else []
        is_kept = bool(words_of(read.template) & _KEEPING) or any(made and not made[-1].other for _, made in sent)
        doubt = "" if is_kept else "GET may show what the device does, and not what it was told"
        made = (one for _, writes in (*sent, (value, restored)) for one in writes)
        return [replace(one, doubt=one.doubt or doubt) for one in made]
    parts = flat(schema).get("properties", {})
    first = {
        name: one
        for name, one in members(before, parts).items()
        if name in parts and not parts[name].get("readOnly") and fits(parts[name], one)
    }
    if not first or not fits(schema, first):
        return []
    chosen = {
        name: list(values_of(parts[name], first[name], writer.values.collections))
        for name in first
        if is_changeable(name, parts[name], writer.values.collections)
    }
    effort, found, first_time = writer.api.run.effort, list[Write](), list[Write]()
    few = _FEW_MEMBERS if effort.name == "quick" or effort.slow else _MEMBERS
    until = time.monotonic() + _BUDGETS * effort.budget_s

    last = before

    def write_one(values: dict[str, Any], before: Exchange) -> list[Write]:
        nonlocal last
        body = values if write.method == "PATCH" and fits(schema, values) else {**first, **values}
        in_time = time.monotonic() < until
        writes = _write(writer, read, write, body, before) if in_time and fits(schema, body) else []
        last = writes[-1].found if writes else last
        return writes

    try:
        for turn in range(max(map(len, chosen.values()), default=0)):
            values = {name: some[turn] for name, some in chosen.items() if turn < len(some)}
            then, again = last, list[Write]()
            whole = write_one(values, then)
            is_told = bool(whole and whole[-1].other)
            if len(values) > 1 and (is_told or not whole):
                # Members may depend on each other, so a whole body is written too.
                wrong = _lost_members(writer, read, write, whole[-1]) if whole else dict.fromkeys(values, True)
                names = [name for name in values if wrong.get(name)][:few]
                again = [one for name in names for one in write_one({name: values[name]}, then)]
            found += again or ([] if is_told and len(values) > 1 else whole)
            first_time += whole or again
    finally:
        restored = _write(writer, read, write, first, last) if chosen else []
    # A member that never reads as written may show what the device does.
    is_keeping = bool(words_of(read.template) & _KEEPING)
    shown = {
        name
        for one in first_time
        for name, lost in _lost_members(writer, read, write, one).items()
        if not lost and _body(one)[name] != first.get(name)
    }
    kept = [name for name in chosen if is_keeping or name in shown]
    told = [(one, _lost_members(writer, read, write, one)) for one in found]
    known = [replace(one, other=tuple(text for name in kept for text in own.get(name, ()))) for one, own in told]
    return known + (restored if kept else []) if known else []


def _lost_members(writer: Writer, read: Operation, write: Operation, done: Write) -> dict[str, Any]:
    """Return the members that read differently than written, for each one that was sent."""
    body, schema = _body(done), write.bodies[done.sent.request.media_type].schema
    now, collections = members(done.found, body), writer.values.collections
    found = {name: differences({name: one}, now, schema, read.shape, collections) for name, one in body.items()}
    return {name: tuple(text for text in texts if text in done.other) for name, texts in found.items()}


def _body(done: Write) -> dict[str, Any]:
    body = read_json(done.sent.request.body).value
    return body if isinstance(body, dict) else {}


def _write(writer: Writer, read: Operation, write: Operation, body: Any, before: Exchange) -> list[Write]:
    """Write a value; return it with the reads on the same and on another connection; empty if it is refused."""
    # A resource above or below it shows the same values.
    path = read.template.rstrip("/")
    near = [
        one
        for (method, other), one in callable_operations(writer.api).items()
        if method == "GET" and not one.parameters
        if path == other.rstrip("/").rpartition("/")[0] or other == path.rpartition("/")[0]
    ]
    sent = writer.conditional(write, read, "", body)
    if not sent.response.ok or sent.response.status == _ACCEPTED:
        return []
    done = writer.read_back(write, read, "", sent, before=before)
    list(map(writer.send, near))
    return [done] if done.other else [done, writer.read_back(write, read, "", sent, before=before, fresh=True)]


def is_changeable(name: str, schema: Schema, collections: frozenset[str]) -> bool:
    """Return whether a client may write other values of a member, and still reaches the device."""
    return is_harmless(name) and not is_devices(name, schema, collections)


def is_harmless(name: str) -> bool:
    """Return whether a member of this name does not make the device unreachable, by the words in it."""
    return not {*words_of(name), plain_name(name)} & (_CONNECTING | HARMFUL)


def values_of(schema: Schema, first: Any, collections: frozenset[str]) -> Iterator[Any]:
    """Yield other values of a member that its schema allows: each of an enumeration, at its edges, and falsy ones."""
    given, kinds = flat(schema), kinds_of(schema)
    found: list[Any] = [item for item in given.get("enum", ()) if item is not None][:_MOST_VALUES]
    if not found and isinstance(first, bool):
        found = [not first]
    elif not found and is_number(first):
        found = [given.get("minimum"), given.get("maximum"), 0] if kinds & {"number", "integer"} else []
        middle = sum(found[:2]) / 2 if all(map(is_number, found[:2])) else None
        found += [] if middle is None else [middle + _PART if "number" in kinds else int(middle)]
        found += [first + 1, first - 1] if not any(map(is_number, found[:2])) else []
    elif not found and isinstance(first, list):
        found = [[], alike_and_apart({**given, "minItems": min(given.get("maxItems", 2), _MOST_ITEMS)})[1]]
    elif not found and isinstance(first, str) and "pattern" not in given and "format" not in given:
        found = ["roaas 1", ""]
    elif not found and isinstance(first, str) and "format" not in given:
        found = [
            another({"properties": {"it": schema}}, {"it": first}, turn, collections)["it"] for turn in range(_TURNS)
        ]
    elif isinstance(first, dict):
        found = [another(schema, first, turn, collections) for turn in range(_TURNS)]
    usable = [item for item in found if item is not None and item != first and fits(schema, item)]
    yield from (one for index, one in enumerate(usable) if one not in usable[:index])
