"""Lists of a described API, read in parts by limit, offset, page and cursor, and with each filter and sort."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any, Final

from conformance.api.rest.applicable import allows, callable_operations
from conformance.api.rest.inputs import Inputs, request_of, usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.invalid_variations import invalid_variations
from conformance.api.rest.listing import (
    NEXT,
    Listing,
    Page,
    cursors,
    fitting,
    listing_of,
    members_of,
    next_texts,
    page_of,
)
from conformance.api.rest.references import in_link
from conformance.api.rest.values import Values
from conformance.api.rest.variations import NO_FORMAT
from conformance.checkers.lists import is_mixed
from conformance.checkers.occasion import SETTLES_S
from conformance.checkers.totals import says_filtered
from conformance.documents.json_schema import kinds_of
from conformance.documents.openapi import operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.documents.writing import text_of
from conformance.scenarios.list_queries import choices_of, queries_of, whole_query
from conformance.scenarios.scenario import NotPossibleError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.writing import Writer
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.transport.reach import is_same, joined, split
from conformance.verdict.evidence import SENTENCE

_LARGE: Final = 50
_PAGES: Final = 4  # consecutive pages to read, with _LARGE items at most where the limit allows that
_VALUES: Final = {"quick": 8}  # values of one parameter at quick
_MOST_VALUES: Final = 12
_BUDGETS: Final = 3  # multiple of an exploration's time that one list may take
_SLOW_SHARE: Final = 4  # a list with a response of over a second gets this fraction of the time
_TRIES: Final = 4  # how often a fault is tried again
_TWICE: Final = 2  # tries that must show it
_STEADY: Final = 3  # reads that must show the same list before and after
# A server may cut a list at a multiple of this number of items.
_ROUND: Final = 5
# Further members by which a list is sorted while its pages are read, and filters by which it is filtered.
_SORTS: Final = 2
_FILTERS: Final = 2
# Fewest items that make pages to compare.
_FEWEST: Final = 2
# Offsets beyond the end of a list, as far as the schema allows.
_BEYOND: Final = (1000, 100, 10, 1)
# How pages are read whose links the device gives.
_LINK: Final = "the link to the next page"
_REFUSED: Final = range(400, 500)
# Phrases in a description which say that the last page has no link to a next one.
_ENDS: Final = re.compile(
    r"\b(?:null|absent|missing|omitted|empty|none)\b[^.]*\b(?:last|no (?:more|further|other|item)|follows?|end)\b",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Paged:
    """A list that was read in parts, and as a whole.

    Attributes:
        operation: label of the operation.
        way: how the parts were asked for.
        found: the last request for a part.
        expected: what the part should have, as a noun phrase.
        fault: what it had instead; empty means what it should have.
        doubt: as in Case.
    """

    operation: str
    way: str
    found: Exchange
    expected: str
    fault: str = ""
    doubt: str = ""


def lists_of(api: RestInterface) -> list[Listing]:
    """Return the lists that may be read and that end."""
    operations = (one for one in operations_of(api.run.contract) if one.label not in api.streams and allows(api, one))
    return [listing for operation in operations if (listing := listing_of(operation)) is not None]


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.LATE)
def pages_of_lists(api: RestInterface, values: Values) -> tuple[Paged, ...]:
    """Read each list in parts, by each of its parameters for that, and compare the parts with the list."""
    found, is_possible = list[Paged](), False
    for listing in lists_of(api):
        if listing.limit or listing.offset or listing.page or listing.cursor:
            is_possible = True
            api.run.limit.check()
            with suppress(NoAnswerError):  # the survey reports a broken connection
                found += _pages_of(Reader(api, values, listing))
    if not is_possible:
        raise NotPossibleError("no list that may be read has parameters for a part of it")
    return tuple(found)


def _pages_of(reader: Reader) -> Iterator[Paged]:
    """Yield the records of reading a list in parts: plain, sorted, and filtered."""
    page, until = reader.page(), reader.until
    read = list[dict[str, Any]]()
    for query, by in (({}, ""), *_selections(reader.listing, page)) if page is not None else ():
        read.append(query)
        if time.monotonic() < until:
            yield from _Parts(replace(reader, always=query, by=by)).all(until)
    sort, sortings = reader.listing.sort, reader.listing.sortings
    for text in list(sortings) if sort is not None and page is not None and len(page.items) > 1 else ():
        query = {sort.name: [text] if "array" in kinds_of(sort.schema) else text} if sort is not None else {}
        if query not in read and time.monotonic() < until:
            yield from _Parts(replace(reader, always=query, by=sortings[text].member)).in_turn(until)


def _selections(listing: Listing, page: Page) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield values of the sort with their members, and values of filters that keep several items."""
    items = [members_of(one) for one in page.items]
    if listing.sort is not None and listing.direction is None and "array" not in kinds_of(listing.sort.schema):
        kept = {text: [item.get(one.member) for item in items] for text, one in listing.sortings.items()}
        ranks = {text: (is_mixed(values), len(set(map(str, values)))) for text, values in kept.items()}
        best = max(ranks, key=ranks.__getitem__, default="")
        # A cursor must tell apart items with equal values: try each member, because some may not.
        others = {one.member: text for text, one in listing.sortings.items()} if listing.cursor is not None else {}
        others.pop(listing.sortings[best].member if best else "", None)
        for text in (best, *islice(others.values(), _SORTS)):
            if ranks.get(text, (False, 0))[1] < _FEWEST:
                continue
            yield {listing.sort.name: text}, listing.sortings[text].member
    filters = list[dict[str, Any]]()
    for name, parameter in listing.filters.items():
        there = Counter(text_of(item.get(name)) for item in items if not isinstance(item.get(name), list | dict))
        usable = [one for one in choices_of(parameter, name, page) if _FEWEST <= there[text_of(one)] < len(items)]
        filters += [{parameter.name: usable[-1]}] if usable else []
    yield from ((one, "") for one in filters[:_FILTERS])


