"""Values of filters, bounds and the sort that a list is read with, and the pairs of them that show the most."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import datetime, timedelta, timezone
from itertools import combinations, islice
from typing import Any, Final

from conformance.api.rest.listing import CASED, CASELESS, Listing, Page, fitting, members_of
from conformance.checkers.lists import says_whole
from conformance.documents.json_schema import kinds_of
from conformance.documents.parameters import Parameter
from conformance.documents.representation import flat

_FILTERS = 3  # filters of a list by which one thing is chosen
_MOST_ITEMS = 1000  # longest list that is filtered, items
# Pairs of parameters that are sent together.
_TOGETHER: Final = 3
# How many values are also sent together with a page limit.
_WITH_PART: Final = 6
# A total is taken to be exceeded by this limit.
_MORE: Final = 2
# Phrases in a description which say that a search text has no wildcards.
_PLAIN: Final = re.compile(r"\b(?:without|no|not) (?:any )?wildcards?\b", re.IGNORECASE)
# A search text that no item contains.
_NOWHERE: Final = "roaas7nowhere"
# Texts that mean something in a regular expression, and in SQL's LIKE.
_SPECIAL: Final = ("(", "%")
_LATER: Final = timedelta(hours=1)  # between the last item and a time after it
_FAR: Final = timedelta(hours=11)  # difference from UTC of a distant time zone


def queries_of(
    listing: Listing, page: Page, most: int, whole: dict[str, Any] | None = None
) -> Iterator[dict[str, Any]]:
    """Yield values of filters and of the sort, every second one with a limit; ``whole``: a limit that cuts nothing."""
    rows: list[dict[str, Any]] = []
    for name, parameter in listing.filters.items():
        values = choices_of(parameter, name, page)[:most]
        # A part of a value finds nothing where a filter goes by the whole of it.
        texts = [one[:-1] for one in values[:1] if isinstance(one, str) and len(one) > 1 and says_whole(parameter)]
        rows += [{parameter.name: one} for one in (*values, *texts) if one in values or fitting(parameter, one)]
    rows += _together(listing, page)
    whole = whole or whole_query(listing, page)
    for bound in listing.bounds:
        there = {
            members_of(item).get(bound.member) for item in page.items if members_of(item).get(bound.member) is not None
        }
        ordered = sorted(there, key=lambda item: bound.rank(str(item)) or 0)
        # The middle of several values: items lie on both sides, and one at the bound. Levels have an unknown order.
        is_level = "enum" in flat(bound.parameter.schema)
        middle = ordered if is_level else ordered[: len(ordered) - 1][len(ordered) // 2 : len(ordered) // 2 + 1]
        beyond = [_beyond(ordered[-1 if bound.is_least else 0], is_least=bound.is_least)] if ordered else []
        rows += [
            {bound.parameter.name: text, **whole}
            for text in (*middle, *beyond)
            if text is not None and fitting(bound.parameter, text)
        ]
    if listing.sort is not None:
        directions = flat(listing.direction.schema).get("enum", ()) if listing.direction is not None else ()
        for number, text in enumerate(list(listing.sortings)[:most]):
            value: Any = [text] if "array" in kinds_of(listing.sort.schema) else text
            turned = {listing.direction.name: directions[number % len(directions)]} if listing.direction else {}
            rows.append({listing.sort.name: value, **turned})
    few = next((one for one in (2, 1) if fitting(listing.limit, one)), None)
    part = {listing.limit.name: few} if listing.limit is not None and few is not None else {}
    later = {listing.offset.name: 1} if listing.offset is not None and fitting(listing.offset, 1) else {}
    sorts = {listing.sort.name: rows[-1][listing.sort.name]} if listing.sort is not None and listing.sortings else {}
    yield from [part] if part and listing.filters else []
    for number, row in enumerate([*rows, *searches(listing, page)] or [{}]):
        yield row
        if number >= _WITH_PART:
            continue
        if part and number % 2 == 0:
            # The whole list again shows whether the total is that of the part.
            single = {name: 1 for name in part if number and fitting(listing.limit, 1)}
            yield from ({**row, **part, **single}, row)
        elif later or part:
            yield {**sorts, **row, **part, **later}


def whole_query(listing: Listing, page: Page) -> dict[str, Any]:
    """Return a limit with which the whole list comes, by its total or as many as may be; nothing where not needed."""
    total, limit = max(page.totals.values(), default=0) + _MORE, listing.limit
    is_cut = len(page.items) + _MORE < total or 0 < listing.most({}) <= len(page.items)
    found = {} if page.totals else many_items(listing)
    found = found or ({limit.name: total} if limit is not None and fitting(limit, total) else {})
    return found if is_cut else {}


def _beyond(value: Any, *, is_least: bool) -> str | None:
    """Return an instant that excludes all items, as clocks far away show it; without its offset it excludes none."""
    sign = 1 if is_least else -1
    try:
        at = datetime.fromisoformat(value)
        far = (at + sign * _LATER).astimezone(timezone(-sign * _FAR)) if at.tzinfo is not None else None
    except (TypeError, ValueError, OverflowError):
        return None
    return far.isoformat(timespec="milliseconds") if far is not None else None


def searches(listing: Listing, page: Page) -> Iterator[dict[str, Any]]:
    """Yield search texts: one that no item has, special ones, and ends of words of searched members in any case."""
    search = listing.search
    if search is None:
        return
    yield from [{search.name: _NOWHERE}] if listing.searched and fitting(search, _NOWHERE) else []
    yield from ({search.name: text} for text in _SPECIAL if fitting(search, text))
    for name in listing.searched:
        texts = [value for item in page.items if isinstance(value := members_of(item).get(name), str)]
        words = [word[1:] for text in reversed(texts) for word in text.split() if word.isascii() and word.isalnum()]
        # A word that begins no text, and that some items do not have, shows more.
        words.sort(key=lambda word: (any(text.startswith(word) for text in texts), all(word in text for text in texts)))
        for word in [one for one in words if len(one) > 1][:1]:
            turned = [word.swapcase()] if CASELESS.search(search.says) or CASED.search(search.says) else []
            terms = turned if CASELESS.search(search.says) else [word, *turned]
            yield from ({search.name: term} for term in terms if fitting(search, term))
    if _PLAIN.search(search.says) and fitting(search, "%"):
        yield {search.name: "%"}


def _together(listing: Listing, page: Page) -> list[dict[str, Any]]:
    """Return values for pairs of parameters: each excludes an item that the other one keeps."""
    items = [members_of(one) for one in page.items]
    kept = [
        (parameter.name, value, {place for place, item in enumerate(items) if item.get(name) == value})
        for name, parameter in listing.filters.items()
        for value in choices_of(parameter, name, page)
    ]
    for bound in listing.bounds:
        there = {place: item[bound.member] for place, item in enumerate(items) if item.get(bound.member) is not None}
        for value in dict.fromkeys(one for one in there.values() if fitting(bound.parameter, one)):
            within = {place for place, other in there.items() if not bound.excludes(str(value), other)}
            kept.append((bound.parameter.name, value, within))
    found = dict[tuple[str, str], dict[str, Any]]()
    for (first, one, these), (second, other, those) in combinations(kept, 2):
        if first != second and these - those and those - these:
            found.setdefault((first, second), {first: one, second: other})
    return list(found.values())[:_TOGETHER]


def many_items(listing: Listing) -> dict[str, Any]:
    """Return a limit with as many items as may be, where the description says how many that is."""
    most = flat(listing.limit.schema).get("maximum") if listing.limit is not None else None
    return {listing.limit.name: min(most, _MOST_ITEMS)} if listing.limit is not None and isinstance(most, int) else {}


def choosing(listing: Listing, thing: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the queries of a list that choose a thing by a member, or sort all, with as many items as may be."""
    own, many = members_of(thing), many_items(listing)
    found = [(one, own.get(name)) for name, one in listing.filters.items()]
    usable = [(one, value) for one, value in found if isinstance(value, str | int) and fitting(one, value)][:_FILTERS]
    usable += [(listing.sort, text) for text in islice(listing.sortings, 1) if listing.sort is not None]
    yield from ({one.name: value, **many} for one, value in usable)


def choices_of(parameter: Parameter, name: str, page: Page) -> list[Any]:
    """Return values to filter by: the declared ones, or two different ones that items have."""
    schema, is_list = flat(parameter.schema), "array" in kinds_of(parameter.schema)
    schema = flat(schema["items"]) if isinstance(schema.get("items"), dict) else schema
    found = [True, False] if kinds_of(schema) == {"boolean"} else [item for item in schema.get("enum", ()) if item]
    if not found:
        there = [members_of(item).get(name) for item in page.items]
        found = list(dict.fromkeys(item for item in there if isinstance(item, str | int) and item != ""))[:2]
    # Of several values, the last ones may be lost.
    lists = ([found[:2]] if len(found) > 1 else []) + [[value] for value in found]
    return [item for item in (lists if is_list else found) if fitting(parameter, item)]
