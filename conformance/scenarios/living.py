"""Things that a cycle has created: read them again after each request to something else, and compare."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import quote

from conformance.api.rest.listing import IN_TIME, fitting, listing_of
from conformance.api.rest.things import differences, identifier_of, is_marked_deleted, is_shared, object_in, parts_of
from conformance.documents.json_schema import Schema, is_number
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import Operation
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.scenarios.whole_list import WholeList, chooses, read_whole
from conformance.scenarios.writing import Write, Writer, members
from conformance.transport.exchange import Exchange

ABSENT: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.GONE})
# Things that are read after each step.
_LOOKED: Final = 4
# States of things that end by themselves, and may then be removed.
_ENDED: Final = frozenset(
    {"done", "finished", "completed", "complete", "ended", "failed", "cancelled", "canceled", "succeeded", "expired"}
)
_STATES: Final = ("state", "status", "phase")
# Members whose text depends on the URL of the read; texts that begin with a date.
_PLACES: Final = re.compile(r"(?:url|uri|href|link|links|self|path)$")
_TIME: Final = re.compile(r"\d{4}-\d\d-\d\d")
_MANY: Final = 10
# Items on a page when a list is read in pages.
_PAGE: Final = 2
# Why a list may lack a thing that was changed since it was created.
_LEFT_OUT: Final = "a list may leave out things in some states"
_IN_SHORT: Final = "a list may show its items in short"
# Newest things that a collection keeps: it drops older ones.
_RING: Final = 3


class Kind(StrEnum):
    """The rule that a read breaks, if it is not as expected."""

    THERE = "there"  # a created thing is lost, not listed, or has another thing's identifier
    KEPT = "kept"  # a written value reads differently later
    GONE = "gone"  # a deleted thing is back, or still listed
    SHOWN = "shown"  # the list shows other values than the item
    ORDER = "order"  # the list is not in the order of creation that its description tells
    CHOSEN = "chosen"  # a filtered list has a thing by its former value
    REFUSED = "refused"  # a refused request has changed something


@dataclass(frozen=True)
class Look:
    """One read after a request to another thing, or after a refused request.

    Attributes:
        kind: what it would show.
        operation: label of the request before it.
        found: the response that shows it.
        expected: what should have been found, as a noun phrase.
        other: what was found instead; empty if it was as expected.
        after_s: how long after the creation it was.
        doubt: as in Case.
    """

    kind: Kind
    operation: str
    found: Exchange
    expected: str
    other: str = ""
    after_s: float = 0.0
    doubt: str = ""


@dataclass(frozen=True)
class Life:
    """The recorded life of a thing that was created, or of one that always exists and was written.

    Attributes:
        create, read, delete: labels of the operations; an empty one was not sent.
        created: the request that created the thing.
        found: the GET after it.
        deleted: the DELETE, or None.
        gone: the GET after the DELETE, or None.
        id: its identifier in the response to the creation; empty if the response has none.
        found_id: its identifier in the response to GET; empty if the response has none.
        writes: what was written to it, the creation first.
        looks: later reads of this thing and of others.
        doubt: why GET may still return it after the DELETE; empty if GET must not.
    """

    create: str
    read: str
    created: Exchange
    found: Exchange
    delete: str = ""
    deleted: Exchange | None = None
    gone: Exchange | None = None
    id: str = ""
    found_id: str = ""
    writes: tuple[Write, ...] = ()
    looks: tuple[Look, ...] = ()
    doubt: str = ""


class State(StrEnum):
    """What the run knows about a thing's existence."""

    ALIVE = "alive"
    GONE = "gone"
    UNKNOWN = "unknown"


@dataclass
class Thing:
    """A thing, its life so far, and its current state as far as known.

    Attributes:
        path: where it is.
        life: what was done with it.
        last: the last read of it.
        kept: the members that read as they were written.
        schema: the schema of the body which wrote them.
        state: whether it is there.
        is_own: whether the run has created it.
        is_told: whether the list was found wrong about it.
        has_acted: whether an operation was called that may have changed its state.
        made_s: when it was made, s on the monotonic clock.
    """

    path: str
    life: Life
    last: Exchange
    kept: dict[str, Any] = field(default_factory=dict)
    schema: Schema = field(default_factory=dict)
    state: State = State.ALIVE
    is_own: bool = True
    is_told: bool = False
    has_acted: bool = False
    made_s: float = field(default_factory=time.monotonic)

    @property
    def id(self) -> str:
        """Return the thing's identifier in lower case; empty if it has none."""
        return (self.life.found_id or self.life.id).casefold()


