"""Entries of lists without an address of their own, such as notes: a list shows what was created, and nothing else."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final, NamedTuple

from conformance.api.rest.listing import Listing, Page, listing_of, members_of, page_of
from conformance.api.rest.references import collections_of, is_free_text
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import collection_of, differences, doubt_of_life, parts_of
from conformance.api.rest.values import IDS
from conformance.checkers.lists import is_cut
from conformance.checkers.occasion import Occasion
from conformance.contract.pack import Contract
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.verdict.evidence import Case

# Entries of one list that are remembered.
_MOST: Final = 200
# Members with an entry's place among the others.
_PLACES: Final = frozenset({"position", "seq", "sequence", "order", "index", "rank", "number", "place"})
# Shorter texts may be in a list by chance.
_TELLING: Final = 5


class _Entry(NamedTuple):
    """An entry that a POST has created, or has not: what it sent, and when that was answered."""

    sent: dict[str, Any]
    label: str
    at_s: float


class Entries:
    """Judges each whole list by the creations before it.

    Args:
        contract: the description's.
    """

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        own = {collection_of(operation.template) for operation in operations if operation.method == "GET"}
        creates = {one.template.rstrip("/"): one for one in operations if one.method == "POST"}
        # By path template: the creation of each list whose entries have no address of their own.
        self._creates: dict[str, Operation] = {
            template: creates[template]
            for operation in operations
            if operation.method == "GET" and (template := operation.template.rstrip("/")) in creates
            if listing_of(operation) is not None and template not in own
        }
        self._collections = collections_of(operations)
        # By path: entries by their identifiers until a list has shown them; all identifiers that creations gave; those
        # in the last whole list; and creations that were refused since then.
        self._made: dict[str, dict[str, _Entry]] = defaultdict(dict)
        self._given: dict[str, set[str]] = defaultdict(set)
        self._listed: dict[str, set[str]] = {}
        self._refused: dict[str, list[_Entry]] = defaultdict(list)

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, request = occasion.operation, occasion.request
        path = occasion.context.target.partition("?")[0].rstrip("/")
        create = self._creates.get(operation.template.rstrip("/")) if operation is not None else None
        if request.method == "POST" and create is not None:
            self._note(occasion, create, path)
        elif request.method not in SAFE and not refuses(occasion.response.status, operation):
            # It may have changed, created or deleted entries, or what they are below.
            self._made.clear()
            self._listed.clear()
        elif request.method == "GET" and operation is not None and create is not None:
            listing, page = listing_of(operation), page_of(occasion.response, operation)
            if listing is not None and page is not None and _is_whole(occasion, listing, page):
                yield from self._judge(occasion, create, page, path)

    def _note(self, occasion: Occasion, create: Operation, path: str) -> None:
        """Note an entry that was created, or refused."""
        response, sent = occasion.response, read_json(occasion.request.body).value
        body = sent if isinstance(sent, dict) else {}
        entry = _Entry(body, f"{create.label} with status {response.status}", response.received_s)
        id_ = _id_of(read_json(response.body).value) if is_json(response.media_type) else ""
        if refuses(response.status, create):
            self._refused[path] = [*self._refused[path], entry][-_MOST:]
        elif response.status != HTTPStatus.CREATED or not id_:
            self._listed.pop(path, None)
        else:
            self._given[path].add(id_)
            if occasion.is_valid and body and len(self._made[path]) < _MOST:
                self._made[path][id_] = entry

    def _judge(self, occasion: Occasion, create: Operation, page: Page, path: str) -> Iterator[Case]:
        """Judge a whole list."""
        items = {_id_of(item): members_of(item) for item in page.items}
        made = {id_: one for id_, one in self._made[path].items() if one.at_s <= occasion.sent_s}
        first_s = min((one.at_s for id_, one in made.items() if id_ in items), default=float("inf"))
        for id_, entry in made.items():
            # An older one is still there: the list does not keep the newest only.
            doubt = "" if entry.at_s > first_s else "it may keep only the newest entries, or for a time of its own"
            expected, cause = f"the entry {id_} that {entry.label} created", f"{create.label} listed"
            requirement, doubt = "description/created-is-there", doubt_of_life(create) or doubt
            yield occasion.case(requirement, id_ in items, expected, "a list without it", cause=cause, doubt=doubt)
            if id_ in items:
                schema = next(iter(create.bodies.values())).schema
                # Later entries move those behind them, and a list may show only the beginning of a text.
                sent = {name: one for name, one in entry.sent.items() if plain_name(name) not in _PLACES}
                sent = {name: one for name, one in sent.items() if not _begins(one, items[id_].get(plain_name(name)))}
                wrong = next(differences(sent, items[id_], schema, create.shape, self._collections), "")
                expected, cause = f"the entry {id_} as {entry.label} wrote it", f"{create.label} entry"
                doubt = "a list may show its entries in short"
                yield occasion.case("description/written-is-read", not wrong, expected, wrong, cause=cause, doubt=doubt)
                del self._made[path][id_]
        yield from self._judge_refused(occasion, create, items, path)
        self._listed[path] = set(items)

    def _judge_refused(
        self, occasion: Occasion, create: Operation, items: dict[str, dict[str, Any]], path: str
    ) -> Iterator[Case]:
        """Judge whether what is new in a list, and no creation has given, was asked for by a refused one."""
        parts = parts_of(next(iter(create.bodies.values())).schema) if create.bodies else {}
        free = {name for name, part in parts.items() if is_free_text(part)}
        before, refused = self._listed.get(path), self._refused.pop(path, [])
        new = [item for id_, item in items.items() if before is not None and id_ not in before | self._given[path]]
        for entry in refused if before is not None else ():
            texts = {plain_name(name): entry.sent[name] for name in free & entry.sent.keys()}
            texts = {name: one for name, one in texts.items() if isinstance(one, str) and len(one) >= _TELLING}
            there = [item for item in new if texts and all(item.get(name) == one for name, one in texts.items())]
            if texts:
                expected, cause = f"a list without what {entry.label} asked for", f"{create.label} refused"
                found = f"a new entry with {clip(next(iter(texts.values())))}" if there else ""
                yield occasion.case("description/refused-keeps", not there, expected, found, cause=cause)


def _id_of(value: Any) -> str:
    """Return the identifier of an entry; empty if it has none."""
    item = members_of(value)
    return next((str(item[name]) for name in IDS if isinstance(item.get(name), str | int)), "")


def _begins(value: Any, seen: Any) -> bool:
    """Return whether a text in a list is the beginning of the one that was sent."""
    return isinstance(value, str) and isinstance(seen, str) and value != seen and value.startswith(seen.rstrip(".… "))


def _is_whole(occasion: Occasion, listing: Listing, page: Page) -> bool:
    """Return whether a response shows the whole list."""
    sent = listing.query_texts(occasion.context.target)
    limit = {listing.limit.name} if listing.limit is not None else set()
    return sent is not None and sent.keys() <= limit and not is_cut(listing, page, sent)
