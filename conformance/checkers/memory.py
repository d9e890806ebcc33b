"""Things over a run, by all reads: deleted things stay gone, created things exist, and writes last.

A device may take a while, things may end and values may change by themselves, as a velocity that nobody renews does. So
only what lasted for as long in another thing of the same collection has to last, and what is being changed is not
judged.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import quote, unquote, urlsplit

from conformance.api.call_rules import words_of
from conformance.api.rest.listing import items_of
from conformance.api.rest.references import collections_of, refers, singular
from conformance.api.rest.things import (
    SET,
    as_answered,
    collection_of,
    differences,
    doubt_of_deletion,
    doubt_of_life,
    id_member,
    identifier_of,
    is_devices,
    is_marked_deleted,
    is_reordered,
    is_shared,
    parts_for,
    parts_of,
    says_absent_again,
    says_exactly,
    says_gone,
)
from conformance.checkers.occasion import ABSENT, MOST_OCTETS, SETTLES_S, Occasion
from conformance.checkers.writes import DEFAULTED
from conformance.contract.pack import Contract
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.transport.exchange import Exchange
from conformance.transport.reach import is_same, joined
from conformance.verdict.evidence import SENTENCE, Case

_REFUSED: Final = range(400, 500)
# How often a difference must appear before it counts, because other clients or several server processes may cause one.
_SEEN: Final = 2
_MOST_PENDING: Final = 20
_MOST_THINGS: Final = 1_000
# Characters of a value in a message.
_SHOWN: Final = 200
# Names of members that keep their value when a thing changes.
_FOR_EVER: Final = re.compile(r"id|uuid|guid|serial|serialnumber|created(?:at|on|time|date)?|creation(?:time|date)")
_TELLING: Final = 5  # an identifier with this many characters is unlikely to be equal by chance
_READ: Final = "written-is-read"
_NOTHING: Final[tuple[Any, ...]] = (None, "", 0, False, [], {})
_GONE: Final = "deleted-is-gone"
# Phrases in a description which say that an identifier is never used again.
_NEVER_AGAIN: Final = re.compile(
    r"\b(?:never (?:given|used|assigned|issued)|ids? are given\b[^.]*\bnever)\b[^.]*\b(?:twice|again)\b"
    r"|\b(?:not|never) (?:re-?used|re-?assigned)"
    r"|\bid(?:entifier)?\b[^.]*\b(?:higher|greater|larger) than\b[^.]*\b(?:had|ever|deleted)\b",
    re.IGNORECASE,
)
# Words in a description which say that a thing remains when another one is deleted.
_STAYS: Final = re.compile(
    r"\b(?:not|keeps?|kept|stays?|remains?|without|unless|but|except|survives?)\b", re.IGNORECASE
)


@dataclass
class _Thing:
    """A thing on the device, with the run's requests to it.

    Attributes:
        path: as it was written; of a device that knows case, another spelling is another thing.
        change: method and path of the last request that changed it.
        status: how that was answered.
        changed_s: when, s of the monotonic clock.
        gone: whether that deleted it.
        absent: whether a read has shown that it is not there.
        own: whether this run has created what it deleted.
        ends: kinds of things that end with it, by what the description of its DELETE says.
        doubt: why it may be read although it was deleted; empty if it may not.
        is_gone_said: whether the description says that nothing is left of it, so that it may not be marked instead.
        made: whether this run created it, and no read has shown it yet.
        body: hash of that of the POST that created it; 0 if there was none.
        replaced: whether an equal one was created later, which may be there in its place.
        written: what it has to read, by member, with the operation that wrote it.
        shown: the members that were read as written, with how much had been sent by then that may change something.
        differs: how often a member was read in another way.
    """

    path: str
    change: str
    status: int
    changed_s: float
    gone: bool = False
    absent: bool = False
    own: bool = False
    ends: frozenset[str] = frozenset()
    doubt: str = ""
    is_gone_said: bool = False
    made: bool = False
    body: int = 0
    replaced: bool = False
    written: dict[str, tuple[Any, Operation]] = field(default_factory=dict)
    shown: dict[str, int] = field(default_factory=dict)
    differs: dict[str, int] = field(default_factory=lambda: defaultdict(int))

    @classmethod
    def of(cls, path: str, exchange: Exchange, *, made: bool) -> _Thing:
        """Return a thing that an exchange has changed."""
        request, response = exchange.request, exchange.response
        return cls(
            path, f"{request.method} {urlsplit(request.url).path}", response.status, response.received_s, made=made
        )


class Memory:
    """Judges each read of a thing by what the run has created, written and deleted before."""

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        methods = {(operation.method, operation.template) for operation in operations}
        reads = [read for read in operations if read.method == "GET" and not read.parameter("query")]
        self._items = {read.template.rstrip("/"): read for read in reads if collection_of(read.template)}
        self._of_collections = {collection_of(template): one for template, one in self._items.items()}
        # Templates of things below another thing that may exist or not.
        self._items |= {
            read.template: read
            for read in reads
            if read.template.rpartition("/")[0] in self._items
            and {("PUT", read.template), ("DELETE", read.template)} <= methods
        }
        templates = {operation.template for operation in operations}
        self._actions = {path for path in templates if not self._items.keys().isdisjoint(_above(path))}
        self._single = {path for path in templates if ("GET", path) in methods}
        self._single -= {read.template for read in self._items.values()}
        self._collections = collections_of(operations)
        self._things: dict[str, _Thing] = {}
        self._own = {path: _read_only(one) | _unwritten(one, path, operations) for path, one in self._items.items()}
        head = contract.openapi.get("info", {}).get("description", "") if operations else ""
        self._is_never = bool(_NEVER_AGAIN.search(str(head)))
        # Members of things at the last read, with what clients sent since, by path.
        self._last: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {}
        # Values in responses to creations that differ from the declared default, by operation and member.
        self._undefaulted: dict[tuple[str, str], Any] = {}
        # Templates of things that end by themselves, because an identifier came again.
        self._ends: set[str] = set()
        self._deletable = {template for method, template in methods if method == "DELETE"}
        # Created things that were not there, with when they were created, by template.
        self._lost: dict[str, list[tuple[float, Case]]] = defaultdict(list)
        # Paths that the run created.
        self._made: set[str] = set()
        self._gone: set[str] = set()  # collections in which something was deleted
        self._back: dict[str, list[Case]] = defaultdict(list)  # cases that count once something was deleted there
        # Paths of things that lack it though it was sent, by template and member.
        self._lacking: dict[tuple[str, str], set[str]] = defaultdict(set)
        self._has: dict[str, set[str]] = defaultdict(set)  # members that some thing has
        self._alive: set[str] = set()  # identifiers of things that were created or read, and not deleted since
        self._acts = 0
        # How long a value stayed the same, s: of things by template, of members by template and name.
        self._lasted: dict[tuple[str, str], dict[str, float]] = defaultdict(lambda: defaultdict(float))
        # Cases that fail only if the value stays the same elsewhere, with their age, s, and what was read instead.
        self._pending: dict[tuple[str, str], list[tuple[float, str, Case]]] = defaultdict(list)

    def forget(self, *, deletes: bool = True) -> None:
        """Forget states that a request of unknown effect may have changed: all of them, if it ``deletes``."""
        self._things = {} if deletes else {key: one for key, one in self._things.items() if not one.gone}
        for thing in self._things.values():
            thing.written.clear()
        self._last.clear()
        self._alive.clear()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, method = occasion.operation, occasion.request.method
        path = _path_in(occasion.context.target)
        if method in SAFE or not self._items:
            if method == "GET" and operation is not None:
                yield from self._judge_read(occasion, operation, path)
            return
        self._acts += 1
        if occasion.response.status in _REFUSED:
            return
        item = self._items.get(operation.template.rstrip("/")) if operation is not None else None
        made = self._of_collections.get(operation.template.rstrip("/")) if operation is not None else None
        yield from self._judge_replacement(occasion)
        if operation is None or not occasion.response.ok:
            self.forget()
        elif item is not None and method in {"PUT", "PATCH", "DELETE"}:
            yield from self._take_change(occasion, operation, path)
        elif made is not None and method == "POST":
            yield from self._take_creation(occasion, operation, made, path)
        elif operation.template in self._actions:
            # An action on a thing may change it and the things below it.
            self._drop(lambda other: _is_below(path, other) or _is_below(other, path))
            self._last.clear()
        elif operation.template in self._single and method in {"PUT", "PATCH"}:
            # Settings may change members of all things, but neither create nor delete one.
            for thing in self._things.values():
                thing.written.clear()
        else:
            self.forget()

    def _judge_read(self, occasion: Occasion, operation: Operation, path: str) -> Iterator[Case]:
        item = self._items.get(operation.template.rstrip("/"))
        if item is not None and occasion.context.plain:
            yield from self._read(occasion, item, path)
        elif item is None and occasion.response.ok:
            yield from self._judge_list(occasion, operation, path)

    def _drop(self, concerns: Any) -> None:
        self._things = {key: one for key, one in self._things.items() if not concerns(one.path)}

    def _take_change(self, occasion: Occasion, operation: Operation, path: str) -> Iterator[Case]:
        """Take a PUT, PATCH or DELETE of an item."""
        if not collection_of(operation.template):
            # The parent may list the changed thing.
            self._drop(lambda other: _is_below(path, other))
            self._last.clear()
        last = self._last.pop(path, None)
        if operation.method != "DELETE" and last is not None:
            self._last[path] = last[0], {}
        if operation.method == "PUT" and occasion.response.status == HTTPStatus.CREATED:
            yield from self._judge_location(occasion, path, path)
            yield from self._defaults(occasion, operation)
        below = self._ending(operation, path) if operation.method == "DELETE" else []
        self._drop(lambda other: other != path and (_is_below(other, path) or other.casefold() == path.casefold()))
        before = self._things.pop(path.casefold(), None)
        status = occasion.response.status
        overlaps = before is not None and occasion.sent_s < before.changed_s
        if status == HTTPStatus.ACCEPTED or overlaps or not occasion.context.is_simple:
            return
        yield from self._judge_put(occasion, operation, before)
        thing = _Thing.of(path, occasion.exchange, made=status == HTTPStatus.CREATED)
        if occasion.request.method == "DELETE":
            self._alive.clear()
            thing.gone, thing.own, thing.ends = True, path in self._made, ending_with(operation)
            thing.doubt, thing.is_gone_said = doubt_of_deletion(operation), says_gone(operation)
            yield from self._again(occasion, operation, before)
            self._things |= {text.casefold(): replace(thing, path=text, own=True) for text in below}
        if status == HTTPStatus.CREATED:
            self._made.add(path)
        if not thing.gone and (body := _body_of(occasion, operation)) is not None:
            if occasion.request.method == "PATCH" and before is not None and not before.gone:
                thing.written, thing.shown = dict(before.written), dict(before.shown)
            for name, value in body.items():
                thing.written[name] = value, operation
                thing.shown.pop(name, None)
        self._things[path.casefold()] = thing

    @staticmethod
    def _judge_put(occasion: Occasion, put: Operation, before: _Thing | None) -> Iterator[Case]:
        """Judge whether a PUT that creates a thing is answered 201, and one that replaces a thing is not."""
        is_new, status = before is not None and before.gone and before.absent, occasion.response.status
        if put.method == "PUT" and before is not None and (is_new or not (before.gone or before.absent)):
            expected = f"status 201, as a GET after {before.change} found nothing" if is_new else "status 200 or 204"
            expected += "" if is_new else f", as a thing was there after {before.change}"
            holds, known = (status == HTTPStatus.CREATED) is bool(is_new), {"201"} if is_new else {"200", "204"}
            doubt = "" if known & put.responses.keys() else "the description has no other status"
            id_, cause = "description/created-is-there", f"{put.label} status {status}"
            yield occasion.case(id_, holds, expected, f"status {status}", cause=cause, doubt=doubt)

    def _again(self, occasion: Occasion, delete: Operation, before: _Thing | None) -> Iterator[Case]:
        """Judge a repeated DELETE, if the description says how it is answered."""
        if before is not None and before.gone and before.absent and {"404", "410"} & delete.responses.keys():
            expected = f"a status that says that nothing is there, as a GET after {before.change} did"
            found = f"status {occasion.response.status}"
            doubt = "" if says_absent_again(delete) else "a DELETE may be repeated (RFC 9110 9.2.2)"
            yield self._case(_GONE, occasion, expected, found, cause=f"{delete.label} again", doubt=doubt)

    def _ending(self, delete: Operation, path: str) -> list[str]:
        """Return the things that end together with a thing, by the description of its DELETE."""
        found, said = [text for text in self._made if _is_below(text, path)], ending_with(delete)
        return [text for text in found if said & set(map(singular, text[len(path) :].split("/")))]

    def _take_creation(self, occasion: Occasion, operation: Operation, item: Operation, path: str) -> Iterator[Case]:
        """Take a POST to a collection."""
        response = occasion.response
        _, id_ = id_member(read_json(response.body).value, item) if is_json(response.media_type) else ("", None)
        location, target = response.header("location"), ""
        if location is not None and is_same(joined(occasion.request.url, location), occasion.request.url):
            base = occasion.request.url.removesuffix(occasion.context.target)
            found = urlsplit(joined(occasion.request.url, location))
            target = _path_in(found.path.removeprefix(urlsplit(base).path)) if not found.query else ""
        elif id_ is not None and location is None:
            target = _path_in(f"{path}/{quote(str(id_), safe='')}")
        if not target or target.rpartition("/")[0] != path:
            # The request may have changed any of them.
            self._drop(lambda other: _is_below(other, path))
            return
        before = self._things.pop(target.casefold(), None)
        self._ends |= {item.template} if before is not None and not before.gone else set()
        self._last.pop(target, None)
        if response.status == HTTPStatus.ACCEPTED:
            yield from self._defaults(occasion, operation)
        if response.status == HTTPStatus.CREATED:
            yield from self._judge_location(occasion, path, target)
            yield from self._defaults(occasion, operation)
            sent = _sent_of(occasion)
            if before is not None and before.gone and (self._is_never or _is_for_ever(item, operation)):
                expected = f"an identifier of its own, not that of the thing that {before.change} has deleted"
                is_chosen = target.rpartition("/")[2].casefold() in {str(one).casefold() for one in sent.values()}
                yield occasion.case("description/created-is-there", is_chosen, expected, target, cause=operation.label)
            self._last[target] = {}, sent
            body = _body_of(occasion, operation) or {}
            written = {name: (value, operation) for name, value in body.items()}
            self._made.add(target)
            self._alive.add(target.rpartition("/")[2].casefold())
            thing = _Thing.of(target, occasion.exchange, made=True)
            thing.written, thing.body = written, hash(occasion.request.body)
            for one in self._things.values():
                one.replaced |= one.body == thing.body and one.path.rpartition("/")[0] == path
            self._things[target.casefold()] = thing
            if len(self._things) > _MOST_THINGS:
                del self._things[next(iter(self._things))]

    def _judge_location(self, occasion: Occasion, above: str, path: str) -> Iterator[Case]:
        """Judge whether the header fields of a creation name no other thing (RFC 9110 8.7, 15.3.2)."""
        for name in ("Location", "Content-Location"):
            value, url = occasion.response.header(name), occasion.request.url
            found = urlsplit(joined(url, value)) if value and is_same(joined(url, value), url) else None
            base = urlsplit(url.removesuffix(occasion.context.target)).path
            there = _path_in(found.path.removeprefix(base)) if found is not None and not found.query else path
            is_whole = found is None or found.path.startswith(base)
            near = {above, above.rpartition("/")[0]}
            if there.rpartition("/")[0] in near and there.count("/") == path.count("/"):
                holds = is_whole and there.casefold() == path.casefold()
                expected = f"{name}: {base}{path}, where the created thing is"
                doubt = "" if is_whole else "the thing may be there as well"
                label = occasion.operation.label if occasion.operation else ""
                id_ = "description/created-is-there"
                yield occasion.case(id_, holds, expected, f"{name}: {value}", cause=f"{label} {name}", doubt=doubt)

    def _defaults(self, occasion: Occasion, operation: Operation) -> Iterator[Case]:
        """Judge whether omitted members of a created thing have their defaults; a single failure may be chance."""
        body, sent = operation.bodies.get(occasion.request.media_type), _sent_of(occasion)
        if body is None or not occasion.request.body or not occasion.is_valid:
            return
        parts = flat(body.schema).get("properties", {})
        given = {name: flat(one).get("default") for name, one in parts.items() if name not in sent}
        given = {name: one for name, one in given.items() if isinstance(one, str | int | float) and one != ""}
        now = occasion.members((*sent, *given))
        for name, one in ((name, one) for name, one in given.items() if name in now):
            other = next(differences({name: one}, now, body.schema, operation.shape, self._collections), "")
            key = operation.label, name
            before = self._undefaulted.pop(key, None)
            if other:
                self._undefaulted[key] = now[name]
            if not other or before == now[name]:
                expected = f"the declared default of what {operation.label} left out"
                cause, doubt = f"{operation.label} {name}", "the default may stand for a value that the device chooses"
                doubt = "" if isinstance(one, int | float) else doubt
                yield occasion.case("description/defaults", not other, expected, other, cause=cause, doubt=doubt)

    def _judge_replacement(self, occasion: Occasion) -> Iterator[Case]:
        """Judge the response to a PUT whose description says that missing members get their defaults."""
        operation = occasion.operation if occasion.request.method == "PUT" else None
        if operation is not None and occasion.response.status == HTTPStatus.OK and DEFAULTED.search(operation.text):
            yield from self._defaults(occasion, operation)

    def _devices(self, occasion: Occasion, item: Operation, path: str) -> Iterator[Case]:
        """Judge whether a request has written members that the device sets, or members that never change."""
        own = self._own[item.template.rstrip("/")]
        shape = flat(item.shape or {}).get("properties", {})
        now = occasion.members(shape)
        now = {name: one for name, one in now.items() if len(str(one)) <= _SHOWN}
        before, sent = self._last.pop(path, ({}, {}))
        if len(self._last) < _MOST_THINGS:
            self._last[path] = now, {}
        for name in own & now.keys() & {*before, *sent}:
            is_taken = name in sent and sent[name] == now[name] != before.get(name)
            # A word or a boolean may also be the device's own value.
            is_taken = is_taken and not isinstance(now[name], bool) and len(str(now[name])) >= _TELLING
            is_for_ever = _FOR_EVER.fullmatch(plain_name(name)) is not None
            is_other = is_for_ever and name in before and before[name] != now[name]
            expected = f"{name} as the device gave it"
            found = f"{clip(now[name])} as {name}" + (f", and {clip(before[name])} before" if name in before else "")
            holds, cause = not (is_taken or is_other), f"{item.label} {name}"
            doubt = "" if is_taken else "the member may belong to the content, and not to the thing"
            yield occasion.case("description/read-only", holds, expected, found, cause=cause, doubt=doubt)

    def _read(self, occasion: Occasion, item: Operation, path: str) -> Iterator[Case]:
        thing, response = self._things.get(path.casefold()), occasion.response
        if response.ok:
            self._alive.add(path.rpartition("/")[2].casefold())
            yield from self._devices(occasion, item, path)
        if thing is None or thing.path != path:
            return
        age_s = occasion.sent_s - thing.changed_s
        if age_s < 0:
            return  # the response began before the write
        if thing.gone:
            yield from self._judge_deleted(occasion, item, thing, age_s)
            return
        kept = item.template, ""
        # If another request has deleted the thing, PUT creates it again.
        thing.absent = response.status in ABSENT
        if response.status in ABSENT and thing.made:
            if age_s > SETTLES_S and not thing.replaced and item.template not in self._ends:
                expected = f"the thing that {thing.change} has created {age_s:.0f} s before"
                doubt = doubt_of_life(item) or "it may keep only the newest of them, or for a time of its own"
                case = self._case("created-is-there", occasion, expected, cause=item.label, doubt=doubt)
                yield from self._differs(kept, age_s, "none", case)
                self._lost[item.template] = [*self._lost[item.template], (thing.changed_s, case)][-_MOST_PENDING:]
        elif response.ok:
            thing.made = False
            yield from self._lasts(kept, age_s, "there")
            # An older thing is still there: a device that keeps the newest has lost no other one by that.
            lost = self._lost.pop(item.template, []) if item.template in self._deletable else []
            yield from (replace(case, doubt=doubt_of_life(item)) for made_s, case in lost if made_s > thing.changed_s)
            self._lost[item.template] += [one for one in lost if one[0] <= thing.changed_s]
            yield from self._compare(occasion, item, thing, age_s)

    def _judge_deleted(self, occasion: Occasion, item: Operation, thing: _Thing, age_s: float) -> Iterator[Case]:
        """Judge a read of a deleted thing."""
        response = occasion.response
        thing.absent |= response.status in ABSENT
        is_there = thing.is_gone_said or not is_marked_deleted(read_json(response.body).value)
        if response.ok and age_s > SETTLES_S and is_there:
            expected = f"status 404 or 410, {age_s:.0f} s after {thing.change} was answered {thing.status}"
            case = self._case(_GONE, occasion, expected, cause=item.label, doubt=thing.doubt)
            # A thing that always exists is emptied by DELETE, or reset.
            if thing.own or item.template in self._gone:
                yield case
            elif len(self._back[item.template]) < _MOST_PENDING:
                self._back[item.template].append(case)
        elif response.status in ABSENT and not thing.own:
            self._gone.add(item.template)
            yield from self._back.pop(item.template, [])

    def _judge_list(self, occasion: Occasion, operation: Operation, path: str) -> Iterator[Case]:
        """Judge whether a list, however it is filtered, has things that were deleted, or is below such a thing."""
        above = self._things.get(path.rpartition("/")[0].casefold())
        if above is not None and above.absent and "404" in operation.responses:
            age_s, last = occasion.sent_s - above.changed_s, singular(path.rpartition("/")[2])
            if last in above.ends and age_s > SETTLES_S:
                expected = f"status 404, as {above.change} ended the {last} too, by the description"
                cause = f"{operation.label} below"
                yield self._case(_GONE, occasion, expected, cause=cause, doubt=SENTENCE)
        item = self._of_collections.get(operation.template.rstrip("/"))
        gone = {key: one for key, one in self._things.items() if one.absent and one.path.rpartition("/")[0] == path}
        gone = {key: one for key, one in gone.items() if one.gone}
        if item is None or not gone or not is_json(occasion.response.media_type):
            return
        for value in items_of(read_json(occasion.response.body).value) or ():
            thing = gone.get(f"{path}/{identifier_of(value, item)}".casefold()) if isinstance(value, dict) else None
            age_s = occasion.sent_s - thing.changed_s if thing is not None else 0.0
            if thing is not None and age_s > SETTLES_S and (thing.is_gone_said or not is_marked_deleted(value)):
                expected = f"a list without what {thing.change} has deleted {age_s:.0f} s before, which no GET finds"
                cause = f"{operation.label} listed"
                yield self._case(_GONE, occasion, expected, "a list with it", cause=cause)

    def _lasts(self, kept: tuple[str, str], age_s: float, value: str) -> Iterator[Case]:
        """Record how long a value has stayed the same; yield waiting cases that must have lasted as long."""
        ages = self._lasted[kept]
        ages[value] = max(ages[value], age_s)
        waiting = self._pending.pop(kept, [])
        for age, seen, case in waiting:
            if age <= age_s and seen != value:
                yield case
            else:
                self._pending[kept].append((age, seen, case))

    def _differs(self, kept: tuple[str, str], age_s: float, seen: str, case: Case) -> Iterator[Case]:
        """Yield a case if another value lasted as long; the value read now does not count, as all may return to it."""
        if any(age >= age_s for value, age in self._lasted[kept].items() if value != seen):
            yield case
        elif len(self._pending[kept]) < _MOST_PENDING:
            self._pending[kept].append((age_s, seen, case))

    def _compare(self, occasion: Occasion, item: Operation, thing: _Thing, age_s: float) -> Iterator[Case]:
        """Judge whether the members of a thing read as they were written."""
        now = occasion.members(thing.written)
        if now:
            self._has[item.template] |= {name for name, one in now.items() if one not in _NOTHING}
            yield from self._lacks(occasion, item, thing, now)
        for name, (wanted, operation) in thing.written.items() if now else ():
            schema = operation.bodies[next(iter(operation.bodies))].schema
            other = next(differences({name: wanted}, now, schema, item.shape, self._collections), "")
            kept = item.template, name
            if not other:
                if is_reordered(wanted, now.get(name), parts_of(schema).get(name)):
                    thing.differs[name] += 1
                    if thing.differs[name] == _SEEN:
                        expected, cause = f"{clip(wanted)} as {name}, as {operation.label} wrote it", item.label
                        found = f"{clip(now.get(name))} as {name}"
                        yield self._case(_READ, occasion, expected, found, cause=f"{cause} {name} order", doubt=SET)
                thing.shown.setdefault(name, self._acts)
                yield from self._lasts(kept, age_s, str(wanted)[:_SHOWN])
                continue
            # Another thing may have become the default since this one was read.
            is_given_away = wanted is True and is_shared(name)
            was_lost = not is_given_away and name in thing.shown and thing.shown[name] < self._acts
            if was_lost or (name not in thing.shown and age_s > SETTLES_S):
                thing.differs[name] += 1
                if thing.differs[name] >= _SEEN:
                    when = "as it was read before" if was_lost else f"{age_s:.0f} s before"
                    expected, cause = f"what {operation.label} wrote, {when}", f"{operation.label} {name}"
                    case = self._case(_READ, occasion, expected, other, cause=cause)
                    yield from self._differs(kept, age_s, str(now.get(name))[:_SHOWN], case)

    def _lacks(self, occasion: Occasion, item: Operation, thing: _Thing, now: dict[str, Any]) -> Iterator[Case]:
        """Judge whether members that two things were given are there, as the description of the read has them."""
        for name, (wanted, operation) in thing.written.items():
            part = parts_for(item.shape or {}, thing.written).get(name)
            has = self._has[item.template]
            # A reference to what is there, which no thing ever has; null may stand for what is gone.
            is_reference = part is not None and not {"readOnly", "writeOnly"} & flat(part).keys()
            is_reference = is_reference and refers(name, part or {}, self._collections) and name in now
            is_reference = is_reference and name not in has and str(wanted).casefold() in self._alive
            is_open = is_shared(name) or not (name in has or says_exactly(part) or is_reference)
            if part is None or wanted in _NOTHING or is_open:
                continue
            if is_devices(name, part, self._collections) and not is_reference:
                continue
            lacking, is_there = self._lacking[item.template, name], now.get(name) is not None
            lacking |= set() if is_there or wanted == flat(part).get("default") else {thing.path}
            if is_there or len(lacking) >= _SEEN:
                expected, cause = f"{clip(wanted)} as {name}, as it was written", f"{operation.label} {name} there"
                yield occasion.case(f"description/{_READ}", is_there, expected, f"no {name}", cause=cause)

    @staticmethod
    def _case(name: str, occasion: Occasion, expected: str, found: str = "", *, cause: str, doubt: str = "") -> Case:
        return occasion.case(f"description/{name}", False, expected, found, cause=cause, doubt=doubt)  # noqa: FBT003


def _read_only(item: Operation) -> frozenset[str]:
    """Return the members of an item that its schema marks as the device's."""
    outer = flat(item.shape or {}).get("properties", {})
    inner = [flat(one).get("properties", {}) for one in outer.values() if isinstance(one, dict)]
    parts = [(name, one) for part in (outer, *inner) for name, one in part.items() if isinstance(one, dict)]
    return frozenset(name for name, one in parts if flat(one).get("readOnly"))