def pages_below(api: RestInterface, values: Values, listing: Listing, path: str) -> Iterator[Paged]:
    """Read a list below a thing in parts, and yield the parts."""
    reader = Reader(api, values, listing, path=path)
    yield from _Parts(reader).all(reader.until)
    page = reader.page()
    for query in islice(queries_of(listing, page, _FEWEST), 2 * _PAGES) if page is not None and page.items else ():
        reader.read(query)


def vary_lists(api: RestInterface, values: Values) -> None:
    """Send each list values of its filters and sorts, with and without a limit; read it plain at the end."""
    for listing in lists_of(api):
        api.run.limit.check()
        with suppress(NoAnswerError):
            reader = Reader(api, values, listing)
            page, until = reader.page(), reader.until
            whole = whole_query(listing, page) if page is not None else {}
            # The whole list has more values to choose by, and shows what a filter loses.
            part = reader.part(whole) if whole else None
            page = part[1] if part is not None else page
            if page is not None and page.items:
                reader.send_invalid()
                doubted = list[dict[str, Any]]()
                for query in queries_of(listing, page, _VALUES.get(api.run.effort.name, _MOST_VALUES), whole):
                    if time.monotonic() < until and _is_doubted(listing, reader.part(query), query):
                        doubted.append(query)
                _refuse_creations(api, values, listing)
                if whole:
                    reader.read(whole)
                _reread_totals(reader, doubted)


def _refuse_creations(api: RestInterface, values: Values, listing: Listing) -> None:
    """Send creations of items that their headers let the device refuse; the list afterwards has none of them."""
    create = callable_operations(api).get(("POST", listing.operation.template))
    if create is not None and "{" not in create.template:
        writer = Writer(api, values)
        if "406" in create.responses:
            writer.send(create, headers=(("Accept", NO_FORMAT),))
        if "415" in create.responses and create.bodies:
            writer.send(create, media_type="text/plain")


