"""One thing in several responses: to its own GET, to that of its list, and to a write to a part of it.

A list may come from a cache, and a device may act after its response, so only what lasts longer than that counts.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import unquote

from conformance.api.rest.listing import items_of, listing_of
from conformance.api.rest.patches import same
from conformance.api.rest.references import collections_of
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import collection_of, differences, identifier_of, is_devices, is_shared, parts_of
from conformance.checkers.occasion import MOST_OCTETS, SETTLES_S, Occasion
from conformance.contract.pack import Contract
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.representation import flat
from conformance.verdict.evidence import Case

_SEEN: Final = 2  # how often a difference must appear, because another client may cause one
_MOST: Final = 1_000  # things that are remembered
# A response that a cache may keep.
_CACHED: Final = re.compile(r"\b(?:max-age|s-maxage)=[1-9]", re.IGNORECASE)


class Representations:
    """Judges the members of a thing that its GET shows by those in other responses."""

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        self._reads = {one.template.rstrip("/"): one for one in operations if one.method == "GET"}
        self._items = {collection_of(path): one for path, one in self._reads.items() if collection_of(path)}
        # Writes to a part of a thing that answer the whole thing, with the read of that.
        self._parts = {
            one.label: read
            for one in operations
            if one.method in {"PUT", "PATCH"} and (path := one.template.rstrip("/")) not in self._reads
            if (read := self._reads.get(path.rpartition("/")[0])) is not None
            if parts_of(one.shape) == parts_of(read.shape)
        }
        self._collections = collections_of(operations)
        # Members of a thing, each with the time since which every read showed it so, s of the monotonic clock, by path.
        self._now: dict[str, dict[str, tuple[Any, float]]] = {}
        self._quiet: set[str] = set()  # paths that were read since the last write
        # Lists that have shown the thing since then, with what they showed, by path.
        self._listed: dict[str, list[tuple[Occasion, dict[str, Any]]]] = defaultdict(list)
        self._moving: set[tuple[str, str]] = set()  # members that changed between two such reads
        self._alike: set[tuple[str, str]] = set()  # members that a list has shown as the thing did
        self._apart = Counter[tuple[str, str]]()
        # What the response to the last write to a part showed of what was sent, until a read shows it too, by path.
        self._told: dict[str, tuple[Occasion, dict[str, Any]]] = {}
        # Values that the next read showed too, and those that no read did, by operation and member.
        self._kept: dict[tuple[str, str], set[str]] = defaultdict(set)
        self._lost: dict[tuple[str, str], set[str]] = defaultdict(set)

    def forget(self) -> None:
        """Forget what a request of unknown effect may have changed."""
        for memory in (self._quiet, self._listed, self._told):
            memory.clear()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange, and of earlier lists that it decides."""
        operation, answer = occasion.operation, occasion.response
        path = unquote(occasion.context.target.partition("?")[0]).rstrip("/")
        template = operation.template.rstrip("/") if operation is not None else ""
        if occasion.request.method not in SAFE:
            if not refuses(answer.status, operation):
                self._take_write(occasion, path)
        elif occasion.request.method == "GET" and answer.status == HTTPStatus.OK and occasion.context.plain:
            if answer.cut or len(answer.body) > MOST_OCTETS or not is_json(answer.media_type):
                return
            if template in self._items:
                self._take_list(occasion, self._items[template], path)
            if template in self._reads and (now := occasion.members(parts_of(self._reads[template].shape))):
                yield from self._read(occasion, self._reads[template], path, now)

    def _take_write(self, occasion: Occasion, path: str) -> None:
        """Take a request that was accepted: another one may have changed what a write to a part did."""
        read = self._parts.get(occasion.operation.label) if occasion.operation is not None else None
        sent = read_json(occasion.request.body).value if len(occasion.request.body) <= MOST_OCTETS else None
        self._quiet.clear()
        self._listed.clear()
        if read is None or not (occasion.response.status == HTTPStatus.OK and isinstance(sent, dict)):
            self._told.clear()
            return
        parts = parts_of(read.shape)
        told = occasion.members(parts)
        self._told[path.rpartition("/")[0]] = (
            occasion,
            {
                name: one
                for name, one in told.items()
                if name in parts and not (is_shared(name) or is_devices(name, parts[name], self._collections))
                # The thing may have another name for it.
                if same(sent.get(name), one) or any(same(value, one) for value in sent.values() if is_telling(value))
            },
        )

    def _take_list(self, occasion: Occasion, item: Operation, path: str) -> None:
        answer = occasion.response
        if answer.header("age") or _CACHED.search(answer.header("cache-control") or ""):
            return
        for value in items_of(read_json(answer.body).value) or ():
            at = f"{path}/{identifier_of(value, item)}".casefold() if isinstance(value, dict) else ""
            now = self._now.get(at, {})
            self._alike |= {(item.template, name) for name in now if name in value and same(now[name][0], value[name])}
            if at in self._quiet:
                self._listed[at].append((occasion, value))

    def _read(self, occasion: Occasion, item: Operation, at: str, now: dict[str, Any]) -> Iterator[Case]:
        """Judge a read of a thing, and the lists between it and the read before."""
        path, template = at.casefold(), item.template
        if collection_of(template) and identifier_of(now, item) not in {"", path.rpartition("/")[2]}:
            return
        before = self._now.get(path, {})
        if path in self._quiet:
            self._moving |= {
                (template, name) for name in before if name in now and not same(before[name][0], now[name])
            }
        for listed, shown in self._listed.pop(path, ()):
            yield from self._judge_list(listed, item, before, shown, now)
        if at in self._told:
            yield from self._judge_part(occasion, item, at, now)
        if len(self._now) < _MOST or path in self._now:
            at_s = occasion.response.received_s
            kept = {name: before[name] for name, one in now.items() if name in before and same(before[name][0], one)}
            self._now[path] = {name: kept.get(name, (one, at_s)) for name, one in now.items()}
            self._quiet.add(path)

    def _judge_list(
        self,
        listed: Occasion,
        item: Operation,
        before: dict[str, tuple[Any, float]],
        shown: dict[str, Any],
        now: dict[str, Any],
    ) -> Iterator[Case]:
        """Judge an item of a list by the reads of the thing before and after it."""
        listing = listing_of(listed.operation) if listed.operation is not None else None
        parts, own = parts_of(item.shape), flat(listing.item).get("properties", {}) if listing is not None else {}
        for name in [one for one in shown if one in now and one in before and one in own and one in parts]:
            key, (was, since_s) = (item.template, name), before[name]
            if key in self._moving or flat(own[name]) != flat(parts[name]) or not same(was, now[name]):
                continue
            is_short = shown[name] in (None, "", [], {}) or str(now[name]).startswith(str(shown[name]).rstrip(".… "))
            other = next(differences({name: now[name]}, shown, item.shape or {}, item.shape, self._collections), "")
            if other and not is_short and listed.sent_s - since_s > SETTLES_S:
                self._apart[key] += 1
                if self._apart[key] >= _SEEN and key in self._alike:
                    expected = f"{clip(now[name])} as {name}, as GETs of the item show it before and after"
                    cause, found = f"{item.label} {name} listed", f"{clip(shown[name])} as {name}"
                    yield listed.case("description/same-values", False, expected, found, cause=cause)  # noqa: FBT003

    def _judge_part(self, occasion: Occasion, item: Operation, path: str, now: dict[str, Any]) -> Iterator[Case]:
        """Judge whether a thing keeps what the response to a write to a part of it has shown."""
        write, told = self._told[path]
        label, age_s = write.operation.label if write.operation is not None else "", occasion.sent_s
        age_s -= write.response.received_s
        for name in [one for one in told if one in now and (item.template, one) not in self._moving and age_s >= 0]:
            key, value = (label, name), told[name]
            other = next(differences({name: value}, now, item.shape or {}, item.shape, self._collections), "")
            if other and age_s <= SETTLES_S:
                continue
            del told[name]
            (self._lost if other else self._kept)[key].add(f"{path} {clip(value)}")
            if not other or (len(self._lost[key]) >= _SEEN and len(self._kept[key]) >= _SEEN):
                expected = f"{clip(value)} as {name}, as the response to {label} has shown it"
                found, cause = f"{clip(now[name])} as {name}", f"{label} {name} shown"
                yield occasion.case("description/written-is-read", not other, expected, found, cause=cause)


def is_telling(value: Any) -> bool:
    """Return whether a value is unlikely to be that of another member by chance."""
    return isinstance(value, int | float | str) and not isinstance(value, bool) and value not in ("", 0, 1)