@dataclass
class Living:
    """The things of one collection.

    Attributes:
        writer: sends the requests.
        read: the operation that reads one of them.
        lister: the operation that lists them, or None.
        until: no further looks are taken after this, s on the monotonic clock.
        things: all of them.
        looks: what was seen.
        listing: the last reading of the list, or None.
        at: path of the list, where it is not that above its things; empty until the first of them is created.
    """

    writer: Writer
    read: Operation
    lister: Operation | None
    until: float
    things: list[Thing] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)
    listing: WholeList | None = None
    at: str = ""
    _shown: bool = False
    _capped: bool = False
    # Whether a thing has survived the creation of another.
    _lasts: bool = False
    _is_shown_otherwise: bool = False
    _replaced: list[Look] = field(default_factory=list)  # things that were lost before that was known

    @property
    def is_over(self) -> bool:
        """Whether the time for looks is over."""
        return time.monotonic() > self.until

    def of(self, state: State) -> list[Thing]:
        """Return the things of the run in a state."""
        return [thing for thing in self.things if thing.is_own and thing.state is state]

    def remember(self, thing: Thing, write: Write | None, operation: Operation) -> None:
        """Remember the values of a request that a read returned as they were written."""
        thing.kept = {}
        thing.last = write.found if write else thing.last
        if write is None or not operation.bodies:
            return
        body, now = read_json(write.sent.request.body).value, members(write.found, ())
        thing.schema = next(iter(operation.bodies.values())).schema
        if isinstance(body, dict):
            now = members(write.found, body)
            usable = {name: one for name, one in body.items() if name in now and not is_shared(name)}
            thing.kept = {name: one for name, one in usable.items() if not self._differ(thing, {name: one}, now)}

    def read_anew(self) -> None:
        """Read the living things after a request that may have changed any of them."""
        for thing in self.of(State.ALIVE):
            found = self._read(thing)
            now = members(found, thing.kept) if found.response.ok else {}
            thing.kept = {name: now[name] for name in thing.kept if name in now}
            thing.last = found if found.response.ok else thing.last

    def _differ(self, thing: Thing, kept: dict[str, Any], now: dict[str, Any]) -> list[str]:
        return list(differences(kept, now, thing.schema, self.read.shape, self.writer.values.collections))

    def other(self, thing: Thing, found: Exchange, said: Mapping[str, Any] | None = None) -> list[str]:
        """Return in which members a thing reads differently than before, as noun phrases.

        Args:
            thing: what is known of it.
            found: a read of it.
            said: what an action has changed in another thing, and was not so in this one.
        """
        if found.response.status in ABSENT:
            return [f"status {found.response.status}"]
        now = members(found, thing.kept) if found.response.ok else {}
        lost = [f"no {name}" for name in thing.kept if name not in now] if now else []
        was = members(thing.last, said or ())
        alike = [name for name, one in (said or {}).items() if was.get(name) != one == now.get(name)]
        return [*lost, *self._differ(thing, thing.kept, now), *(f"{clip(now[name])} as {name}" for name in alike)]

    def check(
        self,
        thing: Thing,
        after: Exchange,
        operation: str,
        kind: Kind | None = None,
        said: Mapping[str, Any] | None = None,
    ) -> None:
        """Read a thing until it reads as before, and record the difference if it does not.

        Args:
            thing: a living one.
            after: the request before.
            operation: the label of that.
            kind: what it shows if the thing has changed; by default: that it was lost, or what was written.
            said: see other().
        """
        settled = self.writer.settle(partial(self._read, thing), lambda exchange: self.other(thing, exchange, said))
        found, wrong = settled.exchange, settled.wrong
        is_lost = found.response.status in ABSENT
        if is_lost:
            thing.state = State.UNKNOWN
            wrong = () if self._is_ended(thing) or self._is_dropped(thing, after) else wrong
        elif wrong:
            now = members(found, thing.kept)
            thing.kept = {name: one for name, one in thing.kept.items() if not self._differ(thing, {name: one}, now)}
        thing.last = found if found.response.ok else thing.last
        expected = f"the thing as it was read before {_change_text(after)}"
        kind = kind or (Kind.THERE if is_lost else Kind.KEPT)
        creates = after.request.method == "POST" and after.response.status == HTTPStatus.CREATED
        if creates and not is_lost:
            # A new thing does not replace those before.
            self.looks += self._replaced
            self._replaced = []
            self._lasts = True
        self.note(kind, operation, found, expected, "; ".join(wrong), thing)
        if creates and is_lost and wrong and not self._lasts:
            self._replaced.append(self.looks.pop())

    def _read(self, thing: Thing) -> Exchange:
        return self.writer.send(self.read, thing.path)

    def note(
        self, kind: Kind, operation: str, found: Exchange, expected: str, other: str, thing: Thing, doubt: str = ""
    ) -> None:
        """Add a look; see Look."""
        self.looks.append(Look(kind, operation, found, expected, other, time.monotonic() - thing.made_s, doubt))

    @staticmethod
    def _is_ended(thing: Thing) -> bool:
        """Return whether a thing has ended by itself, by its last read."""
        now = members(thing.last, _STATES)
        return any(isinstance(item, str) and item.casefold() in _ENDED for item in now.values())

    def _is_dropped(self, thing: Thing, after: Exchange) -> bool:
        """Return whether a lost thing was the oldest of a full collection, and something was created."""
        if self.listing is None or after.request.method not in {"POST", "PUT"} or self.lister is None:
            return False
        before = self.listing.ids
        now = self.list_of(thing)
        is_full = len(before) >= _RING and len(now.items) == len(before)
        return is_full and thing.id in {before[0], before[-1]}

    def look(
        self, after: Exchange, operation: str, own: Thing | None = None, said: Mapping[str, Any] | None = None
    ) -> None:
        """Read the list, and other things after a request to one of them, or to none; ``said`` as in other()."""
        if self.is_over:
            return
        created = own.life.created if own else None
        others = [one for one in self.of(State.ALIVE) if one.life.created is not created]
        for thing in others if len(others) <= _LOOKED else (*others[:1], *others[1 - _LOOKED :]):
            self.check(thing, after, operation, said=said)
        deleted = [one for one in self.of(State.GONE) if one is not own]
        for thing in deleted[-_LOOKED:]:
            found = self.writer.until(partial(self._read, thing), lambda exchange: not exchange.response.ok)
            other = f"status {found.response.status}" if found.response.ok else ""
            thing.state = State.UNKNOWN if other else thing.state
            self.note(Kind.GONE, operation, found, f"status 404 or 410, as before {_change_text(after)}", other, thing)
        if self.lister is not None and self.of(State.ALIVE) + self.of(State.GONE):
            self._look_at_list(after, operation)

    def _look_at_list(self, after: Exchange, operation: str) -> None:
        """Read the list until it has each living thing, once, and none that was deleted."""
        thing = self.things[-1]
        before, is_new = self.listing, after is thing.life.created
        self.listing = listing = self.writer.until(
            lambda: self.list_of(thing), lambda whole_list: not self._wrong(whole_list)
        )
        # A long list that does not grow may have a limit of its own.
        self._capped |= is_new and before is not None and _MANY <= len(listing.items) <= len(before.items)
        wrong = self._wrong(listing)
        self._shown = self._shown or any(one.id in listing.ids for one in self.of(State.ALIVE) if one.id)
        if not wrong:
            self.note(Kind.THERE, operation, listing.exchange, "a list of the living things", "", thing)
        for thing, kind, expected, other in wrong:
            text = f"{expected} after {_change_text(after)}"
            is_changed = kind is Kind.THERE and len(thing.life.writes) > 1
            self.note(kind, operation, listing.exchange, text, other, thing, _LEFT_OUT if is_changed else "")
            thing.is_told = True
        if is_new and before is not None and before.is_whole:
            expected = f"one more thing in the list after {_change_text(after)}"
            self.note(Kind.THERE, operation, listing.exchange, expected, self._twin(thing, before, listing), thing)
        self._look_at_order(operation)
        for thing in self.of(State.ALIVE)[-_LOOKED:] if not self._is_shown_otherwise else ():
            self._compare(thing, operation)

    def _twin(self, thing: Thing, before: WholeList, now: WholeList) -> str:
        """Return the identifier of another new item with the values of a thing that was just created; else nothing."""
        known = {*before.ids, *(one.id for one in self.things)}
        for item, id_ in zip(now.items, now.ids, strict=True):
            shared = thing.kept.keys() & item.keys() if id_ and id_ not in known else ()
            if len(shared) > 1 and not self._differ(thing, thing.kept, item):
                return f"{id_} as well, with the same values"
        return ""

    def _look_at_order(self, operation: str) -> None:
        """Compare the order of the list with the order of creation, if the description promises that order."""
        said = IN_TIME.search(self.lister.text) if self.lister is not None else None
        if said is None or self.listing is None:
            return
        made = [thing.id for thing in self.of(State.ALIVE) if self.listing.ids.count(thing.id) == 1]
        made = made[::-1] if said[1] else made
        there = [id_ for id_ in self.listing.ids if id_ in made]
        if len(made) > 1:
            expected, other = f"{', '.join(made)}, the {said[0].lower()}", "" if there == made else ", ".join(there)
            self.note(Kind.ORDER, operation, self.listing.exchange, expected, other, self.things[-1])

    def _compare(self, thing: Thing, operation: str) -> None:
        """Compare a thing in the list with itself, again and again where they differ and the thing is steady."""
        if self.lister is None or self.listing is None or not thing.last.response.ok:
            return
        names, expected = alike_members(self.read, self.lister), "the values that the thing itself has before and after"
        if not otherwise(thing.last, self.listing, thing.id, names):
            if thing.id in self.listing.ids and names:
                self.note(Kind.SHOWN, operation, self.listing.exchange, expected, "", thing)
            return

        def read() -> tuple[WholeList, list[str]]:
            first, listing, last = self._read(thing), self.list_of(thing), self._read(thing)
            is_steady = first.response.ok and last.response.body == first.response.body
            return listing, otherwise(last, listing, thing.id, names) if is_steady else []

        listing, wrong = self.writer.until(read, lambda one: not one[1])
        self._is_shown_otherwise = bool(wrong)
        if not is_stored(listing.exchange):
            doubt = _IN_SHORT if all(text.startswith(("[]", '""')) for text in wrong) else ""
            self.note(Kind.SHOWN, operation, listing.exchange, expected, "; ".join(wrong), thing, doubt)

    def look_at_older(self) -> None:
        """Check whether the list has the things created before that can still be read and have a listed state."""
        lister, before, parameters = self.lister, self.listing, self.read.parameter("path")
        if lister is None or before is None or len(parameters) > 1 or chooses(lister) or not self._shown or self.at:
            return
        for id_ in self.writer.values.known_ids(self.read, parameters[0]) if before.is_whole else ():
            name, text = str(id_).casefold(), quote(str(id_), safe="")
            path = self.read.template.replace(f"{{{parameters[0].name}}}", text)
            found = None if name in before.ids else self.writer.send(self.read, path)
            if found is None or not found.response.ok or not self._is_listable(found, name, before):
                continue
            listing = self.writer.until(partial(self.list_of, self.things[-1]), partial(_has, name))
            other = "" if name in listing.ids or not listing.is_whole else "a list without it"
            expected = f"a list with the thing {id_}, which can be read"
            self.note(Kind.THERE, lister.label, listing.exchange, expected, other, self.things[-1])

    def _is_listable(self, found: Exchange, name: str, listing: WholeList) -> bool:
        """Return whether a thing has the identifier, is not marked as deleted, and in the state of a listed one."""
        value = read_json(found.response.body).value
        states = [{item.get(key) for key in _STATES} for item in (object_in(value, _STATES), *listing.items)]
        return identifier_of(value, self.read) == name and not is_marked_deleted(value) and states[0] in states[1:]

    def list_of(self, thing: Thing) -> WholeList:
        """Read the list that a thing is in."""
        if self.lister is None:
            raise ValueError("the collection has no list")
        above = thing.path.rstrip("/").rpartition("/")[0] + ("/" if self.lister.template.endswith("/") else "")
        # If a short list has several pages, read page after page.
        listing, is_more = listing_of(self.lister), len(self.of(State.ALIVE)) > _PAGE
        is_short = self.listing is not None and len(self.listing.items) <= _MANY - _PAGE
        limit = listing.limit if listing is not None and is_short and is_more else None
        few = {limit.name: _PAGE} if limit is not None and fitting(limit, _PAGE) else {}
        return read_whole(self.writer, self.lister, self.read, self.at or above, few)

    def _wrong(self, listing: WholeList) -> list[tuple[Thing, Kind, str, str]]:
        """Return a list's fault: the thing, the exchange, and expected and found texts."""
        found: list[tuple[Thing, Kind, str, str]] = []
        # A list that has never shown a created thing may leave out such things, if it can leave out any.
        leaves_out = self.lister is None or chooses(self.lister) or not all(listing.ids) or len(listing.ids) >= _MANY
        is_complete = listing.is_whole and not self._capped and (self._shown or not leaves_out)
        for thing in self.things:
            if not thing.id or not thing.is_own or thing.is_told:
                continue
            if thing.state is State.GONE and thing.id in listing.ids:
                found.append((thing, Kind.GONE, f"a list without the thing {thing.id}", "a list with it"))
            elif thing.state is State.ALIVE and is_complete and thing.id not in listing.ids and not thing.has_acted:
                found.append((thing, Kind.THERE, f"a list with the thing {thing.id}", "a list without it"))
            elif thing.state is State.ALIVE and thing.id in listing.twice:
                found.append((thing, Kind.THERE, f"a list with the thing {thing.id} once", "a list with it twice"))
        return found


