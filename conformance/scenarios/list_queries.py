"""Values of filters, bounds and the sort that a list is read with, and the pairs of them that show the most."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta, timezone
from itertools import combinations, islice
from typing import Any, Final

from conformance.api.rest.listing import Listing, Page, fitting, members_of, searches
from conformance.documents.json_schema import kinds_of
from conformance.documents.parameters import Parameter
from conformance.documents.representation import flat

# _FILTERS: filters of a list by which one thing is chosen. _MOST_ITEMS: items of that list.
_FILTERS, _MOST_ITEMS = 3, 1000
# Pairs of parameters that are sent together.
_TOGETHER: Final = 3
# How many values are also sent together with a page limit.
_WITH_PART: Final = 6
# A total is taken to be exceeded by this limit.
_MORE: Final = 2
# _LATER: between the last item and an instant after it. _FAR: difference from UTC of a distant time zone.
_LATER: Final = timedelta(hours=1)
_FAR: Final = timedelta(hours=11)


def queries_of(listing: Listing, page: Page, most: int) -> Iterator[dict[str, Any]]:
    """Yield values of filters and of the sort, every second one with a limit."""
    rows: list[dict[str, Any]] = []
    for name, parameter in listing.filters.items():
        rows += [{parameter.name: value} for value in choices_of(parameter, name, page)[:most]]
    rows += _together(listing, page)
    total = max(page.totals.values(), default=0) + _MORE
    is_cut = listing.limit is not None and len(page.items) + _MORE < total and fitting(listing.limit, total)
    whole = {listing.limit.name: total} if listing.limit is not None and is_cut else {}
    for bound in listing.bounds:
        there = {
            members_of(item).get(bound.member) for item in page.items if members_of(item).get(bound.member) is not None
        }
        ordered = sorted(there, key=lambda item: bound.rank(str(item)) or 0)
        # The middle of several values: items lie on both sides, and one at the bound. Levels have an unknown order.
        is_level = "enum" in flat(bound.parameter.schema)
        middle = ordered if is_level else ordered[len(ordered) // 2 : len(ordered) // 2 + 1]
        beyond = [_beyond(ordered[-1 if bound.is_least else 0], is_least=bound.is_least)] if ordered else []
        rows += [
            {bound.parameter.name: text, **whole}
            for text in (*middle, *beyond)
            if len(ordered) > 1 and text is not None and fitting(bound.parameter, text)
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


def _beyond(value: Any, *, is_least: bool) -> str | None:
    """Return an instant that excludes all items, as clocks far away show it; without its offset it excludes none."""
    sign = 1 if is_least else -1
    try:
        at = datetime.fromisoformat(value)
        far = (at + sign * _LATER).astimezone(timezone(-sign * _FAR)) if at.tzinfo is not None else None
    except (TypeError, ValueError, OverflowError):
        return None
    return far.isoformat(timespec="milliseconds") if far is not None else None


def _together(listing: Listing, page: Page) -> list[dict[str, Any]]:
    """Return values of pairs of parameters, each of which excludes an item that the other one keeps."""
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


def choosing(listing: Listing, thing: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the queries of a list that choose a thing by a member, or sort all, with as many items as may be."""
    limit, own = listing.limit, members_of(thing)
    most = flat(limit.schema).get("maximum") if limit is not None else None
    many = {limit.name: min(most, _MOST_ITEMS)} if limit is not None and isinstance(most, int) else {}
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
    lists = [[value] for value in found] + ([found[:2]] if len(found) > 1 else [])
    return [item for item in (lists if is_list else found) if fitting(parameter, item)]
