"""Lists: query parameters limit, filter and sort them, and totals agree with the items."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import combinations, pairwise
from typing import Any, Final

from conformance.api.rest.listing import (
    CASED,
    CASELESS,
    IN_TIME,
    Bound,
    Listing,
    Page,
    listing_of,
    members_of,
    number_of,
    page_of,
)
from conformance.checkers.occasion import Occasion
from conformance.checkers.totals import Places, Totals
from conformance.documents.json_schema import is_number, kinds_of
from conformance.documents.openapi import SAFE
from conformance.documents.parameters import Parameter, plain_name
from conformance.documents.representation import flat
from conformance.documents.writing import text_of
from conformance.transport.exchange import Response
from conformance.verdict.evidence import SENTENCE, Case

_REMEMBERED: Final = 50_000  # values of items that are remembered
_ASKED: Final = 1000  # filter values that are remembered
_COMPARED: Final = 60  # items of a list that are compared with other lists
# A device may raise small limits to a least one, so a longer list than the limit counts only above this many items.
_LEAST: Final = 10
# A server may cut a list at a multiple of this number of items.
_ROUND: Final = 5
# How often two lists from a level on must be apart, as an item may come or go meanwhile.
_SEEN: Final = 2
# Kinds of items that a sorted list may have: all items of one kind may come before those of another.
_KINDS: Final = 2
#: Parameters that ask for a level or higher, as log filters do.
LEVELS: Final = frozenset({"level", "severity", "loglevel", "priority", "criticality", "rank"})
#: Boolean parameters that ask for further items when true.
_INCLUDING: Final = frozenset({"deleted", "archived", "hidden", "removed", "inactive", "expired", "retired", "draft"})
_ALL: Final = frozenset({"all", "any", "none", "*", "both", "default", "unknown", "other", ""})

# Texts that the suite sends as a cursor and no device returns.
_NO_CURSOR: Final = re.compile(r"roaas|\s|[^ -~]")
# Phrases in a description which say that a value is refused.
_REFUSED: Final = re.compile(r"\b4(?:\d\d|xx)\b|\b(?:refus|reject|invalid)", re.IGNORECASE)
# A link in the header Link, with its relation (RFC 8288).
_LINK: Final = re.compile(r"""<([^>]*)>[^,<]*?;\s*rel\s*=\s*"?([^";,]+)""", re.IGNORECASE)
_RELATIONS: Final = {"next": "next", "prev": "prev", "previous": "prev", "first": "first", "last": "last"}


class Lists:
    """Judges each response with a list by the parameters of its request.

    Only values are judged that an item already had in an earlier list: a device may change an item while it answers.
    """

    def __init__(self) -> None:
        self._seen: set[int] = set()
        # Values other than the requested one in the items of a response, by operation, parameter and requested value.
        self._others: dict[tuple[str, str], dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
        self._totals, self._places = Totals(), Places()
        # The greatest number of items so far, by operation and other parameters.
        self._longest: dict[object, int] = defaultdict(int)
        # Numbers of items of lists that no limit cut.
        self._raised: dict[object, dict[int, list[Case]]] = defaultdict(dict)
        # Limits to which a first page was cut, by operation.
        self._kept: dict[str, set[int]] = defaultdict(set)
        # Operations whose lists have become shorter by themselves.
        self._shrinking: set[str] = set()
        # Lists with fewer items than the default page size although more exist: number of items, total, case, and
        # whether a request with a limit has returned more since then.
        self._short: dict[object, tuple[int, int, Case, bool]] = {}
        # The items of the whole list, by path. Then: filters and searches without one of them, until the whole list
        # shows that item again: its id, the filter as a function, and the case.
        self._whole: dict[str, dict[str, dict[str, Any]]] = defaultdict(dict)
        self._missed: dict[str, list[tuple[str, Callable[[Mapping[str, Any]], bool], Case]]] = defaultdict(list)
        # How many items a list had, by each value of a parameter that bounds a member.
        self._counts: dict[tuple[str, str], dict[float, int]] = defaultdict(dict)
        # Values that lists from a level on had since the last change, and how often two such lists were apart.
        self._shown: dict[tuple[str, str], dict[str, set[str]]] = defaultdict(dict)
        self._apart: dict[tuple[str, str], int] = defaultdict(int)
        # Limits with which a list without pages had too few items, until it is long again, by operation and other
        # parameters.
        self._cut: dict[object, dict[int, Case]] = defaultdict(dict)

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        if occasion.request.method not in SAFE:
            self._totals.note_change(occasion.response.received_s)
            for memory in (self._longest, self._whole, self._missed, self._shown, self._cut, self._places):
                memory.clear()
        operation = occasion.operation
        listing = listing_of(operation) if operation is not None and operation.method == "GET" else None
        if listing is None or occasion.request.method != "GET" or not occasion.context.is_usual_in_any_coding:
            return
        page, sent = page_of(occasion.response, operation), listing.query_texts(occasion.context.target)
        if page is None or sent is None:
            return
        yield from _said_order(occasion, listing, page, sent)
        yield from self._cursor(occasion, listing, page, sent)
        if not (listing.operation.parameters or page.totals):
            return
        for judge in (
            self._cuts, self._limit, self._filters, self._bounds, self._includes, self._order, self._totals,
            self._search, self._misses, self._places, _links,
        ):  # fmt: skip
            yield from judge(occasion, listing, page, sent)
        self._learn(listing, page)

    def _cursor(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        """Judge that a cursor which no page named is refused, if the description of the parameter says so."""
        cursor = listing.cursor
        if cursor is not None and _NO_CURSOR.search(sent.get(cursor.name, "")) and _REFUSED.search(cursor.says):
            expected = f"status 4xx for a {cursor.name} that no page has named, by its description"
            found, cause = f"a list with {len(page.items)} items", f"{listing.operation.label} {cursor.name} unknown"
            id_ = "description/invalid-refused"
            yield occasion.case(id_, False, expected, found, cause=cause, doubt=SENTENCE)  # noqa: FBT003

    def _learn(self, listing: Listing, page: Page) -> None:
        names = {*listing.filters, *(sorting.member for sorting in listing.sortings.values())}
        names |= {bound.member for bound in listing.bounds} | listing.includes.keys()
        if len(self._seen) < _REMEMBERED:
            for identity, item in zip(page.identities, page.items, strict=True):
                own = members_of(item)
                self._seen.update(hash((listing.operation.label, identity, name, str(own.get(name)))) for name in names)

    def _known_values(self, listing: Listing, page: Page, name: str) -> Iterator[Any]:
        """Yield a member's value for each item in which it is known from before."""
        for identity, item in zip(page.identities, page.items, strict=True):
            value = members_of(item).get(name)
            if value is not None and hash((listing.operation.label, identity, name, str(value))) in self._seen:
                yield value

    def _known(self, listing: Listing, page: Page, name: str, value: Any) -> list[str]:
        """Return the items in which a member is known from before to have a value, which may be null."""
        own = {one: members_of(item) for one, item in zip(page.identities, page.items, strict=True)}
        there = [one for one, item in own.items() if name in item and item[name] is value]
        return [one for one in there if hash((listing.operation.label, one, name, str(value))) in self._seen]

    def _cuts(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        """Judge that a list with a limit is full if it leaves items out and no parameter or link leads to them."""
        most, count, places = listing.most(sent), len(page.items), (listing.offset, listing.page, listing.cursor)
        if listing.limit is None or most <= 0 or page.goes_on or any(places):
            return
        key = listing.operation.label, frozenset(pair for pair in sent.items() if pair[0] != listing.limit.name)
        longest, few = self._longest[key], self._cut[key]
        if count < min(most, longest):
            expected = f"{min(most, longest)} of {longest} items, as no parameter leads to the rest"
            found, cause = f"{count} items", f"{listing.operation.label} cut"
            few[most] = occasion.case("description/list-limit", False, expected, found, cause=cause)  # noqa: FBT003
        elif count == longest and len(few) > 1:
            # The list is as long as before, and two limits have shortened it too much.
            yield from few.values()
            few.clear()

    def _limit(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        """Judge that there are no more items than the parameter allows; 0 may mean all.

        A device may raise a limit to its least one, or to a step. It then shows as many items for the raised limit.
        """
        most, count = listing.most(sent), len(page.items)
        if listing.limit is None:
            return
        cause = listing.operation.label
        key = cause, frozenset(pair for pair in sent.items() if pair[0] != listing.limit.name)
        longest, self._longest[key] = self._longest[key], max(self._longest[key], count)
        if most <= 0:
            return
        waiting, is_sent = self._raised[key], listing.limit.name in sent
        by = "asks for" if is_sent else "has as its default"
        expected = f"at most {most} items, which the parameter {listing.limit.name} {by}"
        case = occasion.case("description/list-limit", count <= most, expected, f"{count} items", cause=cause)
        yield from waiting.pop(most, []) if is_sent and count > most else ()
        if is_sent and count == most:
            waiting.pop(most, None)
        is_cut = page.goes_on or max([longest, *page.totals.values()]) > count
        total, short = max(page.totals.values(), default=0), self._short.get(key)
        places = [one.name for one in (listing.offset, listing.page, listing.cursor) if one is not None]
        if not is_sent and sent.keys().isdisjoint(places) and count < most and total > count:
            expected = f"{min(most, total)} of {total} items, by the default of {listing.limit.name}"
            if short is not None and short[:2] == (count, total) and short[3]:
                # The list is as short as before a longer one: it has not grown by itself.
                yield self._short.pop(key)[2]
                return
            case = occasion.case("description/list-limit", False, expected, f"{count} items", cause=cause)  # noqa: FBT003
            self._short[key] = count, total, case, False
        elif is_sent and short is not None and short[0] < count <= most <= listing.most({}) and total == short[1]:
            self._short[key] = (*short[:3], True)
            return
        # A device that raises a limit does so on the first page too.
        is_first = sent.keys().isdisjoint(places)
        self._kept[cause] |= {most} if is_sent and is_first and is_cut and count == most else set()
        self._shrinking |= {cause} if is_first and count < min(most, longest) else set()
        if not case.holds and most in self._kept[cause] and cause not in self._shrinking:
            yield case
            return
        if is_sent and not is_cut and count <= _LEAST:
            case = replace(case, doubt="it may raise the limit to its least one")
        if case.holds or not (is_sent and is_cut):
            yield from [case] if key not in self._short or is_sent else ()
        else:
            waiting.setdefault(count, []).append(case)

    def _filters(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        for name, parameter in listing.filters.items():
            text = sent.get(parameter.name)
            if not text or text.lower() in _ALL or parameter.media_type:
                continue
            asked = text.split(",") if "array" in kinds_of(parameter.schema) else [text]
            values = list(self._known_values(listing, page, name))
            wrong = self._wrong(listing, name, asked, values)
            doubt = ""
            if not wrong and says_whole(parameter):
                wrong, doubt = [one for one in values if isinstance(one, str) and not _holds(one, asked)][:1], SENTENCE
            if not wrong and _choices(parameter) and self._known(listing, page, name, None):
                wrong, doubt = ["null"], "what has no value may belong to each"
            if wrong is None:
                continue
            expected = f"items with {text}, which the parameter {parameter.name} asks for"
            found, cause = f"an item with {', '.join(wrong)}", f"{listing.operation.label} {parameter.name}"
            yield occasion.case("description/list-filter", not wrong, expected, found, cause=cause, doubt=doubt)

    def _includes(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        """Judge that a list has no items of a kind that a parameter such as `include_archived` would add."""
        for name, parameter in listing.includes.items():
            text = sent.get(parameter.name, text_of(flat(parameter.schema).get("default")))
            if text.lower() == "false" and name not in {plain_name(other) for other in sent}:
                is_there = bool(self._known(listing, page, name, True))  # noqa: FBT003 - a value
                expected, found = f"items that are not {name}, because {parameter.name} is false", f"one that is {name}"
                cause = f"{listing.operation.label} {parameter.name}"
                yield occasion.case("description/list-filter", not is_there, expected, found, cause=cause)

    def _bounds(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        """Judge bounds of members; an undescribed parameter is one if earlier lists show its effect."""
        for bound in listing.bounds:
            name = bound.parameter.name
            text, values = sent.get(name), list(self._known_values(listing, page, bound.member))
            if not text:
                continue
            if "enum" in flat(bound.parameter.schema):
                yield from self._levels(occasion, listing, page, sent, bound)
                continue
            counts, is_sure = self._counts[listing.operation.label, name], bound.is_said
            if len(sent) == 1 and (rank := bound.rank(text)) is not None and len(counts) < _COMPARED:
                counts[rank] = len(page.items)
                steps = [count for _, count in sorted(counts.items(), reverse=bound.is_least)]
                is_sure |= steps == sorted(steps) and len(set(steps)) > 1
            if is_sure and values:
                wrong = [value for value in values if bound.excludes(text, value)]
                side = ("more than " if bound.is_least else "less than ") if bound.is_strict else ""
                side = side or ("at least" if bound.is_least else "at most")
                expected = f"items with {bound.member} {side} {text}, which the parameter {name} asks for"
                found = f"an item with {text_of(wrong[0])}" if wrong else ""
                cause = f"{listing.operation.label} {name}"
                doubt = "" if bound.is_said else f"no description says what {name} means"
                yield occasion.case("description/list-filter", not wrong, expected, found, cause=cause, doubt=doubt)

    def _levels(
        self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str], bound: Bound
    ) -> Iterator[Case]:
        """Judge a list from a level on by that from another level: in any order, one has the items of both."""
        name, label = bound.parameter.name, listing.operation.label
        text, shown = sent[name], self._shown[label, name]
        limit = {listing.limit.name} if listing.limit is not None else set()
        if sent.keys() - limit != {name} or is_cut(listing, page, sent):
            return
        shown[text] = {text_of(members_of(item).get(bound.member)) for item in page.items}
        for other, values in shown.items():
            if other == text or text not in shown[text] or other not in values:
                continue
            wrong = other not in shown[text] and text not in values
            self._apart[label, name] += wrong
            if not wrong or self._apart[label, name] >= _SEEN:
                expected = f"an item with {other} for {name}={text}, or one with {text} for {name}={other}"
                found, cause = f"only items with {text}", f"{label} {name}"
                doubt = "" if bound.is_said else f"no description says what {name} means"
                yield occasion.case("description/list-filter", not wrong, expected, found, cause=cause, doubt=doubt)

    def _search(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        """Judge a search in members that the description names: items that contain the text, and no others."""
        search, label = listing.search, listing.operation.label
        if search is None:
            return
        items = {one: members_of(item) for one, item in zip(page.identities, page.items, strict=True)}
        text, cause = sent.get(search.name, ""), f"{label} {search.name}"
        # A device may leave out spaces around what is sought.
        if text.strip() and sent.keys() == {search.name}:
            names, id_ = " or ".join(listing.searched), "description/list-filter"
            fold = str if CASED.search(search.says) else str.casefold
            other = [one for one, item in items.items() if not _contains(listing, item, text, fold)]
            expected = f"items with {text} in {names}, by the description of {search.name}"
            found, doubt = f"the item {''.join(other[:1])}", "a search may find similar words too"
            yield occasion.case(id_, not other, expected, found, cause=cause, doubt=doubt)

    def _misses(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        """Judge that a filter or search returns each matching item that the whole list has before and after."""
        items = {one: members_of(item) for one, item in zip(page.identities, page.items, strict=True)}
        path, count = occasion.context.target.partition("?")[0], len(items)
        if is_cut(listing, page, sent):
            return
        sent = {one: text for one, text in sent.items() if listing.limit is None or one != listing.limit.name}
        if not sent:
            waiting = self._missed.pop(path, ())
            yield from (case for one, is_asked, case in waiting if one in items and is_asked(items[one]))
            self._whole[path] = items
            return
        (name, text), *others = sent.items()
        asks = None if others or not text or text.lower() in _ALL else _asking(listing, name, text)
        there = self._whole[path] if asks is not None and len(self._missed[path]) < _COMPARED else {}
        for one in [one for one, item in there.items() if one not in items and asks is not None and asks(item)][:1]:
            expected, cause = f"the item {one}, which has {text}", f"{listing.operation.label} {name}"
            found = f"{count} items without it"
            case = occasion.case("description/list-filter", False, expected, found, cause=cause)  # noqa: FBT003
            if asks is not None:
                self._missed[path].append((one, asks, case))

    def _wrong(self, listing: Listing, name: str, asked: list[str], values: list[Any]) -> list[str] | None:
        """Return an item's value that the filter excludes; empty if there is none; None if unknown."""
        parameter, member = listing.filters[name], flat(listing.members[name])
        choices = _choices(parameter)
        others = [text for value in values for text in [_text(value)] if not _holds(value, asked)]
        if kinds_of(parameter.schema) == {"boolean"}:
            default = flat(parameter.schema).get("default")
            includes = name in _INCLUDING and asked == ["true"]
            is_plain = kinds_of(member) == {"boolean"} and not includes and asked != [text_of(default)]
            return others[:1] if is_plain and values else None
        items = flat(member["items"]) if isinstance(member.get("items"), dict) else member
        if choices and set(asked) <= set(map(text_of, items.get("enum", ()))):
            if name in LEVELS and len(asked) == 1 and "exact" not in parameter.says.lower():
                ranks = [choices.index(other) - choices.index(asked[0]) for other in others if other in choices]
                return others[:1] if min(ranks, default=0) < 0 < max(ranks, default=0) else []
            return others[:1] if values else None
        # A filter for a part of a text can only be judged in pairs: it is broken if the list for A has an item of B,
        # and the list for B one of A.
        found = self._others[listing.operation.label, name]
        if len(asked) != 1 or not values or len(found) > _ASKED:
            return None
        found[asked[0]].update(others[:_COMPARED])
        return [other for other in others if asked[0] in found.get(other, ())][:1]

    def _order(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        sort = listing.sort
        if sort is None or listing.reverses:
            return
        default = flat(sort.schema).get("default", "") if sent.keys() <= listing.known_names else ""
        text = sent.get(sort.name, str(default))
        sorting = listing.sortings.get(text.split(",")[0])
        if sorting is None:
            return
        schema, descending = flat(listing.members[sorting.member]), sorting.descending
        if listing.direction is not None:
            given = sent.get(listing.direction.name) or flat(listing.direction.schema).get("default")
            if descending is not None and given:
                return
            descending = str(given).lower().startswith("desc") if given else descending
        if "enum" in schema or schema.get("format") == "duration":
            return  # such values may be sorted by meaning
        values = list(self._known_values(listing, page, sorting.member))[:_COMPARED]
        pairs = [(one, other, is_before(one, other)) for one, other in combinations(values, 2)]
        up, down = ([(one, other) for one, other, said in pairs if said is way] for way in (True, False))
        if not up and not down:
            return
        wrong = {True: up, False: down, None: up and down}[descending]
        if wrong and _comes_first(page, sorting.member, descending):
            return
        way = {True: "descending ", False: "ascending ", None: ""}[descending]
        yield occasion.case(
            "description/list-order",
            not wrong,
            f"items in {way}order by {text}, which the parameter {sort.name} asks for",
            f"{text_of(wrong[0][0])} before {text_of(wrong[0][1])}" if wrong else "",
            cause=f"{listing.operation.label} {sorting.member}",
        )


def is_cut(listing: Listing, page: Page, sent: Mapping[str, str]) -> bool:
    """Return whether a list may have more items than the response shows."""
    count = len(page.items)
    total = max(page.totals.values(), default=0)
    is_said = page.goes_on or total > count or 0 < listing.most(sent) <= count
    return is_said or (total != count and count >= _LEAST and count % _ROUND == 0)


# Phrases in a description of a list: for items in groups, for the member by which it is in order, for a filter by the
# whole value of a member, and for one by a part of it.
_GROUPED: Final = re.compile(r"\b(?:first|groups?|each)\b", re.IGNORECASE)
_BY: Final = re.compile(r"\b(?:ordered|sorted|in (?:the )?order) (?:by|of) (?:their |its )?`?(\w+)", re.IGNORECASE)
_WHOLE: Final = re.compile(
    r"\b(?:of|with|in|from|by|for|at|on) (?:this|that|the (?:given|same))\b|\bexact|\bequal", re.IGNORECASE
)
_PART: Final = re.compile(r"\b(?:part|prefix|like|similar|begin\w*|start\w*|match\w*|contain\w*|wildcard\w*|below)\b")


def says_whole(parameter: Parameter) -> bool:
    """Return whether a filter chooses items by the whole value of a member, by its description."""
    return bool(_WHOLE.search(parameter.says)) and not _PART.search(parameter.says.lower())


def _said_order(occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
    """Judge the order that the description of a list promises: by a member, or by the only time in all items."""
    text = listing.operation.text
    said, by = IN_TIME.search(text), _BY.search(text)
    found = said or by
    member, descending = _time_member(listing) if said is not None else "", said is not None and said[1] is not None
    # "Pinned notes first, in both groups the newest first": the newest of all need not come first.
    if said is not None and _GROUPED.search(text[: said.start()].rpartition(".")[2]):
        return
    if said is None and by is not None and "enum" not in flat(listing.members.get(plain_name(by[1]), {"enum": ()})):
        member = plain_name(by[1])
    is_sorted = listing.direction is not None or (listing.sort is not None and listing.sort.name in sent)
    if found is None or not member or is_sorted:
        return
    values = [members_of(item).get(member) for item in page.items[:_COMPARED]]
    pairs = [(one, other, is_before(one, other)) for one, other in combinations(values, 2)]
    # Without a direction, the order may be descending.
    is_open = said is None and not any(before for _, _, before in pairs)
    wrong = [(one, other) for one, other, before in pairs if before is descending and not is_open]
    if any(before is not None for _, _, before in pairs) and not _comes_first(page, member, said and descending):
        expected = f"items {found[0].lower()}, by the description of the list"
        other = f"{text_of(wrong[0][0])} before {text_of(wrong[0][1])} as {member}" if wrong else ""
        cause = f"{listing.operation.label} {member} said"
        yield occasion.case("description/list-order", not wrong, expected, other, cause=cause, doubt=SENTENCE)


def _time_member(listing: Listing) -> str:
    """Return the member with the time of an item, or an empty text."""
    dated = [name for name, one in listing.members.items() if flat(one).get("format") == "date-time"]
    made = [name for name in dated if plain_name(name).startswith("created")] or (dated if len(dated) == 1 else [])
    return next(iter(made), "")


def _asking(listing: Listing, parameter: str, text: str) -> Callable[[Mapping[str, Any]], bool] | None:
    """Return a function: does an item match a filter parameter's text? None if the parameter's meaning is unknown."""
    if listing.search is not None and listing.search.name == parameter and text.strip():
        return lambda item: _contains(listing, item, text)
    for name, given in listing.filters.items():
        if given.name == parameter and not given.media_type:
            asked = text.split(",") if "array" in kinds_of(given.schema) else [text]
            return lambda item: isinstance(item.get(name), str | int) and _text(item[name]) in asked
    bound = next((one for one in listing.bounds if one.is_said and one.parameter.name == parameter), None)
    return None if bound is None else lambda item: bound.includes(text, item.get(bound.member))


def _contains(listing: Listing, item: Mapping[str, Any] | None, term: str, fold: Callable[[str], str] = str) -> bool:
    """Return whether an item has a term in one of the members that a search looks at."""
    values = [(item or {}).get(name) for name in listing.searched]
    folds = str.casefold if listing.search is not None and CASELESS.search(listing.search.says) else fold
    return any(isinstance(value, str) and folds(term) in folds(value) for value in values)


def _links(occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
    """Judge whether links lead to the pages that their relations name, with the same filters (RFC 8288 3.3)."""
    here, begins = _place(listing, sent), {0} if listing.page is None else {0, 1}
    chosen = {one.name for one in (*listing.filters.values(), listing.sort) if one is not None}
    for relation, text in _linked(occasion.response, page):
        target = listing.query_texts(text)
        if target is None or not page.items:
            continue
        there, wrong = _place(listing, target), ""
        if relation == "next" and target == sent:
            wrong = "the same page"
        elif listing.cursor is not None and listing.cursor.name in target:
            continue  # a cursor may contain all of it
        elif relation in {"next", "prev"} and (
            lost := sorted(name for name in chosen & sent.keys() if sent[name] != target.get(name))
        ):
            wrong = f"a page without the {lost[0]} of this one"
        elif here is not None and there is not None:
            steps = {1} if listing.page is not None else {len(page.items), listing.most(sent)}
            # Without a limit, a page's size is the device's own, and it may leave out some items.
            is_far = listing.page is None and not listing.most(sent) and there - here > max(steps)
            holds = {
                "next": there - here in steps or is_far,
                "prev": there < here or there in begins,
                "first": there in begins,
                "last": there > here or not page.goes_on,
            }
            wrong = "" if holds[relation] else f"{there} from {here}"
        expected, cause = f"a link to the {relation} page", f"{listing.operation.label} {relation}"
        yield occasion.case("description/list-pages", not wrong, expected, f"{text}, {wrong}", cause=cause)


def _place(listing: Listing, sent: Mapping[str, str]) -> int | None:
    """Return the number of a page, or of its first item; None if the description does not define it."""
    where = listing.page or listing.offset
    if where is None or where.name in sent:
        return None if where is None else number_of(sent[where.name])
    default = flat(where.schema).get("default", 0 if where is listing.offset else None)
    return default if isinstance(default, int) else None


def _linked(response: Response, page: Page) -> Iterator[tuple[str, str]]:
    """Yield relations and targets of links to pages: in the field Link (RFC 8288), and in members around a list."""
    for link in _LINK.finditer(response.header("link") or ""):
        yield from ((_RELATIONS[name], link[1]) for name in link[2].lower().split() if name in _RELATIONS)
    for around in page.around:
        inner = [item for item in around.values() if isinstance(item, dict)]
        for name, one in [pair for part in (around, *inner) for pair in part.items()]:
            target = one.get("href") if isinstance(one, dict) else one
            if plain_name(name) in _RELATIONS and isinstance(target, str) and "?" in target:
                yield _RELATIONS[plain_name(name)], target


def _comes_first(page: Page, member: str, descending: bool | None) -> bool:  # noqa: FBT001 - None: either
    """Return whether items of one kind stand before all others, such as pinned ones or folders, each kind sorted."""
    items = [members_of(item) for item in page.items[:_COMPARED]]
    for name in {name for item in items[:1] for name, value in item.items() if isinstance(value, bool | str)}:
        kinds = [str(item.get(name)) for item in items]
        parts = [[one for one, kind in zip(items, kinds, strict=True) if kind == of] for of in dict.fromkeys(kinds)]
        is_grouped = len(parts) == _KINDS and kinds == sorted(kinds, key=kinds.index)
        pairs = (pair for part in parts if is_grouped for pair in combinations(part, 2))
        ways = {is_before(one.get(member), other.get(member)) for one, other in pairs} - {None}
        if len(ways) == 1 and descending not in ways:
            return True
    return False


def _choices(parameter: Parameter) -> list[str]:
    """Return the declared values of a parameter, or of the items of its list, as texts."""
    schema = flat(parameter.schema)
    schema = flat(schema["items"]) if isinstance(schema.get("items"), dict) else schema
    return [text_of(item) for item in schema.get("enum", ()) if item is not None]


def _text(value: Any) -> str:
    return ", ".join(map(text_of, value)) if isinstance(value, list) else text_of(value)


def _holds(value: Any, asked: list[str]) -> bool:
    """Return whether a member equals or contains one of the requested values, ignoring case."""
    wanted = {text.strip().casefold() for text in asked}
    own = value if isinstance(value, list) else [value]
    return any(isinstance(item, dict | list) or text_of(item).casefold() in wanted for item in own)


# Texts that may be sorted by meaning: numbers with units, durations, addresses, levels, days and months.
_MEANING: Final = re.compile(
    r"[\d+\-.].*|P[\dT].*|(?:off|none|low|minor|medium|moderate|high|major|severe|critical|urgent|fatal|emergency|trace"
    r"|debug|info|notice|warn|warning|error|alert|ok|good|bad|small|large|[sml]|x+[sl]"
    r"|(?:mon|tues?|wed(?:nes)?|thu(?:rs)?|fri|sat(?:ur)?|sun)(?:day)?|(?:jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)[a-z]*)",
    re.IGNORECASE | re.DOTALL,
)


def is_before(one: Any, other: Any) -> bool | None:
    """Return whether a value is less than another one; None if equal, or if that depends on the collation.

    Numbers and times are compared by value, and texts only where all collations agree.
    """
    if is_number(one) and is_number(other):
        return None if one == other else bool(one < other)
    if not (isinstance(one, str) and isinstance(other, str)) or one == other:
        return None
    first, second = _instant(one), _instant(other)
    if first is not None and second is not None:
        is_comparable = (first.tzinfo is None) == (second.tzinfo is None) and first != second
        return first < second if is_comparable else None
    if not (one.isascii() and other.isascii()) or _MEANING.fullmatch(one) or _MEANING.fullmatch(other):
        return None
    said = {key(one) < key(other) for key in _KEYS} | {not key(other) < key(one) for key in _KEYS}
    return said.pop() if len(said) == 1 else None


def is_mixed(values: Sequence[Any]) -> bool:
    """Return whether values are in no order, so that sorting them shows."""
    return {is_before(one, other) for one, other in pairwise(values)} >= {True, False}


def _natural(text: str) -> list[tuple[int, int, str]]:
    parts = [part.lstrip("0") or "0" if part.isdecimal() else part for part in re.findall(r"\d+|\D+", text.casefold())]
    # The longer number is the larger one; it may have more digits than int takes.
    return [(0, len(part), part) if part.isdecimal() else (1, 0, part) for part in parts]


def _without_punctuation(text: str) -> str:
    return "".join(one for one in text.casefold() if one.isalnum())


def _punctuation_first(text: str) -> str:
    return "".join(one if one.isalnum() else "\x00" for one in text.casefold())


_KEYS: Final[tuple[Callable[[str], Any], ...]] = (str, str.casefold, _natural, _without_punctuation, _punctuation_first)


def _instant(text: str) -> datetime | None:
    try:
        return datetime.fromisoformat(text) if re.match(r"\d{4}-\d\d", text) else None
    except ValueError:
        return None
