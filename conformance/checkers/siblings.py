"""Things beside one that is written: a request to one of them changes no other one.

Only reads count that have nothing between them but writes to other things of the same collection.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple
from urllib.parse import unquote

from conformance.api.rest.listing import items_of
from conformance.api.rest.patches import same
from conformance.api.rest.references import collections_of
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import collection_of, identifier_of, is_devices, is_shared, parts_of
from conformance.checkers.occasion import MOST_OCTETS, Occasion
from conformance.checkers.representations import is_telling
from conformance.contract.pack import Contract
from conformance.documents.json_schema import kinds_of
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.representation import flat
from conformance.verdict.evidence import Case

_MOST: Final = 1_000
# Parts of a path that refer to different things at different times.
_ALIASES: Final = frozenset({"active", "current", "default", "first", "last", "latest", "me", "newest", "next", "self"})
_TWICE = 2  # different written values that another thing must have taken over
_RESETS = 3  # how often a member must have got the same value after a write
_ALONE = 3  # reads without a write between them in which a member must have kept its value


class _Write(NamedTuple):
    """A write: the path, the operation, the schemas of its body's members, and those that were sent."""

    path: str
    operation: Operation
    parts: Mapping[str, Any]
    sent: Mapping[str, Any]


class Siblings:
    """Judges the members of a thing at a read by those at the read before it."""

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        reads = {one.template.rstrip("/"): one for one in operations if one.method == "GET"}
        self._items = {path: one for path, one in reads.items() if collection_of(path)}
        self._lists = {collection_of(path): one for path, one in self._items.items()}
        self._collections = collections_of(operations)
        self._last: dict[str, dict[str, Any]] = {}  # members at the last read, by path
        # Writes to other things of the collection since that read, by path.
        self._since: dict[str, list[_Write]] = defaultdict(list)
        self._alone: Counter[str] = Counter()  # reads without a write since the read before, by template
        self._moving: set[tuple[str, str]] = set()  # members that changed between such reads
        # Written values that other things then had, by operation and member.
        self._taken: dict[tuple[str, str], set[str]] = defaultdict(set)
        self._became: Counter[tuple[str, str, str]] = Counter()  # how often a member got the same other value

    def forget(self) -> None:
        """Forget all reads: something else may have changed the things."""
        self._last.clear()
        self._since.clear()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, request = occasion.operation, occasion.request
        path = unquote(occasion.context.target.partition("?")[0]).rstrip("/")
        template = operation.template.rstrip("/") if operation is not None else ""
        if request.method not in SAFE:
            if not refuses(occasion.response.status, operation):
                self._take_write(occasion, operation, path)
        elif request.method == "GET" and occasion.response.ok and len(occasion.response.body) <= MOST_OCTETS:
            if template in self._items and occasion.context.plain:
                item = self._items[template]
                yield from self._read(occasion, item, path, occasion.members(parts_of(item.shape)))
            elif template in self._lists and is_json(occasion.response.media_type):
                item = self._lists[template]
                for value in items_of(read_json(occasion.response.body).value) or ():
                    if isinstance(value, dict) and (id_ := identifier_of(value, item)):
                        yield from self._read(occasion, item, f"{path}/{id_}", value)

    def _take_write(self, occasion: Occasion, operation: Operation | None, path: str) -> None:
        request = occasion.request
        is_item = operation is not None and operation.template.rstrip("/") in self._items
        if operation is not None and not is_item and request.method in {"PUT", "PATCH"}:
            # A write to a part of a thing is one to the thing.
            is_item, path = operation.template.rstrip("/").rpartition("/")[0] in self._items, path.rpartition("/")[0]
        body = operation.bodies.get(request.media_type) if operation is not None else None
        sent = read_json(request.body).value if len(request.body) <= MOST_OCTETS else None
        above = path.rpartition("/")[0].casefold()
        if operation is None or not is_item or body is None or not isinstance(sent, dict) or occasion.response.cut:
            self.forget()
            return
        write = _Write(path.casefold(), operation, parts_of(body.schema), sent)
        beside = {key for key in self._last if key.rpartition("/")[0] == above and key != write.path}
        # What is above or below it may follow it.
        self._last = {key: one for key, one in self._last.items() if key in beside}
        self._since = defaultdict(list, {key: [*self._since[key], write] for key in beside})

    def _read(self, occasion: Occasion, item: Operation, at: str, now: dict[str, Any]) -> Iterator[Case]:
        path, template = at.casefold(), item.template
        name = path.rpartition("/")[2]
        if not now or name in _ALIASES or identifier_of(now, item) not in {"", name}:
            return
        before, writes = self._last.get(path, {}), self._since.pop(path, [])
        if len(self._last) < _MOST or path in self._last:
            # A list may have fewer members.
            self._last[path] = {**before, **now}
        changed = [name for name in before if name in now and not same(before[name], now[name])]
        if not writes:
            self._alone[template] += bool(before)
            self._moving |= {(template, name) for name in changed}
            return
        names = [name for name in changed if (template, name) not in self._moving and not is_shared(name)]
        wrong = next((name for name in names if any(self._is_by(one, item, name, now[name]) for one in writes)), "")
        label = writes[-1].operation.label
        expected = f"{clip(before[wrong])} as {wrong}, as before {label} of another thing" if wrong else ""
        expected = expected or f"the members as before {label} of another thing"
        found = f"{clip(now[wrong])} as {wrong}" if wrong else ""
        if wrong or not changed:
            cause = f"{label} {wrong} of another"
            yield occasion.case("description/written-is-read", not wrong, expected, found, cause=cause)

    def _is_by(self, write: _Write, item: Operation, name: str, now: Any) -> bool:
        """Return whether a write has changed a member of another thing: to the sent value, or always to one value."""
        part, label = write.parts.get(name), write.operation.label
        # The thing may have another name for a member of its part.
        is_part = write.operation.template.rstrip("/") not in self._items
        sent = [one for key, one in write.sent.items() if key == name or (is_part and is_telling(one))]
        if any(same(one, now) for one in sent):
            self._taken[label, name].add(clip(now))
            # No device comes by itself to a text of the suite's.
            return len(self._taken[label, name]) >= _TWICE or "roaas" in str(now)
        # Of several things, one alone may be on.
        if not isinstance(part, dict) or is_devices(name, part, self._collections):
            return False
        if "enum" in flat(part) or "boolean" in kinds_of(part) or self._alone[item.template] < _ALONE:
            return False
        self._became[label, name, clip(now)] += 1
        return self._became[label, name, clip(now)] >= _RESETS
