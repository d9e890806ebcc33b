"""Write to what is always there, such as settings: several values of each member, and read each on two connections."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, Final

from conformance.api.call_rules import HARMFUL, words_of
from conformance.api.rest.inputs import usual_inputs
from conformance.api.rest.samples import alike_and_apart, fits
from conformance.api.rest.things import another, is_devices
from conformance.documents.json_schema import Schema, is_number, kinds_of
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.scenarios.living import Life
from conformance.scenarios.writing import Write, Writer, members
from conformance.transport.exchange import Exchange, NoAnswerError

# Words in the names of members by which a client may lose the device.
_CONNECTING: Final = frozenset(
    {
        "address", "addresses", "host", "hostname", "ip", "ipv", "port", "ports", "ssid", "wlan", "baud", "baudrate",
        "bitrate", "gateway", "dns", "netmask", "subnet", "mac", "dhcp", "vlan", "vpn", "proxy", "domain", "cors",
        "tls", "ssl", "https", "certificate", "user", "username", "key", "pin", "lock", "locked", "power", "remote",
        "server", "broker", "protocol", "firewall", "url", "uri", "endpoint",
    }
)  # fmt: skip
# Words in the paths of resources that keep what is written; others may show what the device does.
_KEEPING: Final = frozenset(
    {
        "settings",
        "setting",
        "config",
        "configuration",
        "preferences",
        "options",
        "parameters",
        "setup",
        "limits",
        "profile",
    }
)
_MOST_VALUES: Final = 5
# So many members of one resource are written, at quick and at other efforts, and so many resources.
_FEW_MEMBERS, _MEMBERS, _RESOURCES = 4, 30, 6
_ACCEPTED: Final = 202
# As many times an exploration's time one resource takes; and so many other values of an object are tried.
_BUDGETS, _TURNS = 2, 3


def singletons(writer: Writer, operations: Mapping[tuple[str, str], Operation]) -> list[Life]:
    """Return what became of the resources that are always there and can be read and written."""
    lives = list[Life]()
    for (method, path), read in operations.items():
        write = operations.get(("PUT", path)) or operations.get(("PATCH", path))
        if method != "GET" or read.parameter("path") or write is None or not write.bodies:
            continue
        if write.motion or words_of(path) & _CONNECTING or len(lives) >= _RESOURCES:
            continue
        writer.api.run.limit.check()
        with writer.api.run.limit.lifted(), suppress(NoAnswerError):  # the survey tells what breaks a connection
            if writes := _written(writer, read, write):
                lives.append(Life("", read.label, writes[0].sent, writes[0].found, writes=tuple(writes)))
    return lives


def _written(writer: Writer, read: Operation, write: Operation) -> list[Write]:
    """Write values of each member one after another, and at the end what was there before."""
    media_type, before = usual_inputs(write, writer.values)[0].media_type, writer.send(read)
    if not is_json(media_type) or not before.response.ok or before.response.cut:
        return []
    schema = write.bodies[media_type].schema
    parts = flat(schema).get("properties", {})
    first = {
        name: one
        for name, one in members(before, parts).items()
        if name in parts and not parts[name].get("readOnly") and fits(parts[name], one)
    }
    if not first or not fits(schema, first):
        return []
    effort, found = writer.api.run.effort, list[Write]()
    chosen = [name for name in first if _is_changeable(name, parts[name], writer)]
    until = time.monotonic() + _BUDGETS * effort.budget_s
    try:
        for name in chosen[: _FEW_MEMBERS if effort.name == "quick" or effort.slow else _MEMBERS]:
            done = list[Write]()
            for value in values_of(parts[name], first[name], writer.values.collections):
                body = (
                    {name: value} if write.method == "PATCH" and fits(schema, {name: value}) else {**first, name: value}
                )
                if fits(schema, body) and time.monotonic() < until:
                    done += _write(writer, read, write, body, before)
            # What never reads as written may show what the device does.
            is_kept = words_of(read.template) & _KEEPING or any(not one.other for one in done)
            found += done if is_kept else ()
    finally:
        done = _write(writer, read, write, first, before) if chosen else []
    return found + (done if found else [])


def _write(writer: Writer, read: Operation, write: Operation, body: Any, before: Exchange) -> list[Write]:
    """Write a value; return that with what was read on the connection, and on another one. Nothing if it is refused."""
    sent = writer.conditional(write, read, "", body)
    if not sent.response.ok or sent.response.status == _ACCEPTED:
        return []
    done = writer.read_back(write, read, "", sent, before=before)
    if done.other:
        return [done]
    return [done, writer.read_back(write, read, "", sent, before=before, fresh=True)]


def _is_changeable(name: str, schema: Schema, writer: Writer) -> bool:
    """Return whether a client may write other values of a member, and still reaches the device."""
    words = {*words_of(name), plain_name(name)}
    return not (words & (_CONNECTING | HARMFUL) or is_devices(name, schema, writer.values.collections))


def values_of(schema: Schema, first: Any, collections: frozenset[str]) -> Iterator[Any]:
    """Yield other values of a member that its schema allows: each of an enumeration, at its edges, and falsy ones."""
    given, kinds = flat(schema), kinds_of(schema)
    found: list[Any] = [one for one in given.get("enum", ()) if one is not None][:_MOST_VALUES]
    if not found and isinstance(first, bool):
        found = [not first]
    elif not found and is_number(first):
        found = [given.get("minimum"), given.get("maximum"), 0] if kinds & {"number", "integer"} else []
        found += [first + 1, first - 1] if not any(map(is_number, found[:2])) else []
    elif not found and isinstance(first, list):
        found = [[], alike_and_apart(schema)[1]]
    elif not found and isinstance(first, str) and "pattern" not in given and "format" not in given:
        found = ["", "roaas 1"]
    elif isinstance(first, dict):
        found = [another(schema, first, turn, collections) for turn in range(_TURNS)]
    usable = [one for one in found if one is not None and one != first and fits(schema, one)]
    yield from (one for index, one in enumerate(usable) if one not in usable[:index])
