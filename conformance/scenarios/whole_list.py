"""The list of a collection, read page by page: the items in it, and whether they are all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final
from urllib.parse import quote

from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.listing import Page, cursors, listing_of, page_of
from conformance.api.rest.things import below_others, collection_of, id_member, identifier_of
from conformance.checkers.totals import counters_of, numbers_by_items, numbers_of
from conformance.documents.openapi import Operation
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.documents.writing import json_text
from conformance.scenarios.list_queries import many_items
from conformance.scenarios.writing import Writer, members
from conformance.transport.exchange import Exchange, NoAnswerError, Outgoing
from conformance.transport.parallel import send_together

_PAGES: Final = 5
_LIMITS: Final = frozenset({"limit", "pagesize", "perpage", "size", "maxresults", "pagelimit"})
# A server with an undeclared limit returns a multiple of _ROUND items, at least _FEWEST.
_ROUND, _FEWEST = 5, 10
_NEWEST: Final = 2  # things that were created, of each collection


@dataclass(frozen=True)
class WholeList:
    """The outcome of one reading of a list.

    Attributes:
        exchange: the last page.
        ids: the identifier of each item, as a text in lower case; empty where it has none.
        twice: the identifiers of items that occur more than once and are equal.
        items: the items that are objects.
        is_whole: whether these are all items.
    """

    exchange: Exchange
    ids: tuple[str, ...] = ()
    twice: frozenset[str] = frozenset()
    items: tuple[dict[str, Any], ...] = ()
    is_whole: bool = False


def chooses(lister: Operation) -> bool:
    """Return whether a list's operation has parameters by which items may be left out."""
    listing = listing_of(lister)
    parts = (
        (listing.limit, listing.offset, listing.page, listing.cursor, listing.sort, listing.direction)
        if listing
        else ()
    )
    return any(parameter not in parts for parameter in lister.parameter("query"))


def read_whole(
    writer: Writer, lister: Operation, item: Operation, path: str, always: Mapping[str, Any] = MappingProxyType({})
) -> WholeList:
    """Read a list by a bounded number of pages."""
    exchange, found, is_whole = writer.send(lister, path, query=always), list[Any](), False
    for number in range(1, _PAGES + 1):
        page = page_of(exchange.response, lister)
        if page is None or (number > 1 and page.items and page.items[0] in found):
            break
        found += page.items
        is_whole = not (
            page.goes_on or max(page.totals.values(), default=0) > len(found) or _seems_cut(lister, page, always)
        )
        query = None if is_whole else _next(lister, exchange, page, len(found), number)
        if query is None:
            break
        exchange = writer.send(lister, path, query={**always, **query})
    items = tuple(one for one in found if isinstance(one, dict))
    ids = tuple(identifier_of(one, item) for one in items)
    equal = Counter((id_, json_text(one)) for id_, one in zip(ids, items, strict=True) if id_)
    return WholeList(exchange, ids, frozenset(key[0] for key, count in equal.items() if count > 1), items, is_whole)


def _next(lister: Operation, exchange: Exchange, page: Page, count: int, number: int) -> dict[str, Any] | None:
    """Return the query of the page after that with this number, from 1, up to which ``count`` items came; or None."""
    listing = listing_of(lister)
    if listing is not None and listing.cursor is not None:
        following = next(cursors(listing, exchange, page), None)
        return {listing.cursor.name: following} if following else None
    if listing is not None and listing.offset is not None:
        return {listing.offset.name: count}
    if listing is not None and listing.page is not None:
        schema = flat(listing.page.schema)
        return {listing.page.name: number + (0 if 0 in {schema.get("default"), schema.get("minimum")} else 1)}
    return None


def _seems_cut(lister: Operation, page: Page, sent: Mapping[str, Any]) -> bool:
    """Return whether a page has exactly as many items as a declared or usual limit."""
    count, listing = len(page.items), listing_of(lister)
    said = [one for part in page.around for name, one in part.items() if plain_name(name) in _LIMITS]
    most = listing.most({name: str(one) for name, one in sent.items()}) if listing is not None else 0
    return bool(count) and (
        count in {most, *(item for item in said if isinstance(item, int))} or (count >= _FEWEST and count % _ROUND == 0)
    )


def read_numbers(writer: Writer, lister: Operation | None, path: str) -> None:
    """Read a list, and the resource that counts its items, until both agree or the time is over."""
    template = lister.template.rstrip("/") if lister is not None else ""
    known, path = callable_operations(writer.api), path.rstrip("/")
    above = known.get(("GET", template.rpartition("/")[0]))
    numbers = numbers_of(above, lister) if above is not None and lister is not None else {}
    there = path.rpartition("/")[0]
    if template in (counters := counters_of(known.values())):
        there, numbers = counters[template][0].template, counters[template][1]

    def agree(found: list[Exchange]) -> bool:
        page, now = page_of(found[0].response, lister), members(found[1], numbers)
        right = numbers_by_items(numbers, now, page.items) if page is not None else {}
        return all(now[name] == number for name, number in right.items())

    if numbers:
        requests = [Outgoing("GET", one) for one in (path, there)]
        writer.until(lambda: [writer.api.send(request) for request in requests], agree)


def read_items(writer: Writer) -> None:
    """Read the first, the middle and the last item of each list, and the first one again; then all of them at once.

    What the run has created last is read too, with the longest list between two reads.
    """
    operations = callable_operations(writer.api)
    for (method, path), item in operations.items():
        lister = operations.get(("GET", collection_of(path))) or next(below_others(operations, "GET", item), None)
        if method != "GET" or lister is None or len(item.parameter("path")) != 1:
            continue
        writer.api.run.limit.check()
        with suppress(NoAnswerError):  # the survey reports a broken connection
            _read_newest(writer, lister, item, operations.get(("DELETE", path)))
            page = page_of(writer.send(lister).response, lister)
            ids = [id_member(one, item)[1] for one in page.items if isinstance(one, dict)] if page is not None else []
            ids = [one for one in ids if one is not None]
            chosen = dict.fromkeys(ids[index] for index in (0, len(ids) // 2, -1)) if ids else {}
            name = item.parameter("path")[0].name
            paths = [item.template.replace(f"{{{name}}}", quote(str(id_), safe="")) for id_ in chosen]
            for there in [*paths, *paths[: len(paths) > 1]]:
                writer.send(item, there)
            requests = [(writer.api.client, writer.request(item, there)) for there in paths]
            send_together([requests, requests[::-1]] * (len(paths) > 1))


def _read_newest(writer: Writer, lister: Operation, item: Operation, delete: Operation | None) -> None:
    """Read things that the run has created, the list with as many items as may be, and the things again."""
    made = writer.values.of(delete, delete.parameter("path")[0])[:_NEWEST] if delete is not None else []
    listing, name = listing_of(lister), item.parameter("path")[0].name
    paths = [item.template.replace(f"{{{name}}}", quote(str(id_), safe="")) for id_ in made]
    if listing is not None and paths and not lister.parameter("path"):
        for there in paths:
            writer.send(item, there)
        writer.send(lister, query=many_items(listing))
        for there in paths:
            writer.send(item, there)