def _unwritten(item: Operation, path: str, operations: Iterable[Operation]) -> frozenset[str]:
    """Return the members of an item that never change by their name, and that no request contains."""
    writes = [one for one in operations if one.template.rstrip("/") in {path, collection_of(path)}]
    sent = {name for one in writes for body in one.bodies.values() for name in parts_of(body.schema)}
    return frozenset(name for name in parts_of(item.shape) if _FOR_EVER.fullmatch(plain_name(name))) - sent


def _sent_of(occasion: Occasion) -> dict[str, Any]:
    """Return the members of a request's JSON object, with or without a description."""
    request = occasion.request
    is_short = len(request.body) <= MOST_OCTETS and is_json(request.media_type)
    value = read_json(request.body).value if is_short else None
    return value if isinstance(value, dict) else {}


def ending_with(delete: Operation) -> frozenset[str]:
    """Return the words for things that end with another thing, without clauses on things that stay."""
    clauses = [item for item in re.split(r"[.;]\s", delete.text) if not _STAYS.search(item)]
    return frozenset(singular(word) for clause in clauses for word in words_of(clause))


def _is_for_ever(item: Operation, create: Operation) -> bool:
    """Return whether a deleted identifier is never used again: it is a UUID, or the description says so."""
    parameter, parts = item.parameter("path")[-1], flat(item.shape or {}).get("properties", {})
    named = [flat(one) for name, one in parts.items() if plain_name(name) in {plain_name(parameter.name), "id"}]
    given = flat(parameter.schema)
    said = [str(one["description"]) for one in (given, *named) if "description" in one]
    return given.get("format") == "uuid" or any(_NEVER_AGAIN.search(text) for text in (*said, create.text))


def _above(template: str) -> Iterator[str]:
    """Yield the paths of all parents of a path."""
    while template := template.rpartition("/")[0]:
        yield template


def _path_in(target: str) -> str:
    return unquote(target.partition("?")[0]).rstrip("/")


def _is_below(path: str, other: str) -> bool:
    return path.startswith(f"{other}/")


def _body_of(occasion: Occasion, operation: Operation) -> dict[str, Any] | None:
    """Return the object that a request has written; None if the content is no object, or not allowed."""
    is_first, value = occasion.request.media_type == next(iter(operation.bodies), None), _sent_of(occasion)
    if not (is_first and value and occasion.is_valid):
        return None
    schema = operation.bodies[occasion.request.media_type].schema
    return as_answered(value, occasion.members(value), {}, schema, operation.text)