@dataclass(frozen=True)
class Reader:
    """Reads one list.

    Attributes:
        api, values: of the device.
        listing: the list.
        always: values of query parameters, by name, that each request has.
        by: as in Page.
        path: the path of a list below a thing.
    """

    api: RestInterface
    values: Values
    listing: Listing
    always: dict[str, Any] = field(default_factory=dict)
    by: str = ""
    path: str = ""

    @property
    def until(self) -> float:
        """The time at which reading the list ends if it begins now, s of the monotonic clock."""
        share = _SLOW_SHARE if self.listing.operation.label in self.api.slow else 1
        return time.monotonic() + _BUDGETS * self.api.run.effort.budget_s / share

    @property
    def usual(self) -> Inputs:
        """The values of its usual request."""
        return usual_inputs(self.listing.operation, self.values)[0]

    def read(self, query: dict[str, Any] | None = None) -> Exchange:
        """Send the usual request with further values of query parameters, by name."""
        inputs = self.usual
        for name, value in {**self.always, **(query or {})}.items():
            inputs = inputs.having("query", name, value)
        # A device may respond differently on a new connection, or with compression.
        is_odd, request = len(query or {}) % 2 == 1, request_of(self.listing.operation, inputs)
        target = self.path + "".join(request.target.partition("?")[1:]) if self.path else request.target
        headers = (*request.headers, *([("Accept-Encoding", "gzip")] if is_odd else []))
        found, limit = self.api.send(replace(request, target=target, headers=headers), fresh=is_odd), self.listing.limit
        page = page_of(found.response, self.listing.operation)
        most = inputs.query.get(limit.name) if limit is not None else None
        if limit is not None and page is not None and isinstance(most, int) and 0 < most < len(page.items):
            # A device that raises the limit shows as many items for the raised one.
            raised = request_of(self.listing.operation, inputs.having("query", limit.name, len(page.items)))
            self.api.send(
                replace(raised, target=self.path + raised.target[raised.target.index("?") :]) if self.path else raised
            )
        return found

    def send_invalid(self) -> None:
        """Send an invalid request, after which the valid ones have to be answered as before."""
        for variation in islice(invalid_variations(self.listing.operation, self.usual), 1):
            self.api.send(request_of(self.listing.operation, variation.inputs))

    def part(self, query: dict[str, Any] | None = None) -> tuple[Exchange, Page] | None:
        """Return a request as `read` sends it and the list in its response, or None."""
        return self.page_in(self.read(query))

    def page_in(self, exchange: Exchange) -> tuple[Exchange, Page] | None:
        """Return a request and the list in its response, or None."""
        page = page_of(exchange.response, self.listing.operation)
        return None if page is None else (exchange, replace(page, by=self.by))

    def follow(self, target: str) -> Exchange:
        """Send a GET of a link's target."""
        return self.api.send(replace(request_of(self.listing.operation, self.usual), target=target))

    def page(self) -> Page | None:
        """Return the list without optional parameters; None if the device does not return it."""
        part = self.part()
        return None if part is None else part[1]


def _reread_totals(reader: Reader, doubted: list[dict[str, Any]]) -> None:
    """Read lists with a wrong total again, if no change explains it: with the queries that had one, and without."""
    listing, first = reader.listing, reader.api.first.get(reader.listing.operation.label)
    before = page_of(first.response, listing.operation) if first is not None else None
    now = reader.page()
    query = dict[str, Any]()
    if now is not None and listing.limit is not None and 0 < listing.most({}) <= len(now.items):
        most = max(now.totals.values(), default=0) + _FEWEST
        query = {listing.limit.name: most} if fitting(listing.limit, most) else {}
        part = reader.part(query) if query else None
        now = part[1] if part is not None else None
    if before is None or now is None:
        return
    agreed = [name for name, total in before.totals.items() if total >= len(before.items)]
    wrong = [query] if not now.goes_on and any(now.totals.get(name) != len(now.items) for name in agreed) else []
    # A total of all items, regardless of the filter, is right too.
    parts, is_said = [(one, reader.part(one)) for one in doubted], says_filtered(listing)
    wrong += [
        query
        for query, part in parts
        if part is not None and (is_said or part[1].totals != now.totals) and _is_doubted(listing, part, query)
    ]
    if wrong:
        time.sleep(SETTLES_S)
        for one in (*wrong, *wrong):
            reader.read(one)


