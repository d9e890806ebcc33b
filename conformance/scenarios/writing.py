"""Write to a thing by PUT or PATCH, and read it until the written values appear."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, TypeVar

from conformance.api.rest.inputs import request_of, usual_inputs, whole_body, with_new_values
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.samples import fits, other_texts
from conformance.api.rest.things import WHOLE, another, as_answered, differences, doubt_of_write, object_in, with_items
from conformance.api.rest.values import Values
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.observe.clock import Patience
from conformance.transport.exchange import Exchange, Outgoing

_SETTLES_S: Final = 3.0  # a device may apply a write this long after its response, s
_PAUSE_S: Final = 0.2  # pause between reads, s
_LAST: Final = (
    5  # a value that differs in each of this many last reads is still changing, like the place of a moving valve
)
_ACCEPTED: Final = 202
# Members of a resource that are written singly.
_MEMBERS: Final = 6
# Statuses by which a device demands a condition, or says that the request's condition does not hold.
_WANTS_CONDITION: Final = frozenset({412, 428})
_Read = TypeVar("_Read")


@dataclass(frozen=True)
class Write:
    """One write, and the last read after it.

    Attributes:
        operation, read: labels of the operations.
        sent: the request that wrote.
        found: the GET after it.
        other: what reads in another way than it was written, as noun phrases.
        doubt: why it may, by the descriptions of the operations; empty if it may not.
    """

    operation: str
    read: str
    sent: Exchange
    found: Exchange
    other: tuple[str, ...] = ()
    doubt: str = ""


@dataclass(frozen=True)
class Settled:
    """A read, with its faults and those of the reads before it, as noun phrases."""

    exchange: Exchange
    wrong: tuple[str, ...]


@dataclass(frozen=True)
class Writer:
    """Sends requests to things of a described API.

    Attributes:
        api: the device.
        values: values that the run knows.
    """

    api: RestInterface
    values: Values

    def send(
        self,
        operation: Operation,
        path: str = "",
        body: Any = None,
        *,
        query: Mapping[str, Any] | None = None,
        headers: tuple[tuple[str, str], ...] = (),
        media_type: str = "",
        fresh: bool = False,
    ) -> Exchange:
        """Send an operation's usual request as `request` makes it; fresh: on a connection of its own."""
        outgoing = self.request(operation, path, body, query=query, headers=headers, media_type=media_type)
        return self.api.send(outgoing, fresh=fresh)

    def request(
        self,
        operation: Operation,
        path: str = "",
        body: Any = None,
        *,
        query: Mapping[str, Any] | None = None,
        headers: tuple[tuple[str, str], ...] = (),
        media_type: str = "",
    ) -> Outgoing:
        """Return an operation's usual request, with another path, JSON body or query, and further headers, if given.

        Args:
            operation: the operation.
            path: instead of that of the usual request.
            body: instead of the usual one.
            query: members of the query that differ from the usual ones.
            headers: beside the usual ones.
            media_type: by which the body is called, instead of its own.
        """
        inputs = usual_inputs(operation, self.values)[0]
        inputs = inputs if body is None else replace(inputs, body=body)
        inputs = inputs if query is None else replace(inputs, query={**inputs.query, **query})
        request = request_of(operation, with_new_values(operation, inputs, self.values))
        rest = "".join(request.target.partition("?")[1:])
        given = {name.lower() for name, _ in headers}
        kept = [pair for pair in request.headers if pair[0].lower() not in given]
        request = replace(request, headers=(*kept, *headers))
        request = request.having_type(media_type) if media_type else request
        return replace(request, target=path + rest) if path else request

    def bodies(self, operation: Operation, turn: int, now: dict[str, Any] | None = None) -> list[dict[str, Any]]:
        """Return JSON objects to send with an operation: with other values in each turn, then the usual one.

        Args:
            operation: takes JSON, or has no body that is tried.
            turn: number of the write.
            now: what the thing reads now; its members are in the body as far as the schema has them.
        """
        usual = usual_inputs(operation, self.values)[0]
        if not is_json(usual.media_type) or not isinstance(usual.body, dict):
            return []
        schema = operation.bodies[usual.media_type].schema
        whole = whole_body(operation, self.values)[1]
        base = usual.body if operation.method == "PATCH" or not isinstance(whole, dict) else whole
        base = base if base and fits(schema, base) else whole if isinstance(whole, dict) else usual.body
        parts = flat(schema).get("properties", {})
        present = {name: one for name, one in (now or {}).items() if name in parts and not parts[name].get("readOnly")}
        full = {**base, **{name: one for name, one in present.items() if fits(parts[name], one)}}
        first = full if fits(schema, full) else base
        return [another(schema, first, turn, self.values.collections), first, usual.body]

    def singly(
        self, change: Operation, now: dict[str, Any], may: Callable[[str, dict[str, Any]], bool]
    ) -> list[dict[str, Any]]:
        """Return bodies that change one member of a thing each, and a last one that restores them.

        Args:
            change: a PUT or PATCH.
            now: what the thing reads now.
            may: returns whether a member, by its name and schema, may be changed.
        """
        made = self.bodies(change, 1, now)
        media_type = next(iter(change.bodies), "")
        if len(made) < 2 or not is_json(media_type):  # noqa: PLR2004 - see bodies()
            return []
        schema, base = change.bodies[media_type].schema, made[1]
        whole = {**base, **{name: now[name] for name in made[0] if name in now and name in base}}
        values = another(schema, whole, 1, self.values.collections)
        chosen = {name: value for name, value in values.items() if value != whole.get(name)}
        texts = other_texts(schema, whole)
        chosen |= {name: one for name, one in texts.items() if name in chosen or whole[name] is None}
        parts, found = flat(schema).get("properties", {}), list[dict[str, Any]]()
        for name, value in chosen.items():
            body = {name: value} if change.method == "PATCH" else {**whole, name: value}
            found += [body] if may(name, parts[name]) and fits(schema, body) else []
        # A PUT of all members, and one that leaves out what it may, show defaults.
        least = {name: whole[name] for name in flat(schema).get("required", ()) if name in whole}
        every = {**whole, **{name: one for name, one in chosen.items() if may(name, parts[name])}}
        is_put = change.method == "PUT" and least != whole and fits(schema, least) and fits(schema, every)
        return [
            *found[:_MEMBERS],
            *([every, least] if found and is_put else []),
            *([whole] if found and fits(schema, whole) else []),
        ]

    def with_items(
        self, operation: Operation, bodies: list[dict[str, Any]], turn: int, *, whole: bool = False
    ) -> list[dict[str, Any]]:
        """Return bodies, before them the first one with several items in each list of objects, if that is another.

        Before that one comes another with many items and their optional members, if ``whole``.
        """
        schemas = [operation.bodies[name].schema for name in operation.bodies if bodies and is_json(name)][:1]
        made, collections = list[dict[str, Any]](), self.values.collections
        for schema in schemas:
            made += [with_items(schema, bodies[0], turn, collections, whole=True)] if whole else []
            made += [with_items(schema, bodies[0], turn, collections)]
        return [*(body for number, body in enumerate(made) if body not in (bodies[0], *made[:number])), *bodies]

    def until(self, read: Callable[[], _Read], holds: Callable[[_Read], bool]) -> _Read:
        """Return the first read that meets a condition, or the last one after a few seconds."""
        patience = Patience(self.api.client.connection.pace, _SETTLES_S)
        while True:
            found = read()
            if holds(found) or patience.over:
                return found
            time.sleep(_PAUSE_S)

    def settle(self, read: Callable[[], Exchange], wrong: Callable[[Exchange], Sequence[str]]) -> Settled:
        """Return the first read without a fault, or the last one and the faults of the last few."""
        seen: list[Sequence[str]] = []

        def holds(exchange: Exchange) -> bool:
            seen.append(wrong(exchange))
            return not seen[-1]

        found = self.until(read, holds)
        lasting = set(seen[-1]).intersection(*seen[-_LAST:])
        return Settled(found, tuple(text for text in seen[-1] if text in lasting))

    def read_back(
        self,
        operation: Operation,
        read: Operation,
        path: str,
        sent: Exchange,
        *,
        before: Exchange | None = None,
        fresh: bool = False,
    ) -> Write:
        """Read a thing until it shows written values; before: an earlier read; fresh: new connections."""
        found = self.settle(
            lambda: self.send(read, path, fresh=fresh),
            lambda exchange: self.differing(operation, read, sent, exchange, before),
        )
        doubt = doubt_of_write(operation, read)
        return Write(operation.label, read.label, sent, found.exchange, found.wrong, doubt)

    def differing(
        self, operation: Operation, read: Operation, sent: Exchange, found: Exchange, before: Exchange | None = None
    ) -> tuple[str, ...]:
        """Return the differences between a request's and a response's content; empty if they cannot be compared."""
        body, media_type = read_json(sent.request.body).value, sent.request.media_type
        if body is None or not found.response.ok or media_type not in operation.bodies:
            return ()
        schema = operation.bodies[media_type].schema
        if not isinstance(body, dict):
            body, schema = {WHOLE: body}, {"properties": {WHOLE: schema}}
        was = members(before, body) if before else {}
        told = as_answered(body, members(sent, body), was, schema, operation.text)
        now, collections = members(found, body), self.values.collections
        differs = tuple(differences(body, now, schema, read.shape, collections))
        return differs if any(differences(told, now, schema, read.shape, collections)) else ()

    def change(self, operation: Operation, read: Operation, path: str, turn: int) -> Write | None:
        """Write other values to a thing, and read them back; None if the device does not accept them, or only later."""
        before = self.send(read, path)
        bodies = self.bodies(operation, turn, members(before, ())) if before.response.ok else []
        for body in self.with_items(operation, bodies, turn, whole=True):
            sent = self.conditional(operation, read, path, body)
            if sent.response.ok:
                is_later = sent.response.status == _ACCEPTED
                return None if is_later else self.read_back(operation, read, path, sent, before=before)
        return None

    def conditional(self, operation: Operation, read: Operation, path: str, body: Any = None) -> Exchange:
        """Send a request; if the device wants a condition, send it again with the entity tag that it has now."""
        sent = self.send(operation, path, body)
        if sent.response.status in _WANTS_CONDITION and (tag := self.send(read, path).response.header("etag")):
            return self.send(operation, path, body, headers=(("If-Match", tag),))
        return sent


def takes_tags(change: Operation, tags: str) -> bool:
    """Return whether an operation's declared If-Match allows these tags."""
    return all(
        fits(parameter.schema, tags) for parameter in change.parameter("header") if parameter.name.lower() == "if-match"
    )


def members(exchange: Exchange, names: Any) -> dict[str, Any]:
    """Return the members of the thing in a JSON response; names: those that it probably has."""
    value = read_json(exchange.response.body).value if is_json(exchange.response.media_type) else None
    return object_in(value, {plain_name(name) for name in names})
