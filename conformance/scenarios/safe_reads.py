"""Read everything by GET, HEAD and OPTIONS, and check before and after whether a client's values have changed.

Settings are read before and after other things are created, changed and deleted too.

Only what clients write counts, and what they create: counters, times and measured values change by themselves, and so
may states. What has changed counts if it stays as it is for as long without these requests, and changes with them, in
each of several rounds.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any, Final

from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.inputs import request_of, usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.patches import same
from conformance.api.rest.samples import fits
from conformance.api.rest.things import another, collection_of, is_devices, is_shared
from conformance.api.rest.values import Values
from conformance.documents.json_text import clip
from conformance.documents.openapi import Operation, is_json
from conformance.documents.representation import flat
from conformance.scenarios.creating import created_path
from conformance.scenarios.living import ABSENT
from conformance.scenarios.scenario import NoOccasionError, scenario
from conformance.scenarios.singletons import is_changeable, is_free
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.survey import Surveyor
from conformance.scenarios.writing import Writer, members
from conformance.transport.exchange import Exchange, NoAnswerError, NotPermittedError, Outgoing

_ROUNDS = 3  # rounds after the first: in each, the change must show again
_WATCHED = 12  # resources that are watched
# Shortest and longest time for which no request is sent, s.
_LEAST_S, _MOST_S = 0.3, 5.0
# Number from which the values that are written first are made.
_TURN: Final = 41
# Safe requests that are sent singly, to find the one with an effect.
_SINGLE: Final = 150


@dataclass(frozen=True)
class Watched:
    """The effect of safe requests, or of requests to other things, on one resource.

    Attributes:
        operation: label of the operation that reads it.
        shown: the request that has changed it, or the read that shows it.
        expected: what should have been read, as a noun phrase.
        fault: what was read; empty means that.
        is_safe: whether the requests were safe.
    """

    operation: str
    shown: Exchange
    expected: str
    fault: str = ""
    is_safe: bool = True


@dataclass
class _Resource:
    """A resource that a client writes.

    Attributes:
        read: reads it.
        path: where it is.
        write: writes it; None if it can only be created.
        names: its members that clients write.
        delete: deletes it, if this run has created it; None otherwise.
        first: these members as they were before this run's own write, if it has written them.
        was: these members as they should be.
        last: the last read.
    """

    read: Operation
    path: str
    write: Operation | None
    names: frozenset[str]
    delete: Operation | None = None
    first: dict[str, Any] = field(default_factory=dict)
    was: dict[str, Any] = field(default_factory=dict)
    last: Exchange | None = None


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.EFFECT)
def safe_reads(api: RestInterface, values: Values) -> tuple[Watched, ...]:
    """Read writable resources before and after all safe requests, and again without them if they changed."""
    watch = _Watch(Writer(api, values))
    api.run.limit.check()
    with api.run.limit.lift(), suppress(NoAnswerError):  # the survey reports a broken connection
        found = watch.play()
        if found:
            return tuple(found)
    raise NoOccasionError("nothing that a client writes could be read")


@dataclass
class _Watch:
    """The resources of a device and its safe requests."""

    writer: Writer
    resources: list[_Resource] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._operations = callable_operations(self.writer.api)
        for (method, path), read in self._operations.items():
            if method == "GET" and len(self.resources) < _WATCHED:
                self.resources += self._resource(path, read)

    def _resource(self, path: str, read: Operation) -> list[_Resource]:
        """Return a resource to watch: one that always exists and is written, or one that is created."""
        writes = [self._operations[name, path] for name in ("PUT", "PATCH") if (name, path) in self._operations]
        writes = [operation for operation in writes if is_json(next(iter(operation.bodies), ""))]
        write = writes[0] if writes else None
        if not read.parameter("path"):
            single = write is not None and is_free(write, path) and write
            return [_Resource(read, "", single, self._names(single, single=True))] if single else []
        create = self._operations.get(("POST", collection_of(path)))
        if create is None or create.motion or len(read.parameter("path")) > 1:
            return []
        made = created_path(Surveyor(self.writer.api, self.writer.values), create, read)
        delete = self._operations.get(("DELETE", path))
        return [_Resource(read, made, write, self._names(create), delete)] if made else []

    def _names(self, operation: Operation, *, single: bool = False) -> frozenset[str]:
        """Return the members that a client writes by an operation."""
        body = next(iter(operation.bodies.values()), None)
        parts = flat(body.schema).get("properties", {}) if body is not None else {}
        collections = self.writer.values.collections
        return frozenset(
            name
            for name, one in parts.items()
            if not (is_devices(name, one, collections) or is_shared(name))
            and (not single or is_changeable(name, one, collections))
        )

    def play(self) -> list[Watched]:
        """Return the record of each resource."""
        try:
            self.resources = [resource for resource in self.resources if self._settle(resource)]
            # An earlier safe request may already have undone a change, so write something just before them.
            for resource in self.resources:
                self._write_other(resource)
            found = dict[tuple[str, bool], Watched]()
            # HEAD may undo what GET changed, so each method is tried apart. None: requests to other things.
            for methods in (("GET",), ("HEAD", "OPTIONS"), ()):
                began = time.monotonic()
                self._act(methods)
                took = min(_MOST_S, max(_LEAST_S, time.monotonic() - began))
                for resource in self.resources if methods else [one for one in self.resources if not one.path]:
                    key = resource.read.label, bool(methods)
                    if not (key in found and found[key].fault):
                        found[key] = self._judge(resource, methods, took)
            return list(found.values())
        finally:
            for resource in self.resources:
                if resource.first:
                    resource.was = resource.first
                    self._restore(resource)
                if resource.delete is not None:
                    self.writer.conditional(resource.delete, resource.read, resource.path)

    def _settle(self, one: _Resource) -> bool:
        """Note how a resource reads, twice alike; return whether it can be watched."""
        for _ in range(2):
            before, one.last = one.last, self._read(one)
            if not one.last.response.ok:
                return False
            now = {name: value for name, value in members(one.last, one.names).items() if name in one.names}
            was = members(before, one.names) if before is not None else now
            one.was = {name: value for name, value in now.items() if same(was.get(name), value)}
        return bool(one.was)

    def _write_other(self, one: _Resource) -> None:
        """Write other values to a permanent resource; if it does not show them, watch it unchanged."""
        if one.write is None or one.path or one.last is None:
            return
        schema = one.write.bodies[next(iter(one.write.bodies))].schema
        parts = flat(schema).get("properties", {})
        whole = {name: value for name, value in members(one.last, parts).items() if name in parts}
        other = another(schema, {**whole, **one.was}, _TURN, self.writer.values.collections)
        first, now = one.was, {name: other[name] for name in one.was}
        if now == first:
            return
        one.first, one.was = first, now
        if not self._restore(one):
            one.was = first
            self._restore(one)
            self._settle(one)

    def _read(self, one: _Resource) -> Exchange:
        return self.writer.send(one.read, one.path)

    def _safe(self, methods: Sequence[str]) -> Iterator[Outgoing]:
        """Yield safe requests: for each reading operation, on a thing that this run created if possible."""
        made = {resource.read.template.rstrip("/"): resource.path for resource in self.resources if resource.path}
        for (method, template), read in self._operations.items():
            if method != "GET":
                continue
            request = request_of(read, usual_inputs(read, self.writer.values)[0])
            own = next((text for text in made if f"{template}/".startswith(f"{text}/")), "")
            if own and "{" not in template[len(own) :]:
                rest = "".join(request.target.partition("?")[1:])
                request = replace(request, target=made[own].rstrip("/") + template[len(own) :] + rest)
            yield from (replace(request, method=name) for name in methods)
            for media_type in [name for name in read.formats if not is_json(name)][:1] if "GET" in methods else ():
                yield replace(request, headers=(*request.headers, ("Accept", media_type)))

    def _act(self, methods: Sequence[str]) -> None:
        """Send safe requests by these methods; without any, create, change and delete a thing of each collection."""
        self._send(self._safe(methods))
        for one in [resource for resource in self.resources if resource.delete is not None and not methods]:
            create = self._operations["POST", collection_of(one.read.template.rstrip("/"))]
            path = created_path(Surveyor(self.writer.api, self.writer.values), create, one.read)
            if path and one.delete is not None:
                if one.write is not None:
                    self.writer.change(one.write, one.read, path, _TURN)
                self.writer.conditional(one.delete, one.read, path)

    def _send(self, requests: Iterable[Outgoing]) -> Exchange | None:
        """Send safe requests; return the last exchange."""
        last = None
        for request in requests:
            with suppress(NotPermittedError, NoAnswerError):
                last = self.writer.api.send(request)
        return last

    def _wrong(self, one: _Resource) -> str:
        """Read a resource; return its difference from the expected state, as a noun phrase."""
        one.last = self._read(one)
        if one.last.response.status in ABSENT:
            return one.last.came
        now = members(one.last, one.names) if one.last.response.ok else one.was
        other = [name for name, value in one.was.items() if name in now and not same(now[name], value)]
        return "; ".join(f"{clip(now[name])} as {name} in place of {clip(one.was[name])}" for name in other)

    def _judge(self, one: _Resource, methods: Sequence[str], took: float) -> Watched:
        """Judge one resource after some requests, and if it has changed by rounds with and without them."""
        what = f"{' and '.join(methods)} of everything" if methods else "things of collections were created and deleted"
        expected, label = f"what was written before {what}", one.read.label
        wrong, last = self._wrong(one), one.last
        if last is None or not wrong:
            return Watched(label, last or self._read(one), expected, is_safe=bool(methods))
        for _ in range(_ROUNDS):
            if not self._restore(one):
                break
            time.sleep(took)
            if self._wrong(one):
                break  # the resource changes without any request too
            self._act(methods)
            if not (wrong := self._wrong(one)):
                break
        else:
            guilty = self._guilty(one, methods) if methods else None
            return Watched(label, guilty or one.last or last, expected, wrong, is_safe=bool(methods))
        self._restore(one)
        return Watched(label, last, expected, is_safe=bool(methods))

    def _guilty(self, one: _Resource, methods: Sequence[str]) -> Exchange | None:
        """Return the safe request after which a resource changed; None if only several together change it."""
        if not self._restore(one):
            return None
        for request in islice(self._safe(methods), _SINGLE):
            sent = self._send([request])
            if self._wrong(one):
                return sent
        return None

    def _restore(self, one: _Resource) -> bool:
        """Write a resource's earlier values, or create another in its place; return whether it reads so."""
        if one.path and one.last is not None and one.last.response.status in ABSENT:
            create = self._operations["POST", collection_of(one.read.template.rstrip("/"))]
            one.path = created_path(Surveyor(self.writer.api, self.writer.values), create, one.read)
            one.last = None
            return bool(one.path) and self._settle(one)
        if one.write is None:
            return False
        usual = self.writer.bodies(one.write, 0, members(one.last, ()) if one.last is not None else {})
        schema = one.write.bodies[next(iter(one.write.bodies))].schema
        parts = flat(schema).get("properties", {})
        whole = {**(usual[1] if len(usual) > 1 else {}), **{name: one.was[name] for name in one.was if name in parts}}
        if not fits(schema, whole) or not self.writer.conditional(one.write, one.read, one.path, whole).response.ok:
            return False
        found = self.writer.until(lambda: self._read(one), lambda _: not self._wrong(one))
        return found.response.ok and not self._wrong(one)
