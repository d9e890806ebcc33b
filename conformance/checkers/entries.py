"""Entries that only their list shows, such as notes: what was created, changed or deleted there, and nothing else."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from http import HTTPStatus
from itertools import combinations
from types import MappingProxyType
from typing import Any, Final, NamedTuple
from urllib.parse import unquote

from conformance.api.rest.listing import Listing, Page, listing_of, members_of, page_of
from conformance.api.rest.references import collections_of, is_free_text
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import (
    collection_of,
    differences,
    doubt_of_life,
    doubt_of_write,
    identifier_of,
    may_create,
    parts_of,
)
from conformance.api.rest.values import IDS
from conformance.checkers.lists import is_cut
from conformance.checkers.occasion import Occasion
from conformance.contract.pack import Contract
from conformance.documents.json_schema import kinds_of
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.verdict.evidence import SENTENCE, Case

# Entries of one list that are remembered.
_MOST: Final = 200
# Members with an entry's place among the others.
_PLACES: Final = frozenset({"position", "seq", "sequence", "order", "index", "rank", "number", "place"})
# Shorter texts may be in a list by chance.
_TELLING: Final = 5
# How much later than its response a device may change or delete an entry, s.
_SETTLES_S: Final = 2.5


class _Entry(NamedTuple):
    """An entry that a request has created or changed, or has not.

    Attributes:
        sent: what it sent, or what the entry showed before it was deleted.
        told: what the response to its creation shows.
        operation: the operation of the request; label: that, and how it was answered.
        at_s: when it was answered, s of the monotonic clock.
    """

    sent: dict[str, Any]
    operation: Operation
    label: str
    at_s: float
    told: Mapping[str, Any] = MappingProxyType({})


class Entries:
    """Judges each whole list by the creations before it."""

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        own = {collection_of(operation.template) for operation in operations if operation.method == "GET"}
        creates = {one.template.rstrip("/"): one for one in operations if one.method == "POST"}
        # The creation of each list whose entries no other operation reads, by path template.
        self._creates: dict[str, Operation] = {
            template: creates[template]
            for operation in operations
            if operation.method == "GET" and (template := operation.template.rstrip("/")) in creates
            if listing_of(operation) is not None and template not in own
        }
        self._collections = collections_of(operations)
        # An operation that changes or deletes an entry, by path template of a list.
        self._items = {name: one for one in operations if (name := collection_of(one.template)) in self._creates}
        # Each by the path of the list. Entries by their identifiers, until a list has shown them:
        self._made: dict[str, dict[str, _Entry]] = defaultdict(dict)
        self._gone: dict[str, dict[str, _Entry]] = defaultdict(dict)  # deleted entries
        self._given: dict[str, set[str]] = defaultdict(set)  # all identifiers in responses to creations
        # The entries in the last whole list, and the creations and changes that were refused since then:
        self._listed: dict[str, dict[str, dict[str, Any]]] = {}
        self._refused: dict[str, list[_Entry]] = defaultdict(list)
        self._longest: dict[str, int] = defaultdict(int)
        # All entries that lists have shown, whole or not, as they were last.
        self._seen: dict[str, dict[str, dict[str, Any]]] = defaultdict(dict)
        self._unchanged: dict[str, dict[str, list[_Entry]]] = defaultdict(lambda: defaultdict(list))

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, request = occasion.operation, occasion.request
        path = occasion.context.target.partition("?")[0].rstrip("/")
        create = self._creates.get(operation.template.rstrip("/")) if operation is not None else None
        collection = collection_of(operation.template) if operation is not None else ""
        if operation is not None and collection in self._items and request.method in {"PUT", "PATCH", "DELETE"}:
            above, _, last = path.rpartition("/")
            self._note_change(occasion, operation, above, unquote(last).casefold())
        elif request.method == "POST" and create is not None:
            yield from self._note(occasion, create, path)
        elif request.method not in SAFE and not refuses(occasion.response.status, operation):
            # It may have changed, created or deleted entries, or what they are below.
            for memory in (self._made, self._gone, self._listed, self._unchanged):
                memory.clear()
        elif request.method == "GET" and operation is not None and create is not None:
            listing, page = listing_of(operation), page_of(occasion.response, operation)
            items = {self._id_of(item, create): members_of(item) for item in page.items} if page is not None else {}
            yield from self._judge_gone(occasion, items, path)
            self._seen[path] |= items
            if listing is not None and page is not None and self._is_whole(occasion, listing, page, path):
                yield from self._judge(occasion, create, page, path)

    def _note_change(self, occasion: Occasion, operation: Operation, path: str, id_: str) -> None:
        """Note that an entry was changed or deleted, or was not."""
        status, sent = occasion.response.status, read_json(occasion.request.body).value
        body = sent if isinstance(sent, dict) else {}
        entry = _Entry(body, operation, f"{operation.label} with status {status}", occasion.response.received_s)
        if refuses(status, operation):
            self._unchanged[path][id_].append(entry)
            return
        self._unchanged[path].pop(id_, None)
        earlier, was = self._made[path].pop(id_, None), self._seen.get(path, {}).get(id_, {})
        self._listed.get(path, {}).pop(id_, None)
        self._gone[path].pop(id_, None)
        self._given[path].add(id_)
        if not occasion.response.ok or status == HTTPStatus.ACCEPTED:
            self._listed.pop(path, None)
        elif operation.method == "DELETE":
            self._gone[path][id_] = entry._replace(sent=was)
        elif body and occasion.is_valid and is_json(occasion.request.media_type):
            kept = {} if earlier is None or operation.method == "PUT" else earlier.sent
            self._made[path][id_] = entry._replace(sent={**kept, **body})

    def _note(self, occasion: Occasion, create: Operation, path: str) -> Iterator[Case]:
        """Note an entry that was created, or refused; judge that it has an identifier of its own."""
        response, sent = occasion.response, read_json(occasion.request.body).value
        body = sent if isinstance(sent, dict) else {}
        told = members_of(read_json(response.body).value)
        entry = _Entry(body, create, f"{create.label} with status {response.status}", response.received_s, told)
        id_ = self._id_of(read_json(response.body).value, create) if is_json(response.media_type) else ""
        if refuses(response.status, create):
            self._refused[path] = [*self._refused[path], entry][-_MOST:]
        elif not (id_ and may_create(create, response.status)) or (
            response.status == HTTPStatus.OK and (path not in self._seen or id_ in self._seen[path])
        ):
            self._listed.pop(path, None)
        else:
            there = self._listed.get(path, {}).get(id_) or members_of(getattr(self._made[path].get(id_), "sent", None))
            if there:
                # A device may answer a repeated creation with the thing that it has made, or take the client's name.
                values = [str(one).casefold() for one in body.values()]
                own = not any(differences(body, there, _schema_of(create), create.shape, self._collections))
                expected, cause = "an identifier of its own, not that of another entry", f"{create.label} identifier"
                holds = own or id_ in values
                yield occasion.case("description/created-is-there", holds, expected, f"{id_} again", cause=cause)
            self._given[path].add(id_)
            self._gone[path].pop(id_, None)
            if occasion.is_valid and body and len(self._made[path]) < _MOST:
                self._made[path][id_] = entry

    def _judge(self, occasion: Occasion, create: Operation, page: Page, path: str) -> Iterator[Case]:
        """Judge a whole list."""
        items = {self._id_of(item, create): members_of(item) for item in page.items}
        made = {id_: one for id_, one in self._made[path].items() if one.at_s <= occasion.sent_s}
        first_s = min((one.at_s for id_, one in made.items() if id_ in items), default=float("inf"))
        for id_, entry in made.items():
            # An older one is still there: the list does not keep the newest only.
            doubt = "" if entry.at_s > first_s else "it may keep only the newest entries, or for a time of its own"
            expected, cause = f"the entry {id_} of {entry.label}", f"{entry.operation.label} listed"
            requirement, doubt = "description/created-is-there", doubt_of_life(create) or doubt
            yield occasion.case(requirement, id_ in items, expected, "a list without it", cause=cause, doubt=doubt)
            if id_ in items:
                wrong, is_short = self._difference(entry, items[id_])
                expected, cause = f"the entry {id_} as {entry.label} wrote it", f"{entry.operation.label} entry"
                doubt = doubt_of_write(entry.operation) or ("a list may show its entries in short" if is_short else "")
                if wrong and entry.operation is not create and occasion.sent_s - entry.at_s <= _SETTLES_S:
                    continue  # a device may change it a moment later
                yield occasion.case("description/written-is-read", not wrong, expected, wrong, cause=cause, doubt=doubt)
                del self._made[path][id_]
        yield from self._judge_others(occasion, create, items, made, path)
        for id_, entry in [(id_, one) for id_, one in self._gone[path].items() if id_ not in items]:
            expected, cause = f"a list without {id_} after {entry.label}", f"{entry.operation.label} listed"
            yield occasion.case("description/deleted-is-gone", True, expected, cause=cause)  # noqa: FBT003
            del self._gone[path][id_]
        yield from self._judge_unchanged(occasion, create, items, path)
        yield from self._judge_refused(occasion, create, items, path)
        self._listed[path] = items

    def _judge_gone(self, occasion: Occasion, items: dict[str, dict[str, Any]], path: str) -> Iterator[Case]:
        """Judge that a list, or a page of one, does not show what was deleted."""
        for id_, entry in [(id_, one) for id_, one in self._gone[path].items() if id_ in items]:
            # It may show that for a moment, or marked, or in another state.
            if occasion.sent_s - entry.at_s > _SETTLES_S:
                if items[id_] == entry.sent:
                    expected, cause = f"a list without {id_} after {entry.label}", f"{entry.operation.label} listed"
                    found = "a list with it as it was"
                    yield occasion.case("description/deleted-is-gone", False, expected, found, cause=cause)  # noqa: FBT003
                del self._gone[path][id_]

    def _judge_others(
        self,
        occasion: Occasion,
        create: Operation,
        items: dict[str, dict[str, Any]],
        made: dict[str, _Entry],
        path: str,
    ) -> Iterator[Case]:
        """Judge whether requests have created or deleted further entries."""
        before = self._listed.get(path)
        if before is None:
            return
        new = items.keys() - before.keys() - self._given[path]
        for id_ in [id_ for id_, one in made.items() if one.operation is create and id_ in items]:
            names = list(map(plain_name, made[id_].sent))
            twins = [one for one in new if all(items[one].get(name) == items[id_].get(name) for name in names)]
            expected, cause = f"one new entry by {made[id_].label}", f"{create.label} once"
            found = f"{id_} and {', '.join(twins)}, which are alike"
            yield occasion.case("description/created-is-there", not twins, expected, found, cause=cause)
        deleted = next(iter(self._gone[path].values()), None)
        lost = [id_ for id_ in before if id_ in self._given[path] - items.keys() - self._gone[path].keys()]
        if deleted is not None and not made:
            # A device may work off a queue from its beginning.
            is_first = len(lost) == 1 and lost[0] == next(iter(before))
            doubt = doubt_of_life(create) or ("the first one may have ended by itself" if is_first else "")
            expected, cause = f"all entries but the one of {deleted.label}", f"{deleted.operation.label} others"
            found = f"a list without {', '.join(lost[:3])}"
            yield occasion.case("description/created-is-there", not lost, expected, found, cause=cause, doubt=doubt)

    def _difference(self, entry: _Entry, item: dict[str, Any]) -> tuple[str, bool]:
        """Return how an entry differs from what was written, and whether the list may show it in short."""
        schema = _schema_of(entry.operation)
        shape, wrong, is_short = entry.operation.shape, "", False
        for name, value in entry.sent.items():
            # Later entries move those behind them. A list may show only the beginning of a text, but no creation may.
            plain = plain_name(name)
            is_short_here = _begins(value, item.get(plain)) and entry.told.get(plain, value) == value
            if plain not in _PLACES and not is_short_here and not wrong:
                wrong = next(differences({name: value}, item, schema, shape, self._collections), "")
                is_short = not isinstance(value, int | float) and entry.told.get(plain, value) == value
        return wrong, is_short

    def _judge_unchanged(
        self, occasion: Occasion, create: Operation, items: dict[str, dict[str, Any]], path: str
    ) -> Iterator[Case]:
        """Judge whether entries are as they were after changes and deletions that were refused."""
        for id_, refused in self._unchanged.pop(path, {}).items():
            was, now = self._listed.get(path, {}).get(id_), items.get(id_)
            for entry in refused if was else ():
                names = {plain_name(name): one for name, one in entry.sent.items()}
                kept = [name for name, one in names.items() if was and was.get(name) != one == (now or {}).get(name)]
                done = bool(kept) or (now is None and entry.operation.method == "DELETE")
                expected, cause = f"the entry {id_} as before {entry.label}", f"{entry.operation.label} refused"
                found = f"{clip(names[kept[0]])} as {kept[0]}" if kept else "a list without it"
                doubt = "" if kept else doubt_of_life(create)
                yield occasion.case("description/refused-keeps", not done, expected, found, cause=cause, doubt=doubt)

    def _is_whole(self, occasion: Occasion, listing: Listing, page: Page, path: str) -> bool:
        """Return whether a response shows the whole list."""
        sent, count = listing.query_texts(occasion.context.target), len(page.items)
        limit = {listing.limit.name} if listing.limit is not None else set()
        if sent is None or not sent.keys() <= limit:
            return False
        # A list that has shown more items was not cut at fewer, if nothing says so.
        is_said = page.goes_on or max(page.totals.values(), default=0) > count or 0 < listing.most(sent) <= count
        has_shown_more = count < self._longest[path] and not is_said
        self._longest[path] = max(self._longest[path], count)
        return has_shown_more or not is_cut(listing, page, sent)

    def _id_of(self, value: Any, create: Operation) -> str:
        """Return the identifier of an entry; empty if it has none."""
        item, members = self._items.get(create.template.rstrip("/")), members_of(value)
        found = identifier_of(members, item) if item is not None else ""
        return found or next(
            (str(members[name]).casefold() for name in IDS if isinstance(members.get(name), str | int)), ""
        )

    def _judge_refused(
        self, occasion: Occasion, create: Operation, items: dict[str, dict[str, Any]], path: str
    ) -> Iterator[Case]:
        """Judge whether a new entry, which no creation returned, comes from a refused creation."""
        parts = parts_of(_schema_of(create))
        free = {name for name, part in parts.items() if is_free_text(part)}
        before, refused = self._listed.get(path), self._refused.pop(path, [])
        known = self._given[path].union(before or ())
        new = [item for id_, item in items.items() if before is not None and id_ not in known]
        for entry in refused if before is not None else ():
            texts = {plain_name(name): entry.sent[name] for name in free & entry.sent.keys()}
            texts = {name: one for name, one in texts.items() if isinstance(one, str) and len(one) >= _TELLING}
            there = [item for item in new if texts and all(item.get(name) == one for name, one in texts.items())]
            if texts:
                expected, cause = f"a list without what {entry.label} asked for", f"{create.label} refused"
                found = f"a new entry with {clip(next(iter(texts.values())))}" if there else ""
                yield occasion.case("description/refused-keeps", not there, expected, found, cause=cause)


def _schema_of(operation: Operation) -> dict[str, Any]:
    return next((body.schema for body in operation.bodies.values()), {})


def _begins(value: Any, seen: Any) -> bool:
    """Return whether a text in a list is the beginning of the one that was sent."""
    return (
        isinstance(value, str)
        and isinstance(seen, str)
        and seen not in {"", value}
        and value.startswith(seen.rstrip(".… "))
    )


# Phrases in a description for the order in which things were created: of all items, and of those that sort alike.
_CREATED: Final = re.compile(r"\bin (?:the )?order of (?:their |its )?creation\b|\bin creation order\b", re.IGNORECASE)
_ALIKE: Final = re.compile(rf"\b(?:equal|ties?|tied|same|alike)\b[^.;]*(?:{_CREATED.pattern})", re.IGNORECASE)


class _Made(NamedTuple):
    """A creation: how many there were before it, and when it was sent and answered, s of the monotonic clock."""

    number: int
    sent_s: float
    at_s: float


class Listed:
    """Judges whether a whole list has each created thing that a read before and one after it find.

    A list may leave out things in some states, and old ones: so it has an older thing in the same states. If the
    description promises the order of creation, each page is judged by it.
    """

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        reads = (one for one in operations if one.method == "GET" and collection_of(one.template))
        # The read of its things, by path template of a list.
        self._reads = {collection_of(one.template): one for one in reads if listing_of(one) is None}
        # How many things were created before it, and when, by path; then the states of what reads found since a change.
        self._made: dict[str, _Made] = {}
        self._there: dict[str, list[Any]] = {}
        # Lists without a thing, and the fault, by the path of that.
        self._missed: dict[str, Case] = {}
        self._lost: dict[str, set[str]] = defaultdict(set)

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, answer, method = occasion.operation, occasion.response, occasion.request.method
        path = unquote(occasion.context.target.partition("?")[0]).rstrip("/").casefold()
        template = operation.template.rstrip("/") if operation is not None else ""
        if method not in SAFE:
            if not refuses(answer.status, operation):
                self._there, self._missed = {}, {}
            read = self._reads.get(template) if answer.status == HTTPStatus.CREATED and method == "POST" else None
            if read is not None and (id_ := identifier_of(read_json(answer.body).value, read)):
                made = _Made(len(self._made) + 1, occasion.sent_s, answer.received_s)
                self._made |= {f"{path}/{id_}".casefold(): made} if len(self._made) < _MOST else {}
        elif operation is not None and method == "GET" and answer.ok:
            above = self._reads.get(collection_of(template))
            if above is not None and above.template == operation.template and path in self._made:
                self._there[path] = _states_of(occasion.members(parts_of(above.shape)), above)
                case = self._missed.pop(path, None)
                self._lost[template] |= {path} if case is not None else set()
                yield from [case] if case is not None and len(self._lost[template]) > 1 else []
            elif template in self._reads and (page := page_of(answer, operation)) is not None:
                yield from self._list(occasion, operation, path, page)

    def _list(self, occasion: Occasion, operation: Operation, path: str, page: Page) -> Iterator[Case]:
        """Judge a whole list, and keep what it lacks until a read finds that."""
        listing, read = listing_of(operation), self._reads[operation.template.rstrip("/")]
        sent = listing.query_texts(occasion.context.target) if listing is not None else None
        if listing is not None and sent is not None:
            yield from self._order(occasion, listing, page, sent, path)
        paging = (
            {one.name for one in (listing.limit, listing.sort) if one is not None} if listing is not None else set()
        )
        if listing is None or sent is None or not sent.keys() <= paging or is_cut(listing, page, sent):
            return
        items = {
            f"{path}/{identifier_of(item, read)}".casefold(): item for item in page.items if isinstance(item, dict)
        }
        known = [
            (self._made[key].number if key in self._made else 0, _states_of(item, read)) for key, item in items.items()
        ]
        there = {key: one for key, one in self._there.items() if key.rpartition("/")[0] == path}
        there = {key: one for key, one in there.items() if occasion.sent_s - self._made[key].at_s > _SETTLES_S}
        for key, states in there.items():
            expected, cause = f"a list with {key}, which reads find", f"{operation.label} lacks"
            if key in items:
                yield occasion.case("description/created-is-there", True, expected, cause=cause)  # noqa: FBT003
            elif any(number < self._made[key].number and states == one for number, one in known):
                doubt = "" if page.totals else "the list may leave some things out"
                found = f"{len(items)} items without it"
                id_ = "description/created-is-there"
                self._missed[key] = occasion.case(id_, False, expected, found, cause=cause, doubt=doubt)  # noqa: FBT003

    def _order(
        self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str], path: str
    ) -> Iterator[Case]:
        """Judge the order of creation, of all items or of those with the same value of the member that sorts."""
        sort, read = listing.sort, self._reads[listing.operation.template.rstrip("/")]
        by = listing.sortings.get(sent.get(sort.name, "")) if sort is not None else None
        is_said = _CREATED.search(listing.operation.text) if sort is None else by and _ALIKE.search(sort.says)
        if not is_said or listing.direction is not None:
            return
        items = [(f"{path}/{identifier_of(item, read)}".casefold(), members_of(item)) for item in page.items]
        known = [(self._made[key], item.get(by.member) if by else None) for key, item in items if key in self._made]
        pairs = [(one[0], other[0]) for one, other in combinations(known, 2) if one[1] == other[1]]
        wrong = [(one, other) for one, other in pairs if other.at_s < one.sent_s]
        if pairs:
            of = f"those with the same {by.member}" if by else "items"
            found = f"creation {wrong[0][0].number} before creation {wrong[0][1].number}" if wrong else ""
            expected, cause = (
                f"{of} in the order of creation, by the description",
                f"{listing.operation.label} creation",
            )
            id_ = "description/list-order"
            yield occasion.case(id_, not wrong, expected, found, cause=cause, doubt=SENTENCE)


def _states_of(thing: dict[str, Any], read: Operation) -> list[Any]:
    """Return the members of a thing that have one of a few values, by which a list may choose."""
    parts = {name: flat(one) for name, one in parts_of(read.shape).items()}
    names = (name for name, one in parts.items() if "enum" in one or "boolean" in kinds_of(one))
    return [thing.get(name) for name in sorted(names)]
