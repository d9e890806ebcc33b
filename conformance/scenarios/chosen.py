"""Lists that filter and sort by a member, and counts, before and after a thing's member gets another value.

A device may keep an index of its things, or an answer, and forget to renew it; it may compare numbers as texts.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any, Final
from urllib.parse import quote

from conformance.api.rest.listing import Listing, fitting, listing_of, members_of
from conformance.api.rest.patches import JSON_PATCH
from conformance.api.rest.references import singular
from conformance.api.rest.samples import fits
from conformance.api.rest.things import collection_of, parts_of
from conformance.checkers.lists import LEVELS
from conformance.documents.json_schema import kinds_of
from conformance.documents.openapi import Operation
from conformance.documents.parameters import Parameter, plain_name
from conformance.documents.representation import flat
from conformance.scenarios.list_queries import many_items
from conformance.scenarios.living import Kind, Living, State, Thing, is_stored
from conformance.scenarios.whole_list import WholeList, read_whole
from conformance.scenarios.writing import members
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import SENTENCE

# Filters that are tried.
_FILTERS: Final = 2
_ACCEPTED: Final = 202
# Phrases in a description which say that a number counts what exists now, or what has ever existed.
_NOW: Final = re.compile(
    r"\b(?:how many|number of)\b[^.]*\b(?:have|has|are|is|currently|now|with|in|on)\b", re.IGNORECASE
)
_EVER: Final = re.compile(
    r"\b(?:ever|total|so far|since|was|were|been|had|not|only|except|without|handled|processed)\b", re.IGNORECASE
)
# Numbers whose order as texts is the other way round.
_NUMBERS: Final = (9, 10)


@dataclass(frozen=True)
class Chosen:
    """The lists of one collection.

    Attributes:
        living: its things.
        changes: the operations that change one of them.
        operations: all that may be called, by method and path.
    """

    living: Living
    changes: list[Operation]
    operations: Mapping[tuple[str, str], Operation]

    def look(self) -> None:
        """Give things other values by each operation that does, and read the lists that depend on them."""
        lister, things = self.living.lister, self.living.of(State.ALIVE)
        listing = listing_of(lister) if lister is not None else None
        if listing is None or not things or not things[-1].id or not self.changes:
            return
        for number, (name, parameter) in enumerate(islice(_filters(listing), _FILTERS)):
            for change in self.changes[: 1 if number else None]:
                if not self.living.is_over:
                    self._read_filtered(listing, things[-1], change, (name, parameter))
        self._read_sorted(listing, things)

    def look_after(self, thing: Thing, before: dict[str, Any]) -> None:
        """Read the lists that leave out a thing, or include it, by what an operation has changed."""
        listing = listing_of(self.living.lister) if self.living.lister is not None and thing.id else None
        was, now = members_of(before), members_of(members(thing.last, before))
        for name, parameter in listing.filters.items() if listing is not None else ():
            if was.get(name) != now.get(name) and fitting(parameter, was.get(name)) and listing is not None:
                # A checker judges each item of it.
                self._list(listing, thing, {parameter.name: was[name]})
        for name, parameter in listing.includes.items() if listing is not None else ():
            if now.get(name) is True and listing is not None:
                found = self.living.writer.until(
                    partial(self._list, listing, thing, {parameter.name: True}), lambda item: thing.id in item.ids
                )
                other = "" if thing.id in found.ids or not found.is_whole else "a list without it"
                expected = f"a list with {thing.id} by {parameter.name}=true, as it is {name}"
                label = listing.operation.label
                self.living.note(Kind.CHOSEN, label, found.exchange, expected, other, thing, SENTENCE)

    def _read_filtered(self, listing: Listing, thing: Thing, change: Operation, by: tuple[str, Parameter]) -> None:
        """Change the member that a filter is for, and read the lists of both values until they are right."""
        name, parameter = by
        was = members_of(members(thing.last, ())).get(name)
        if was is None or not fitting(parameter, was):
            return
        lists = {
            value: self._list(listing, thing, {parameter.name: value}) for value in (was, *_values(parameter, was))
        }
        # If one list had the thing before and another did not, the filter chooses by the member of its name.
        usable = [one for one, found in lists.items() if one != was and found.is_whole and thing.id not in found.ids]
        if is_stored(lists[was].exchange) or not usable:
            return
        if thing.id not in lists[was].ids:
            # Other things are listed for this value, so the filter chooses by this member.
            is_by = lists[was].is_whole and any(members_of(item).get(name) == was for item in lists[was].items)
            if is_by and thing.id in self._list(listing, thing, {}).ids:
                other, expected = "a list without it", f"a list with {thing.id} by {parameter.name}={was}, as it reads"
                self.living.note(Kind.CHOSEN, listing.operation.label, lists[was].exchange, expected, other, thing)
            return
        counted = list(self._counts(name, (was, usable[0])))
        counts = [one for one in counted if _agrees(one[1], lists) or self._is_said(one[0])]
        written = self._set(thing, change, name, usable[0])
        if written is None:
            return
        after, is_right = f"after {written.request.method} {written.request.target.partition('?')[0]}", True
        for value, is_in in ((usable[0], True), (was, False)):
            found = self.living.writer.until(
                partial(self._list, listing, thing, {parameter.name: value}),
                lambda item, is_in=is_in: (thing.id in item.ids) is is_in,  # type: ignore[misc] # bound in its round
            )
            lists[value] = found
            other = "" if (thing.id in found.ids) is is_in else f"a list with{'out' if is_in else ''} it"
            expected = f"a list with{'' if is_in else 'out'} {thing.id} by {parameter.name}={value} {after}"
            is_right &= not other and found.is_whole
            self.living.note(Kind.CHOSEN, listing.operation.label, found.exchange, expected, other, thing)
        for read, before in counts if is_right else ():
            for value in before:
                self._count(read, value, len(lists[value].items), thing, after)

    def _list(self, listing: Listing, thing: Thing, query: dict[str, Any]) -> WholeList:
        path = thing.path.rstrip("/").rpartition("/")[0] + ("/" if listing.operation.template.endswith("/") else "")
        always = {**many_items(listing), **query}
        return read_whole(self.living.writer, listing.operation, self.living.read, path, always)

    def _set(self, thing: Thing, change: Operation, name: str, value: Any) -> Exchange | None:
        """Give a member of a thing another value; return the request if it reads so, else None."""
        living, media_type = self.living, next(iter(change.bodies), "")
        now = members(thing.last, ())
        own = next((text for text in now if members_of({text: 0}).keys() == {name}), "")
        if JSON_PATCH in media_type:
            body: Any = [{"op": "replace", "path": f"/{own}", "value": value}]
        elif change.method == "PATCH":
            body = {own: value}
        else:
            made = living.writer.bodies(change, 0, now)
            body = {**made[1], own: value} if made and own in made[1] else None
        if not own or body is None or not fits(change.bodies[media_type].schema, body):
            return None
        sent = living.writer.conditional(change, living.read, thing.path, body)
        if not sent.response.ok or sent.response.status == _ACCEPTED:
            return None
        found = living.writer.until(
            lambda: living.writer.send(living.read, thing.path),
            lambda exchange: members(exchange, (own,)).get(own) == value,
        )
        thing.last = found if found.response.ok else thing.last
        if members(found, (own,)).get(own) != value:
            thing.kept = {}
            return None
        thing.kept |= {own: value} if own in thing.kept else {}
        return sent

    def _counts(self, name: str, values: tuple[Any, Any]) -> Iterator[tuple[Operation, dict[Any, int]]]:
        """Yield what counts these things by a member, as a lane counts the parcels that have it: before a change."""
        for (method, path), read in self.operations.items():
            parameters = read.parameter("path")
            is_of = singular(collection_of(path).rpartition("/")[2]) == name and method == "GET"
            if is_of and len(parameters) == 1 and all(fits(parameters[0].schema, one) for one in values):
                told = {one: self._count_of(read, one)[1] for one in values}
                if found := {value: one for value, one in told.items() if one is not None}:
                    yield read, found

    def _is_said(self, read: Operation) -> bool:
        """Return whether the description says that a count is of the things that exist now."""
        things = plain_name(collection_of(self.living.read.template).rpartition("/")[2])
        said = flat(members_of(parts_of(read.shape or {})).get(things, {})).get("description")
        return isinstance(said, str) and bool(_NOW.search(said)) and not _EVER.search(said)

    def _count_of(self, read: Operation, value: Any) -> tuple[Exchange, int | None]:
        """Return the number of things with a value that a resource reports, or None."""
        things = plain_name(collection_of(self.living.read.template).rpartition("/")[2])
        path = read.template.replace(f"{{{read.parameter('path')[0].name}}}", quote(str(value), safe=""))
        found = self.living.writer.send(read, path)
        told = members_of(members(found, (things,))).get(things) if found.response.ok else None
        return found, told if isinstance(told, int) and not isinstance(told, bool) else None

    def _count(self, read: Operation, value: Any, right: int, thing: Thing, after: str) -> None:
        """Read a count until it is that of the list."""
        found, told = self.living.writer.until(partial(self._count_of, read, value), lambda pair: pair[1] == right)
        expected = f"{right}, as many as the list by {value} has {after}"
        self.living.note(Kind.SHOWN, read.label, found, expected, "" if told == right else str(told), thing)

    def _read_sorted(self, listing: Listing, things: list[Thing]) -> None:
        """Give two things numbers that sort differently as texts, and sort by them; a checker judges the lists."""
        sort = listing.sort
        if sort is None or len(things) < len(_NUMBERS):
            return
        names = dict.fromkeys(sorting.member for sorting in listing.sortings.values())
        numbers = [name for name in names if kinds_of(listing.members[name]) & {"number", "integer"}]
        for name in (number for number in numbers if all(fits(listing.members[number], value) for value in _NUMBERS)):
            done = [self._set(thing, self.changes[0], name, one) for thing, one in zip(things, _NUMBERS, strict=False)]
            texts = [text for text, one in listing.sortings.items() if one.member == name]
            for text in (*texts, *texts) if None not in done and not self.living.is_over else ():
                self._list(listing, things[0], {sort.name: [text] if "array" in kinds_of(sort.schema) else text})


def _filters(listing: Listing) -> Iterator[tuple[str, Parameter]]:
    """Yield the filters with known values that are compared with a member."""
    for name, parameter in listing.filters.items():
        is_named = "enum" in flat(parameter.schema) or kinds_of(parameter.schema) == {"boolean"}
        if is_named and name not in LEVELS and "array" not in kinds_of(parameter.schema):
            yield name, parameter


def _values(parameter: Parameter, was: Any) -> list[Any]:
    """Return other values of a filter."""
    found = flat(parameter.schema).get("enum", [True, False])
    return [item for item in found if item not in (was, None) and fitting(parameter, item)][:1]


def _agrees(counts: dict[Any, int], lists: Mapping[Any, WholeList]) -> bool:
    """Return whether counts are those of the whole lists, and not all zero."""
    return any(counts.values()) and all(
        lists[value].is_whole and len(lists[value].items) == one for value, one in counts.items()
    )
