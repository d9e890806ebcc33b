"""Write to parts of things that have no read of their own, and read the things after each write."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import quote, unquote

from conformance.api.rest.inputs import request_of, usual_inputs
from conformance.api.rest.listing import items_of
from conformance.api.rest.patches import same
from conformance.api.rest.samples import fits
from conformance.api.rest.things import collection_of, identifier_of, parts_of
from conformance.documents.json_schema import is_number
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation
from conformance.documents.representation import flat
from conformance.scenarios.singletons import is_changeable, is_free
from conformance.scenarios.writing import Writer, members
from conformance.transport.exchange import Exchange, NoAnswerError

_MOST: Final = 6  # parts that are written
_ALIKE: Final = 4  # things of a collection to whose parts the suite writes
_WORDS: Final = 2  # words of an enumeration that are written
_LATE: Final = 3  # reads for which the suite waits if they differ from the response


def write_parts(writer: Writer, operations: Mapping[tuple[str, str], Operation]) -> None:
    """Write to the parts of things; what the device refuses, because it allows less, must not change the thing."""
    parts = [
        _Part(writer, operations["GET", above], write, operations.get(("GET", collection_of(above))))
        for (method, path), write in operations.items()
        if method in {"PUT", "PATCH"} and ("GET", path) not in operations and write.bodies and is_free(write, path)
        if ("GET", above := path.rpartition("/")[0]) in operations
    ]
    for part in parts[:_MOST]:
        writer.api.run.limit.check()
        with writer.api.run.limit.lift(), suppress(NoAnswerError):
            part.write_to_things()


@dataclass
class _Part:
    """A part of a thing: how the thing is read, the part written, and the things listed, if they are."""

    writer: Writer
    read: Operation
    write: Operation
    lister: Operation | None
    late: int = 0

    def write_to_things(self) -> None:
        """Write to the usual thing and to some beside it: a device may forget one of them."""
        values, read = self.writer.values, self.read
        usual = request_of(read, usual_inputs(read, values)[0]).target.partition("?")[0]
        known = values.known_ids(read, read.parameter("path")[-1]) if collection_of(read.template) else []
        above = usual.rpartition("/")[0]
        paths = list(dict.fromkeys([usual, *(f"{above}/{quote(str(one), safe='')}" for one in known)]))[:_ALIKE]
        for number, path in enumerate(paths):
            # The last value differs from that of the thing before, so that a thing shows which one it took over.
            self._write(path, 1 if number % 2 else -1)

    def _write(self, path: str, step: int) -> None:
        """Write values to one thing, read it after each, and its list after the last; then restore it."""
        body = usual_inputs(self.write, self.writer.values)[0].body
        before = members(self.writer.send(self.read, path), ())
        if not isinstance(body, dict) or not before:
            return
        target, first, told = path + self.write.template[len(self.read.template) :], dict[str, Any](), dict[str, Any]()
        for name, value, part in [*self._values(before)][::step]:
            sent = self.writer.send(self.write, target, {**body, name: value})
            told = {one: shown for one, shown in members(sent, ()).items() if one in before and same(shown, value)}
            told = told if sent.response.ok and self._is_whole else {}
            changed = [before[one] for one in told if not same(before[one], value)]
            earlier = [before[name]] if name in before else changed
            first = {name: earlier[0], **first} if earlier and fits(part, earlier[0]) else first
            if not self._comes(lambda: self.writer.send(self.read, path), lambda found: members(found, ()), told):
                self.writer.send(self.read, path)
        above, _, id_ = path.rpartition("/")
        lister = self.lister
        if lister is not None and told:
            is_listed = self._comes(lambda: self.writer.send(lister, above), lambda found: self._item(found, id_), told)
            for one in () if is_listed else (self.read, lister) * _LATE + (self.read,):
                self.writer.send(one, path if one is self.read else above)
        if first:
            self.writer.send(self.write, target, {**body, **first})

    @property
    def _is_whole(self) -> bool:
        """Whether the response to a write to the part shows the thing."""
        return parts_of(self.write.shape) == parts_of(self.read.shape)

    def _values(self, before: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
        """Yield the members of the body with values at the limits of numbers, or of enumerations, and their schemas."""
        schema = self.write.bodies[next(iter(self.write.bodies))].schema
        usual = usual_inputs(self.write, self.writer.values)[0].body
        for name, part in flat(schema).get("properties", {}).items():
            is_other = self._is_whole and is_changeable(name, part, self.writer.values.collections)
            limits: list[Any] = [flat(part).get(key) for key in ("maximum", "minimum")]
            # Two values near the greatest one: a single one that is there afterwards may be chance.
            near = [limits[0] - type(limits[0])((limits[0] - limits[1]) / 10)] if all(map(is_number, limits)) else []
            words = flat(part).get("enum", ())[-_WORDS:] if is_other else ()
            for value in [*filter(is_number, [*near, *limits]), *words] if name in before or is_other else ():
                if fits(schema, {**usual, name: value}):
                    yield name, value, part

    def _comes(
        self, read: Callable[[], Exchange], view: Callable[[Exchange], dict[str, Any]], told: Mapping[str, Any]
    ) -> bool:
        """Return whether a read shows what a response did; the first times, wait for that as long as a device may."""

        def shows(found: Exchange) -> bool:
            now = view(found)
            return all(same(now.get(name), value) for name, value in told.items())

        if shows(read()):
            return True
        self.late += 1
        return self.late <= _LATE and shows(self.writer.until(read, shows))

    def _item(self, found: Exchange, id_: str) -> dict[str, Any]:
        """Return a thing as its list shows it."""
        items = [one for one in items_of(read_json(found.response.body).value) or () if isinstance(one, dict)]
        return next((one for one in items if identifier_of(one, self.read) == unquote(id_).casefold()), {})