def alike_members(read: Operation, lister: Operation) -> frozenset[str]:
    """Return the members that a list and its items have by the same schema, and that read alike wherever they are."""
    own, whole = parts_of(read.shape or {}), flat(lister.shape or {})
    inner = [whole, *(flat(item) for item in whole.get("properties", {}).values() if isinstance(item, dict))]
    kinds = [item.get(key) for item in inner for key in ("items", "additionalProperties")]
    items: Schema = next((item for item in kinds if isinstance(item, dict)), {})
    listed = flat(items).get("properties", {})
    return frozenset(
        name
        for name in own.keys() & listed.keys()
        if flat(own[name]) == flat(listed[name]) and not is_shared(name) and not _PLACES.search(plain_name(name))
    )


def otherwise(found: Exchange, listing: WholeList, id_: str, names: frozenset[str]) -> list[str]:
    """Return in which members a list shows a thing differently than the thing's own page, as noun phrases."""
    item = next((one for one, key in zip(listing.items, listing.ids, strict=True) if key == id_ and id_), {})
    now = members(found, names)
    return [
        f"{clip(item[name])} as {name}"
        for name in sorted(names & item.keys() & now.keys())
        if _is_other(now[name], item[name]) or (item[name] in ("", []) and now[name])
    ]


def _is_other(value: Any, listed: Any) -> bool:
    """Return whether two values differ, apart from what lists shorten or leave empty, order, and notations of times."""
    if isinstance(value, dict) and isinstance(listed, dict):
        return any(_is_other(value[name], listed[name]) for name in value.keys() & listed.keys())
    if isinstance(value, list) and isinstance(listed, list) and listed:
        left = [one for one in value if one not in listed]
        return len(value) != len(listed) or any(all(_is_other(one, item) for item in listed) for one in left)
    if isinstance(value, bool) or isinstance(listed, bool) or (is_number(value) and is_number(listed)):
        return bool(value != listed)
    if not (isinstance(value, str) and isinstance(listed, str)):
        return False
    is_short = value.startswith(listed.rstrip(". \u2026")) and len(listed) < len(value)
    return value != listed and not (is_short or _TIME.match(value))


def is_stored(exchange: Exchange) -> bool:
    """Return whether a response may be an older one, by its header fields (RFC 9111 5.1, 5.2.2.1)."""
    control = (exchange.response.header("cache-control") or "").lower()
    age = re.search(r"max-?age\s*=\s*0*([1-9])", control)
    return age is not None or exchange.response.header("age") is not None


def _has(name: str, listing: WholeList) -> bool:
    return name in listing.ids


def _change_text(after: Exchange) -> str:
    """Return a request in words: "DELETE /valves/3 with status 204"."""
    return f"{after.request.method} {after.request.target.partition('?')[0]} with status {after.response.status}"