def _is_doubted(listing: Listing, part: tuple[Exchange, Page] | None, query: Mapping[str, Any]) -> bool:
    """Return whether a whole list, of selected items, has another total than items."""
    known = listing.selecting | ({listing.limit.name} if listing.limit is not None else set())
    if part is None or not part[1].items or not query.keys() <= known:
        return False
    page, most = part[1], listing.most({name: text_of(value) for name, value in query.items()})
    return not (page.goes_on or 0 < most <= len(page.items)) and any(
        0 < total != len(page.items) for total in page.totals.values()
    )


@dataclass
class _Parts:
    """Reads one list in parts."""

    reader: Reader

    def all(self, until: float) -> Iterator[Paged]:
        """Yield the records of each way to read the list in parts, until a time on the monotonic clock."""
        whole = self.reader.page()
        fewest = _FEWEST if self.reader.by or whole is None else max(_FEWEST, len(whole.items))
        if whole is None or len(set(whole.identities)) < fewest:
            return
        for walk in (
            self._entire,
            self._exact,
            self._read_shifted,
            self._beyond,
            self._last,
            self._by_offset,
            self._by_page,
            self._by_cursor,
            self._by_link,
        ):
            found = self._twice(walk, whole) if time.monotonic() < until else None
            if found is not None:
                yield found

    def in_turn(self, until: float) -> Iterator[Paged]:
        """Yield the record of reading page after page, in the first way that the list allows."""
        whole, listing = self.reader.page(), self.reader.listing
        ways = ((listing.cursor, self._by_cursor), (listing.offset, self._by_offset), (listing.page, self._by_page))
        walk = next((way for parameter, way in ways if parameter is not None), None)
        if whole is not None and walk is not None and time.monotonic() < until:
            found = self._twice(walk, whole)
            yield from [found] if found is not None else []

    def _twice(self, walk: Callable[[Page], Paged | None], whole: Page) -> Paged | None:
        """Return the record of a walk; a fault counts if it appears twice while the list stays the same."""
        faults = 0
        for _ in range(_TRIES):
            found = walk(whole)
            if found is None or (not found.fault and not faults):
                return found
            faults += bool(found.fault)
            again = [self.reader.page() for _ in range(_STEADY)]
            if any(one is None or one.identities != whole.identities for one in again):
                return None
            if found.fault and faults == _TWICE:
                return found
        return None

    def _page_case(self, way: str, found: Exchange, expected: str, fault: str) -> Paged:
        return Paged(self.reader.listing.operation.label, way, found, expected, fault)

    def _entire(self, whole: Page) -> Paged | None:
        """Read with a limit that is just beyond the list, which a server may cut at a round number of items."""
        limit, size = self.reader.listing.limit, len(whole.items) + 1
        part = self.reader.part({limit.name: size}) if limit is not None and fitting(limit, size) else None
        if limit is None or part is None:
            return None
        found = part[1].identities
        expected = whole.identities[: len(found)] if len(found) % _ROUND == 0 else whole.identities
        # A limit may select the newest items: then the ends of both lists are equal.
        is_newest = found[-len(whole.items) :] == whole.identities[-len(found) :]
        fault = "" if found[: len(expected)] == expected or is_newest else _difference(expected, found)
        return self._page_case(limit.name, part[0], f"the whole list, by {limit.name}={size}", fault)

    def _exact(self, whole: Page) -> Paged | None:
        """Read with a limit equal to the list's length: no page may follow, if the description says how that shows."""
        listing, limit, cursor = self.reader.listing, self.reader.listing.limit, self.reader.listing.cursor
        count = self._count(whole)
        is_said = any(NEXT.fullmatch(plain_name(name)) and _ENDS.search(text) for name, text in listing.says.items())
        if limit is None or cursor is None or not is_said or not fitting(limit, count):
            return None
        part = self.reader.part({limit.name: count})
        following = next(cursors(listing, *part), "") if part is not None else ""
        later = self.reader.part({limit.name: count, cursor.name: following}) if following else part
        if part is None or later is None or len(part[1].items) != count:
            return None
        fault = f"{cursor.name} {following[:60]}, which leads to an empty page" if not later[1].items else ""
        expected, way = "no further page, as the description says of the last", f"{limit.name} exactly"
        return replace(self._page_case(way, later[0], expected, fault), doubt=SENTENCE)

    def _read_shifted(self, whole: Page) -> Paged | None:
        """Read from the second item on."""
        offset = self.reader.listing.offset
        part = self.reader.part({offset.name: 1}) if offset is not None and fitting(offset, 1) else None
        if offset is None or part is None:
            return None
        expected, found = whole.identities[1:], part[1].identities
        fault = "" if found[: len(expected)] == expected else _difference(expected, found)
        return self._page_case(offset.name, part[0], f"the list from its second item on, by {offset.name}=1", fault)

    def _beyond(self, whole: Page) -> Paged | None:
        """Read far beyond the end."""
        listing, end = self.reader.listing, max([len(whole.items), *whole.totals.values()])
        offset = listing.offset or listing.page
        far = next((end + more for more in _BEYOND if fitting(offset, end + more)), None)
        part = self.reader.part({offset.name: far}) if offset is not None and far is not None else None
        if offset is None or part is None or (whole.goes_on and not whole.totals):
            return None
        found = part[1].identities
        # For a page beyond the end, some servers return the last page, or end with the items read before.
        is_last = listing.offset is None and len(found) >= end
        again = bool(found) and found[:1] == whole.identities[:1] and not is_last
        fault = f"the item {found[0]} of the first page" if again else ""
        return self._page_case(offset.name, part[0], f"no item of the first page, by {offset.name}={far}", fault)

    def _last(self, whole: Page) -> Paged | None:
        """Read the last two items, if a total shows where they are."""
        offset, end = self.reader.listing.offset, max(whole.totals.values(), default=0)
        is_later = end > len(whole.items) and not self.reader.always and fitting(offset, end - _FEWEST)
        part = self.reader.part({offset.name: end - _FEWEST}) if offset is not None and is_later else None
        if offset is None or part is None or part[1].totals != whole.totals:
            return None
        fault = "" if len(part[1].items) >= _FEWEST else f"{len(part[1].items)} items"
        return self._page_case(offset.name, part[0], f"the last {_FEWEST} of {end} items, by {offset.name}", fault)

    def _by_offset(self, whole: Page) -> Paged | None:
        offset = self.reader.listing.offset
        if offset is None or not fitting(offset, 0):
            return None
        return self._walk(whole, offset.name, lambda read, _: {offset.name: read})

    def _by_page(self, whole: Page) -> Paged | None:
        page, limit, size = self.reader.listing.page, self.reader.listing.limit, self._size(whole)
        if page is None or limit is None or not size:
            return None
        # Page numbers begin at 0 or at 1.
        begin = 1 if 1 in {flat(page.schema).get("default"), flat(page.schema).get("minimum")} else None
        if begin is None:
            starts = (one for one in (1, 0) if self._begins(whole, {page.name: one, limit.name: size}))
            begin = next(starts, None)
        if begin is None:
            return None
        return self._walk(whole, page.name, lambda _, number: {page.name: begin + number})

    def _begins(self, whole: Page, query: dict[str, Any]) -> bool:
        part = self.reader.part(query)
        return part is not None and part[1].identities[:1] == whole.identities[:1]

    def _by_cursor(self, whole: Page) -> Paged | None:
        cursor = self.reader.listing.cursor
        return None if cursor is None else self._walk(whole, cursor.name, lambda read, _: {} if not read else None)

    def _by_link(self, whole: Page) -> Paged | None:
        """Follow the links to the next page, as they are; None if the first page has no such link."""
        limit, size = self.reader.listing.limit, self._size(whole)
        first = self.reader.part({limit.name: size}) if limit is not None and size else None
        if first is None or next(self._links(*first), None) is None:
            return None
        return self._walk(whole, _LINK, lambda read, _: {} if not read else None)

    def _links(self, exchange: Exchange, page: Page) -> Iterator[str]:
        """Yield the targets of links to the next page on the same server, without the prefix of its address.

        A link without the limit of the request may leave it to the client to add the other parameters as well.
        """
        prefix, limit = self.reader.api.client.prefix, self.reader.listing.limit
        for text in next_texts(exchange, page):
            url = joined(exchange.request.url, text)
            is_whole = limit is not None and limit.name in dict(in_link(url))
            if is_whole and is_same(url, exchange.request.url):
                target = split(url)[1]
                yield from [target.removeprefix(prefix)] if target.startswith(prefix) else []

    def _size(self, whole: Page) -> int:
        """Return the page size for about three pages; 0 if none is allowed."""
        count = self._count(whole)
        sizes = range((count + 2) // 3, count)
        return next((size for size in sizes if fitting(self.reader.listing.limit, size)), 0)

    def _count(self, whole: Page) -> int:
        """Return the number of items in all pages: those of the whole list, or a greater total that it reports."""
        count, limit = len(whole.items), self.reader.listing.limit
        page = max(count, min(int(flat(limit.schema).get("maximum", 0)), _LARGE)) if limit is not None else count
        known = () if self.reader.always else (total for total in whole.totals.values() if total <= _PAGES * page)
        return int(max([count, *known]))

    def _walk(self, whole: Page, way: str, where: Callable[[int, int], dict[str, Any] | None]) -> Paged | None:
        """Read page after page, and compare them with the whole list.

        Args:
            whole: the list.
            way: name of the parameter.
            where: returns the parameter by the number of items and of pages read; None if the page before names it.
        """
        limit, size = self.reader.listing.limit, self._size(whole)
        if limit is None or not size:
            return None
        ids: list[str] = []
        last: tuple[Exchange, Page] | None = None
        ends = loops = ""
        for number in range(_PAGES):
            query, link = where(len(ids), number), ""
            if query is None and last is not None:
                links = self._links(*last) if way == _LINK else cursors(self.reader.listing, *last)
                following = next(links, "")
                link = following if way == _LINK else ""
                query = {way: following} if following else None
            if query is None:
                # Only a device that named a next page before says by its absence that this is the last.
                ends = f"no further page after {len(ids)} items" if number > 1 and not whole.goes_on else ""
                break
            sent = self.reader.follow(link) if link else self.reader.read({**query, limit.name: size})
            part = self.reader.page_in(sent)
            if part is None and link and sent.response.status in _REFUSED:
                found = f"status {sent.response.status} for {_LINK}"
                return self._page_case(way, sent, f"each item of the list once, page after page by {way}", found)
            if part is None:
                return None
            last = part
            ids += part[1].identities
            if len(ids) >= self._count(whole) and not whole.goes_on:
                again = [text for text in self._after(part, way, {limit.name: size})[:1] if text in ids]
                loops = f"the item {again[0][:60]} again, after the last page" if again else ""
                break
            if not part[1].items:
                ends = f"an empty page after {len(ids)} items"
                break
        if last is None:
            return None
        expected = whole.identities[: len(ids)]
        fault = "" if tuple(ids[: len(expected)]) == expected else _difference(expected, tuple(ids))
        # The list may have become shorter meanwhile.
        count = min([self._count(whole), *last[1].totals.values()])
        fault = fault or loops or (ends if len(ids) < max(count, len(whole.items)) else "")
        twice = next((f"the item {text[:60]} twice" for text in ids if ids.count(text) > 1), "")
        fault = fault or ("" if self.reader.by else twice)
        return self._page_case(way, last[0], f"each item of the list once, page after page by {way}", fault)

    def _after(self, last: tuple[Exchange, Page], way: str, size: dict[str, Any]) -> tuple[str, ...]:
        """Return the items of the page that the last page names as the next one; a loop begins again."""
        reader, cursor = self.reader, self.reader.listing.cursor
        links = [reader.follow(link) for link in self._links(*last)][:1] if way == _LINK else []
        part = reader.page_in(links[0]) if links else None
        if cursor is not None and way == cursor.name:
            following = next(cursors(reader.listing, *last), "")
            part = reader.part({way: following, **size}) if following else None
        return part[1].identities if part is not None else ()


def _difference(expected: tuple[str, ...], found: tuple[str, ...]) -> str:
    """Return where two lists differ, as a noun phrase."""
    for number, (one, other) in enumerate(zip(expected, found, strict=False), 1):
        if one != other:
            return f"{other[:60]} in place of {one[:60]} as item {number}"
    return f"{len(found)} items instead of {len(expected)}"
