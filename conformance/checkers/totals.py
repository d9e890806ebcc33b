"""Totals of lists: the number of items that a response names agrees with the items that it shows.

So do numbers of a thing with the items of a list below it.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from conformance.api.rest.listing import COUNTS, TOTALS, Listing, Page, listing_of, members_of, number_of, page_of
from conformance.api.rest.references import singular
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import collection_of, parts_of
from conformance.checkers.occasion import SETTLES_S, Occasion
from conformance.contract.pack import Contract
from conformance.documents.json_schema import is_number, kinds_of
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.verdict.evidence import Case

# Reads in which a total must be wrong.
_OFTEN: Final = 2
_CUTS: Final = (5, 16)  # servers cut lists silently at a multiple of one of these
_FEWEST_CUT: Final = 10, 20  # fewest items of a cut list: with and without parameters
# Combinations of filters that are remembered.
_MOST: Final = 1000
# Phrases in a description which say that a total counts the filtered items.
_FILTERED: Final = re.compile(
    r"^(?!.*\b(?:ignor\w*|regardless of|whatever|independent\w* of)\W+(?:\w+\W+){0,2}filter)"
    r"(?!.*\bfilter\w*\W+(?:\w+\W+){0,3}ignored).*\b(?:filter|match)",
    re.IGNORECASE | re.DOTALL,
)
# Phrases in a description which say that a total counts the items of all pages.
_OF_ALL: Final = re.compile(
    r"\b(?:all (?:the )?pages|whole (?:list|collection)"
    r"|(?:whatever|regardless of|before|across) (?:the |any )?(?:pag|limit))",
    re.IGNORECASE,
)
_CAP: Final = 50


@dataclass(frozen=True)
class _Part:
    """A part of a list in a response.

    Attributes:
        occasion: the exchange.
        page: what it shows.
        names: the parameters of its request.
        offset: how many items are before it.
        told: the totals that count the filtered items, by the description.
        whole: whether it goes to the end.
        sure: whether it does so for certain: no server has cut it at a bound of its own.
    """

    occasion: Occasion
    page: Page
    names: frozenset[str]
    offset: int
    told: Collection[str]
    whole: bool
    sure: bool

    @property
    def least(self) -> int:
        """How many items there are at least."""
        return self.offset + len(self.page.items)


@dataclass
class _Count:
    """The history of one total of one operation with one choice of filters.

    Attributes:
        agrees: whether it was the number of items the first time that a whole list was shown; None if none was.
        is_of_all: whether it was more than the items on a page, so that it is not the number of those.
        all: the number of items when it agreed last.
        all_s: when that was.
        last: what identified the items of the last whole list that it agreed with.
        wrong_since_s: by the names of the parameters, when it was wrong first since such a list agreed with it.
        times: how often it was wrong while nothing changed.
        sizes: the totals that were the number of items on a page, and not of the list.
        other: the parts of the list, since it agreed last, that tell another total, and that.
    """

    agrees: bool | None = None
    is_of_all: bool = False
    all: int = 0
    all_s: float = float("-inf")
    last: frozenset[str] = frozenset()
    wrong_since_s: dict[frozenset[str], float] = field(default_factory=dict)
    times: int = 0
    sizes: set[int] = field(default_factory=set)
    other: list[tuple[_Part, int]] = field(default_factory=list)

    def learn(self, total: int, part: _Part) -> None:
        """Record what a total counts, at the end of a list; for a list that may be cut, only if both are equal."""
        agrees = total == part.least
        if self.agrees is None and (part.sure or agrees):
            self.agrees = agrees
        if agrees:
            self.all, self.all_s = total, part.occasion.response.received_s

    def is_sure(self, part: _Part, changed_s: float) -> bool:
        """Note a wrong total; return whether no change that is under way explains it."""
        now_s, shown = part.occasion.response.received_s, frozenset(part.page.identities)
        since_s = self.wrong_since_s.setdefault(part.names, now_s)
        is_same = shown == self.last if part.whole and not part.offset else shown <= self.last
        is_quiet = now_s - changed_s >= SETTLES_S
        self.times += is_same and is_quiet
        return is_quiet and (self.times >= _OFTEN or now_s - since_s >= SETTLES_S)

    def agree(self, page: Page, changed_s: float) -> list[tuple[Occasion, int]]:
        """Record the list that a total agrees with; return earlier parts of the list that had another total.

        One that is late after a change is not the number of items that a part shows.
        """
        before, self.last = self.last, frozenset(page.identities)
        other, self.other = self.other if self.last == before else [], []
        quiet_s = changed_s + SETTLES_S
        return [
            (part.occasion, total)
            for part, total in other
            if total == len(part.page.items) or part.occasion.response.received_s >= quiet_s
        ]


class Totals:
    """Judges totals over a run. Each must keep the meaning that it had when the whole list was first read."""

    def __init__(self) -> None:
        self._counts: dict[tuple[str, str, frozenset[tuple[str, str]]], _Count] = defaultdict(_Count)
        self._longest: dict[str, int] = defaultdict(int)
        # The total in the whole list, and parts of the list with another total, by path, total and filters.
        self._told: dict[tuple[str, str, frozenset[tuple[str, str]]], int] = {}
        self._apart: dict[tuple[str, str, frozenset[tuple[str, str]]], list[Case]] = defaultdict(list)
        self._changed_s = float("-inf")

    def note_change(self, when_s: float) -> None:
        """Note a request that may have changed a list."""
        self._changed_s = when_s
        self._told.clear()
        self._apart.clear()

    def __call__(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        """Yield the cases of one response; none if the parameters do not show which part of the list it contains."""
        label, shown = listing.operation.label, len(page.items)
        self._longest[label] = max(self._longest[label], shown)
        elsewhere = {parameter.name for parameter in (listing.page, listing.cursor) if parameter is not None}
        if not sent.keys() <= listing.known_names - elsewhere:
            return
        texts = {
            parameter.name: sent[parameter.name]
            for parameter in (listing.limit, listing.offset)
            if parameter and parameter.name in sent
        }
        if any(number_of(text) == 0 and text != "0" for text in texts.values()):
            return
        offset = number_of(sent.get(listing.offset.name, "")) if listing.offset is not None else 0
        chosen = frozenset((name, text) for name, text in sent.items() if name in listing.selecting)
        most = listing.most(sent)
        # A limit of 0 may ask for no items, or for all.
        is_open = listing.limit is None or listing.limit.name not in sent
        is_beyond = shown == 0 and offset > 0
        whole = not page.goes_on and (shown < most or (is_open and not most)) and not is_beyond
        sure = whole and not self._is_cut(listing, shown)
        told = says_filtered(listing)
        part = _Part(occasion, page, frozenset(sent), offset, told, whole=whole, sure=sure)
        for name, total in page.totals.items():
            yield from self._of_all_pages(listing, part, name, chosen, total)
            every = self._counts[label, name, frozenset()]
            count = self._counts[label, name, chosen] if len(self._counts) < _MOST else every
            every.is_of_all |= total > shown > 0
            count.is_of_all |= every.is_of_all
            if chosen and whole and count.agrees is None and name in told:
                count.agrees = True
            # A filter that keeps all items does not show whether the total counts the filtered ones.
            if whole and shown and (not chosen or part.least < every.all):
                count.learn(total, part)
            if count.agrees and (count is not every or not chosen):
                yield from self._judge_total(count, every, part, name, total)

    def _of_all_pages(
        self, listing: Listing, part: _Part, name: str, chosen: frozenset[tuple[str, str]], total: int
    ) -> Iterator[Case]:
        """Judge a total of all pages (the description says so) by two reads of the whole list, before and after."""
        paging = {one.name for one in (listing.limit, listing.offset) if one is not None}
        names, path = {text for text, _ in chosen}, part.occasion.context.target.partition("?")[0]
        if not (_OF_ALL.search(listing.says.get(name, "")) and part.names <= names | paging):
            return
        key = path, name, chosen
        if part.names == names:
            apart, before = self._apart.pop(key, []), self._told.get(key)
            yield from apart if before == total else ()
            self._told[key] = total
        elif self._told.get(key, total) != total:
            expected = f"{self._told[key]} as {name}, whatever the page, by its description"
            self._apart[key].append(_case(part.occasion, name, f"{total} as {name}", expected, holds=False))

    def _judge_total(self, count: _Count, every: _Count, part: _Part, name: str, total: int) -> Iterator[Case]:
        """Yield the cases of a total whose meaning is known; every: that of the list without filters."""
        shown, least = len(part.page.items), part.least
        is_of_page = plain_name(name) in COUNTS and not count.is_of_all and total >= shown
        if part.whole and total == least:
            count.wrong_since_s.pop(part.names, None)
            other = count.agree(part.page, self._changed_s) if not part.offset else []
            every.times += len(other)
            for one, told in other if every.times >= _OFTEN else ():
                expected = f"{total} as {name}, as the whole list tells before and after"
                yield _case(one, name, f"{told} as {name}", expected, holds=False)
            yield _case(part.occasion, name, "", "the number of items that are shown", holds=True)
        elif is_of_page:
            return
        elif (shown and total < least and (total <= 0 or total % _CAP)) or (part.sure and total != least):
            if count.is_sure(part, self._changed_s):
                number = f"{'' if part.sure else 'at least '}{least}"
                expected = f"{number} as {name}, by the offset and the items that are shown"
                yield _case(part.occasion, name, f"{total} as {name}", expected, holds=False)
        elif not part.whole and shown and total != count.all:
            if count.is_of_all:
                count.other.append((part, total))
            # Nothing changed since the whole list was read, but a list that shrinks by itself may once have had that
            # size.
            elif plain_name(name) in TOTALS and total == shown < count.all and count.all_s > self._changed_s:
                count.sizes.add(total)
                if len(count.sizes) >= _OFTEN or name in part.told:
                    expected = f"{count.all} as {name}, as the whole list tells"
                    yield _case(part.occasion, name, f"{total} as {name}", expected, holds=False)

    def _is_cut(self, listing: Listing, shown: int) -> bool:
        """Return whether a server may have cut a list at its own bound: a round number that no list exceeded."""
        is_round = shown % _CUTS[0] == 0 or shown % _CUTS[1] == 0
        has_parts = not all(
            parameter is None for parameter in (listing.limit, listing.offset, listing.page, listing.cursor)
        )
        longest = self._longest[listing.operation.label]
        return is_round and shown >= max(_FEWEST_CUT[not has_parts], longest)


class Places:
    """Judges members beside a list that are named as its paging parameters: each names what the device applied."""

    def __init__(self) -> None:
        # The place that was sent, and the items, by operation, member, its value and the other parameters.
        self._shown: dict[object, tuple[str, tuple[str, ...]]] = {}
        self._less: dict[str, set[int]] = defaultdict(set)

    def clear(self) -> None:
        """Forget all pages: the list may have changed."""
        self._shown.clear()

    def __call__(self, occasion: Occasion, listing: Listing, page: Page, sent: Mapping[str, str]) -> Iterator[Case]:
        """Yield the cases of one page. A device may apply another limit or place than the request has, and say so."""
        label, count, total = listing.operation.label, len(page.items), max(page.totals.values(), default=0)
        around = {plain_name(name): one for part in page.around for name, one in part.items() if type(one) is int}
        for parameter in (listing.offset, listing.page):
            told = around.get(plain_name(parameter.name)) if parameter is not None else None
            if parameter is None or told is None or not count or parameter.name not in sent:
                continue
            place, rest = sent[parameter.name], frozenset(pair for pair in sent.items() if pair[0] != parameter.name)
            other, items = self._shown.setdefault((label, parameter.name, told, rest), (place, page.identities))
            is_twice = other != place and items != page.identities
            expected = f"another {parameter.name} than that of the page with {parameter.name}={other}"
            found, cause = f"{told} as {parameter.name}, with other items", f"{label} {parameter.name} told"
            yield occasion.case("description/list-pages", not is_twice, expected, found, cause=cause)
        told = around.get(plain_name(listing.limit.name)) if listing.limit is not None else None
        if listing.limit is None or told is None or not count:
            return
        most, before = listing.most(sent), number_of(sent.get(listing.offset.name, "")) if listing.offset else 0
        # The page is full, and less than the member says, although there is more.
        is_less = count == most < told and before + count < total
        self._less[label] |= {most} if is_less else set()
        if not is_less or len(self._less[label]) >= _OFTEN:
            expected = f"{most} as {listing.limit.name}, as many items as the page has of {total}"
            cause = f"{label} {listing.limit.name} told"
            yield occasion.case(
                "description/list-pages", not is_less, expected, f"{told} as {listing.limit.name}", cause=cause
            )


# Phrases in a description of a sum, and of things that a write leaves as they are.
_SUM: Final = re.compile(r"\b(?:sum|total) of (?:all |the |their )*(\w+)", re.IGNORECASE)
_COUNTED: Final = re.compile(r"\b(?:how many|number of)\b", re.IGNORECASE)
_STAY: Final = re.compile(
    r"\b(?:stays?|remains?|(?:is|are) (?:kept|unchanged|untouched|not (?:changed|touched)))\b", re.IGNORECASE
)


def numbers_of(above: Operation, lister: Operation, *, is_beside: bool = False) -> dict[str, str]:
    """Return the members of a thing that a list below it must confirm: a count of items, or the sum of a member.

    By the number's name: the member that is added up; empty for the number of items. Of a thing beside the list, only
    those that are the number of all its items.
    """
    things, listing = lister.template.rstrip("/").rpartition("/")[2].lower(), listing_of(lister)
    thing, found = singular(things), dict[str, str]()
    counts = {f"{thing}count", f"{things}count", f"numberof{things}", f"num{things}", f"total{things}"}
    for name, part in parts_of(above.shape).items() if listing is not None else ():
        said = str(flat(part).get("description", "")).lower()
        if is_beside:
            of_all = re.fullmatch(rf"(?:the )?(?:how many|number of)(?: the| all)? {re.escape(things)}\W*", said)
            found |= {name: ""} if of_all else {}
            continue
        added = _SUM.search(said) if re.search(rf"\b{things}\b", said) and kinds_of(part) <= {"integer"} else None
        words = (
            [word for word in (added[1], singular(added[1])) if word in listing.members] if added and listing else []
        )
        if words or plain_name(name) in counts or re.search(rf"\b(?:how many|number of)(?: the)? {things}\b", said):
            found[name] = next(iter(words), "")
    return found


def counters_of(operations: Iterable[Operation]) -> dict[str, tuple[Operation, dict[str, str]]]:
    """Return by the path of each list the read of a resource, such as `/stats`, that contains its number of items."""
    reads = [one for one in operations if one.method == "GET" and not one.parameter("path")]
    things = [one for one in reads if listing_of(one) is None and _COUNTED.search(str(one.shape))]
    pairs = [(lister.template.rstrip("/"), one, lister) for lister in reads if listing_of(lister) for one in things]
    found = [(path, one, numbers_of(one, lister, is_beside=True)) for path, one, lister in pairs]
    return {path: (one, numbers) for path, one, numbers in found if numbers}


def numbers_by_items(numbers: dict[str, str], thing: dict[str, Any], items: Sequence[Any]) -> dict[str, float]:
    """Return the numbers of a thing that follow from the items of the list below it, if both are known."""
    found = dict[str, float]()
    for name, member in numbers.items():
        values: list[Any] = [members_of(item).get(member) if member else 1 for item in items]
        found |= {name: sum(values)} if all(map(is_number, values)) and is_number(thing.get(name)) else {}
    return found


class Sublists:
    """Judges lists below a thing: they have as many items as the thing says, and a write to the thing keeps them."""

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        reads = {one.template.rstrip("/"): one for one in operations if one.method == "GET"}
        below = {path: reads[above] for path in reads if (above := path.rpartition("/")[0]) in reads}
        # Members of the parent that a list must confirm, by path template of the list.
        self._numbers = {
            path: numbers_of(one, reads[path]) for path, one in below.items() if collection_of(one.template)
        }
        self._above = {path.rpartition("/")[0] for path, numbers in self._numbers.items() if numbers}
        # The path of a resource, such as `/stats`, that contains the number of items, by path of a list.
        counters = counters_of(operations)
        self._beside = {path: one.template.rstrip("/") for path, (one, _) in counters.items()}
        self._numbers |= {path: numbers for path, (_, numbers) in counters.items()}
        self._above |= {*self._beside.values()}
        # The path template and the page of a list, and what a thing shows, since the last change, by path.
        self._lists: dict[str, tuple[str, Page]] = {}
        self._things: dict[str, dict[str, Any]] = {}
        # The items of a list before a request that leaves them, and that, by path.
        self._before: dict[str, tuple[tuple[str, ...], str]] = {}
        # Numbers that once were right, as others may count something else.
        self._right: set[tuple[str, str]] = set()
        self._changed_s = float("-inf")

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, answer, method = occasion.operation, occasion.response, occasion.request.method
        path, template = occasion.context.target.rstrip("/"), operation.template.rstrip("/") if operation else ""
        if method not in SAFE and not refuses(answer.status, operation):
            label = f"{method} {path}"
            kept = [key for key, (template, _) in self._lists.items() if operation and is_left(operation, template)]
            self._before = {
                key: (self._lists[key][1].identities, label) for key in kept if key.rpartition("/")[0] == path
            }
            self._lists, self._things, self._changed_s = {}, {}, answer.received_s
        if operation is None or method != "GET" or not answer.ok or not occasion.context.plain:
            return
        if template in self._numbers and (page := page_of(answer, operation)) is not None:
            yield from self._list(occasion, operation, path, page)
        elif template in self._above and is_json(answer.media_type):
            self._things[path] = occasion.members(parts_of(operation.shape))
        for key, (template, page) in self._lists.items():
            there = self._beside.get(key, key.rpartition("/")[0])
            thing = self._things.get(there, {}) if path in {key, there} else {}
            doubt = "it may count only now and then" if key in self._beside else ""
            for name, number in numbers_by_items(self._numbers[template], thing, page.items).items():
                # It may be late after a change.
                holds, is_late = thing[name] == number, occasion.sent_s - self._changed_s <= SETTLES_S
                self._right |= {(template, name)} if holds else set()
                is_known = self._numbers[template][name] or (template, name) in self._right
                expected = f"{number} as {name}, by the items of {key}"
                if holds or (is_known and not is_late):
                    case = _case(occasion, name, f"{thing[name]} as {name}", expected, holds=holds)
                    yield replace(case, doubt=doubt)

    def _list(self, occasion: Occasion, operation: Operation, path: str, page: Page) -> Iterator[Case]:
        """Take a list, and judge whether it has the items that it had before the thing above it was written."""
        listing, (before, label) = listing_of(operation), self._before.pop(path, ((), ""))
        lost = [one for one in before if one not in page.identities]
        if before:
            expected = f"the {len(before)} items as before {label}, which leaves them by its description"
            cause, found = f"{operation.label} stay", f"{len(page.items)} items, without {''.join(lost[:1])}"
            yield occasion.case("description/written-is-read", not lost, expected, found, cause=cause)
        most = listing.most({}) if listing is not None else 0
        count, is_beside = len(page.items), path in self._beside
        # A server may cut a list at a round number.
        is_cut = is_beside and count >= min(_FEWEST_CUT) and count % _CUTS[0] == 0
        if not (page.goes_on or is_cut) and (not most or count < most):
            self._lists[path] = operation.template.rstrip("/"), page


def is_left(write: Operation, path: str) -> bool:
    """Return whether a list stays as it is when the thing above it is written by PUT or PATCH, by the description."""
    things = path.rpartition("/")[2].lower()
    said = [text for text in re.split(r"[.;]\s", write.text.lower()) if _STAY.search(text)]
    named = any(re.search(rf"\b(?:{things}|{singular(things)})\b", text) for text in said)
    return named and write.method in {"PUT", "PATCH"}


def says_filtered(listing: Listing) -> set[str]:
    """Return the totals that count filtered items, by the description."""
    return {name for name, text in listing.says.items() if plain_name(name) in TOTALS and _FILTERED.search(text)}


def _case(occasion: Occasion, name: str, found: str, expected: str, *, holds: bool) -> Case:
    label = occasion.operation.label if occasion.operation else ""
    return occasion.case("description/list-total", holds, expected, found, cause=f"{label} {name}")
