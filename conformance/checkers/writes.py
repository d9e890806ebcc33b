"""Effect of a write, by method and media type: compare the read after it with the read before.

PUT replaces: what it leaves out has its default. A merge patch changes members and removes by null (RFC 7396). A JSON
patch does all its operations, or none (RFC 6902). What is refused changes nothing. Only a read, one write and a read
with nothing between them count, and members that change by themselves do not.
"""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from email.utils import parsedate_to_datetime
from http import HTTPStatus
from typing import Any, Final, NamedTuple

from conformance.api.rest.patches import JSON_PATCH, MERGE, PatchError, merged, partly_patched, patched, same, shows_new
from conformance.api.rest.references import collections_of, is_free_text
from conformance.api.rest.samples import fits
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import (
    SET,
    WHOLE,
    Leaf,
    differences,
    is_altered,
    is_devices,
    is_moved,
    is_reordered,
    is_shared,
    leaves_of,
    left_out_of,
    parts_of,
    says_exactly,
)
from conformance.checkers.entity_tags import judge_revision
from conformance.checkers.occasion import MOST_OCTETS, SETTLES_S, Occasion
from conformance.contract.pack import Contract
from conformance.documents.json_schema import Schema, is_number, kinds_of
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.verdict.evidence import Case

_NOT_NOW: Final = HTTPStatus.ACCEPTED
_MOST: Final = 1_000
# Responses that must show a habit of the device before it counts.
_SEEN: Final = 2
# Whole numbers beyond this are not exact as doubles (RFC 8259 6).
_EXACT: Final = 2**53
_TELLING: Final = 5  # a value with this many characters is unlikely to appear by chance
_EQUAL = 1e-14  # doubles count as equal up to this relative difference
_CLOSE = 0.005  # a larger relative difference is not caused by rounding
#: Phrases in a description on members that a PUT leaves out.
GONE: Final = re.compile(
    r"\b(?:not (?:sent|given|named)|left out|omitted|missing|absent)\b[^.]*\b(?:gone|removed|deleted|cleared|unset)\b",
    re.IGNORECASE,
)
#: Phrases in a description which say that what a PUT leaves out has its default.
DEFAULTED: Final = re.compile(
    r"\b(?:not (?:sent|given|named)|left out|omitted|missing|absent)\b[^.]*\bdefault", re.IGNORECASE
)
_STAYS: Final = re.compile(
    r"\b(?:not (?:sent|given|named)|left out|omitted|missing|absent)\b[^.]*\b(?:keep|kept|stay|remain|unchanged)",
    re.IGNORECASE,
)
# Phrases in a description which say that null is written.
_NULL: Final = re.compile(r"\bnull\b[^.;]* (?:is a value|clears?|removes?|deletes?|unsets?|resets?)\b", re.IGNORECASE)
# Members with the time of the last change.
_CHANGED_AT: Final = re.compile(r"(?:last)?(?:updated|modified|changed|edited)(?:at|on|time|date)?")
_READ, _PATCH, _OWN = (f"description/{name}" for name in ("written-is-read", "patch", "read-only"))
_KEPT, _DEFAULTS = "description/refused-keeps", "description/defaults"
# What a conforming device may do to a value that it stores.
_COARSE: Final = "it may keep numbers only as finely as it can set or measure them"
_LINES: Final = "it may end lines of a text in its own way"


class _State(NamedTuple):
    """A state as a read showed it, and when, s of the monotonic clock."""

    members: dict[str, Any]
    at_s: float


class _Sandwich(NamedTuple):
    """Members before and after a write, those that change by themselves, and whether the write was long ago."""

    before: dict[str, Any]
    now: dict[str, Any]
    moving: frozenset[str]
    is_old: bool


class _Change(NamedTuple):
    """A write between two reads, judged at the second one."""

    write: Occasion
    operation: Operation
    before: dict[str, Any]
    now: dict[str, Any]
    moving: frozenset[str]
    is_old: bool

    @property
    def sent_value(self) -> Any:
        """The JSON value of its body; of a list or the like, an object with that."""
        value = read_json(self.write.request.body).value
        return value if isinstance(value, dict) or self.write.request.method != "PUT" else {WHOLE: value}

    @property
    def schema(self) -> Schema:
        """The schema of its body."""
        return self.operation.bodies[self.write.request.media_type].schema

    @property
    def label(self) -> str:
        """The request in words."""
        return f"{self.operation.label} with status {self.write.response.status}"

    @property
    def is_merge(self) -> bool:
        """Whether it is a merge patch, by its media type or by the description."""
        is_said = self.write.request.method == "PATCH" and "7396" in self.operation.text
        return MERGE in self.write.request.media_type or is_said

    @property
    def is_kept(self) -> bool:
        """Whether the description says that members keep their values which it leaves out."""
        return bool(_STAYS.search(self.operation.text))

    @property
    def shown_members(self) -> dict[str, Any]:
        """The members that its response shows."""
        return self.write.members(self.now)

    def is_settled(self, name: str, names: Any) -> bool:
        """Return whether the device has acted by the second read, which a device that acts later has not.

        It was long ago, its response shows the member as that read does, or another member of it has changed.
        """
        if self.is_old:
            return True
        told = self.shown_members
        is_told = bool(told) and same(told.get(name), self.now.get(name)) and len(told) > 1
        return is_told or any(
            not same(self.now.get(one), self.before.get(one)) for one in names if one != name and one not in self.moving
        )


class Writes:
    """Judges each read that follows one write of the same resource."""

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        written = {operation.template for operation in operations if operation.method in {"PUT", "PATCH"}}
        written |= {template.rpartition("/")[0] for template in written}
        self._reads = {
            operation.template: operation
            for operation in operations
            if operation.method == "GET" and operation.template in written
        }
        self._collections = collections_of(operations)
        self._states: dict[str, _State] = {}
        self._writes: dict[str, list[Occasion]] = defaultdict(list)
        # Members in the last response, to a read or a patch, by path.
        self._last: dict[str, dict[str, Any]] = {}
        # Writes that no read has shown yet, by path.
        self._late: dict[str, Occasion] = {}
        self._moving: set[tuple[str, str]] = set()
        # Bodies with which a member was wrong, by operation and member: a single one may be chance.
        self._doubts: dict[tuple[str, str], set[bytes]] = defaultdict(set)
        # Members that once kept a fraction, and those that kept another fraction than a half.
        self._precise: set[tuple[str, str]] = set()
        self._fine: set[tuple[str, str]] = set()
        # Methods whose values were read as they were sent, and patches that changed nothing, by template and member.
        self._taken: dict[tuple[str, str], set[str]] = defaultdict(set)
        self._ignored: dict[tuple[str, str], dict[bytes, Case]] = defaultdict(dict)
        # How often it was as before after such a request, by template, member, method and value.
        self._refused = Counter[tuple[str, str, str, str]]()
        # The last accepted body, which a device may still apply after a refused request, by path.
        self._accepted: dict[str, Any] = {}

    def forget(self) -> None:
        """Forget all reads: something else may have changed the resources."""
        self._states.clear()
        self._writes.clear()
        self._last.clear()
        self._late.clear()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        request, status = occasion.request, occasion.response.status
        operation, path = occasion.operation, occasion.context.target
        item = self._reads.get(operation.template) if operation is not None else None
        if request.method in SAFE:
            if request.method == "GET" and status == HTTPStatus.OK and item is not None and "?" not in path:
                yield from self._read(occasion, item, path)
            return
        if refuses(status, operation):
            # A refused write below a thing may have changed that.
            at = path if item is not None else path.partition("?")[0].rpartition("/")[0]
            if at in self._states:
                self._writes[at].append(occasion)
            return
        state = self._states.get(path) if item is not None else None
        writes, last, late = self._writes.get(path, []), self._last.get(path, {}), self._late.get(path)
        if item is not None and len(request.body) <= MOST_OCTETS and len(self._accepted) < _MOST:
            value = read_json(request.body).value
            self._accepted[path] = value if isinstance(value, dict) else {WHOLE: value}
        self.forget()
        if state is not None and occasion.response.ok and request.method in {"PUT", "PATCH"} and request.raw is None:
            self._states[path], self._writes[path] = state, [*writes, occasion]
            self._late |= {path: late} if late is not None else {}
        if item is not None and occasion.response.ok and request.method == "PATCH":
            yield from self._answer(occasion, item, last)

    def _answer(self, occasion: Occasion, item: Operation, before: dict[str, Any]) -> Iterator[Case]:
        """Judge a patch by its own response, if that shows all members that the response before it has shown."""
        moving = frozenset(name for name in before if (item.template, name) in self._moving)
        change = _Change(occasion, occasion.operation or item, before, before, moving, is_old=True)
        change = change._replace(now=change.shown_members)
        if before.keys() <= change.now.keys() and occasion.is_valid and isinstance(change.sent_value, dict):
            yield from self._others(occasion, item, change) if before else ()
            self._last[occasion.context.target] = change.now

    def _read(self, occasion: Occasion, item: Operation, path: str) -> Iterator[Case]:
        response = occasion.response
        now = occasion.members(parts_of(item.shape))
        state, writes = self._states.pop(path, None), self._writes.pop(path, [])
        sent_s, late = occasion.sent_s, self._late.pop(path, None)
        if state is not None and state.at_s <= sent_s and len(response.body) <= MOST_OCTETS:
            names = {*now, *state.members}
            changed = [name for name in names if not same(now.get(name), state.members.get(name))]
            self._moving |= {(item.template, name) for name in changed if not writes}
            refused = [one for one in writes if refuses(one.response.status, one.operation)]
            # Of several with one body, the reads do not tell which one has taken effect.
            alone = [one for one in refused if [each.request.body for each in writes].count(one.request.body) == 1]
            for one in alone if len(writes) > 1 and len(refused) == len(writes) else ():
                yield from self._judge_write(
                    occasion, item, one, _Sandwich(state.members, now, frozenset(), is_old=True)
                )
            write = writes[0] if len(writes) == 1 else late if not writes and not changed else None
            # A value of an earlier write, which the read after it did not show yet.
            is_late = writes and late is not None and shows_new(read_json(late.request.body).value, state.members, now)
            if write is not None and (state.at_s <= write.sent_s or write is late) and not is_late:
                moving = frozenset(one for one in names if (item.template, one) in self._moving)
                is_old = sent_s - write.response.received_s > SETTLES_S
                if is_old or write is not late:
                    yield from self._judge_write(occasion, item, write, _Sandwich(state.members, now, moving, is_old))
                if write.response.ok and not changed and not is_old:
                    # A device may act later: a later read is compared as well.
                    self._late[path] = write
        if len(self._states) < _MOST:
            self._states[path], self._last[path] = _State(now, response.received_s), now

    def _judge_write(self, occasion: Occasion, item: Operation, write: Occasion, reads: _Sandwich) -> Iterator[Case]:
        operation, request = write.operation, write.request
        is_readable = is_json(request.media_type) and len(request.body) <= MOST_OCTETS
        if operation is None or request.media_type not in operation.bodies or not is_readable or not reads.now:
            return
        change = _Change(write, operation, *reads)
        if refuses(write.response.status, operation):
            yield from self._judge_refused(occasion, change)
            return
        if write.response.status == _NOT_NOW:
            return
        if JSON_PATCH in request.media_type:
            yield from self._judge_patch(occasion, item, change)
        elif isinstance(change.sent_value, dict):
            yield from self._judge_own(occasion, item, change)
            # The schema of a merge patch need not say that null removes a member.
            if change.is_merge:
                yield from self._judge_merge(occasion, item, change)
            if not write.is_valid:
                return
            yield from judge_revision(occasion, write, change.sent_value, change.before)
            yield from _entries(occasion, change)
            yield from self._judge_stamp(occasion, item, change)
            yield from self._values(occasion, item, change)
            if request.method == "PUT":
                yield from self._left_out(occasion, item, change)
            else:
                yield from self._others(occasion, item, change)

    def _judge_refused(self, occasion: Occasion, change: _Change) -> Iterator[Case]:
        """Judge whether a refused request has changed nothing, not even in part."""
        sent, accepted = change.sent_value, self._accepted.get(change.write.context.target)
        if JSON_PATCH in change.write.request.media_type:
            made = [item for item in partly_patched(change.before, sent) if isinstance(item, dict)]
        else:
            made = [sent] if isinstance(sent, dict) else []
        wrong = doubt = ""
        for name in sorted({name for item in made for name in item} - change.moving):
            was, now = change.before.get(name), change.now.get(name)
            is_late = isinstance(accepted, dict) and name in accepted and same(accepted[name], now)
            is_taken = not same(was, now) and any(name in item and same(item[name], now) for item in made)
            if is_taken and not is_late:
                wrong = f"{clip(now)} as {name}, and {clip(was)} before"
                doubt = self._doubt_of(change.operation.label, name, now)
                break
        expected = f"the members as they were before {change.label}"
        if made:
            cause = f"{change.operation.label} refused"
            yield occasion.case(_KEPT, not wrong, expected, wrong, cause=cause, doubt=doubt)

    def _doubt_of(self, label: str, name: str, now: Any) -> str:
        """Return why a value that was refused may be the device's own; nothing once two different ones are there."""
        doubts = self._doubts[label, f"{name} refused"]
        doubts.add(str(now).encode())
        is_own = len(str(now)) < _TELLING and len(doubts) < _SEEN
        return f"it may have come to {clip(now)} by itself" if is_own else ""

    def _judge_patch(self, occasion: Occasion, item: Operation, change: _Change) -> Iterator[Case]:
        """Judge a JSON patch that was accepted."""
        operations = change.sent_value
        try:
            made = patched(change.before, operations)
        except PatchError as error:
            expected = f"a refusal of the whole patch, because an operation of it fails: {error}"
            found = f"status {change.write.response.status}"
            cause = f"{change.operation.label} {str(error).partition(' ')[0]}"
            # A member that changes by itself may have had the value at that moment.
            if not change.moving & {str(error).rpartition("/")[2]}:
                yield Case(False, change.write.exchange, expected, found, cause, requirement=_KEPT)  # noqa: FBT003
            return
        yield Case(True, change.write.exchange, "a patch applied as a whole", requirement=_KEPT)  # noqa: FBT003
        made = made if isinstance(made, dict) else change.before
        touched = [name for name in {**change.before, **made} if not same(made.get(name), change.before.get(name))]
        for name in touched:
            kept, is_same = change.now.get(name), same(change.now.get(name), change.before.get(name))
            # A removed member may return to its default.
            is_free = name not in made and "default" in flat(parts_of(item.shape).get(name) or {})
            far = not same(kept, made.get(name)) and (is_same or (name in made and isinstance(kept, list)))
            if name not in change.moving and name in change.now and not is_free:
                wrong = f"{clip(kept)} as {name}" if far and (not is_same or change.is_settled(name, touched)) else ""
                asked = f"{clip(made[name])} as {name}" if name in made else f"no {name}"
                expected = f"{asked}, as {change.label} asked for (RFC 6902)"
                yield occasion.case(_PATCH, not wrong, expected, wrong, cause=f"{change.operation.label} {name} patch")

    def _judge_own(self, occasion: Occasion, item: Operation, change: _Change) -> Iterator[Case]:
        """Judge whether a request has changed members that only the device may set."""
        for name, value in change.sent_value.items():
            parts = (parts_of(change.schema).get(name), parts_of(item.shape).get(name))
            if name in change.now and any(isinstance(part, dict) and flat(part).get("readOnly") for part in parts):
                was, now = change.before.get(name), change.now[name]
                is_taken = same(now, value) and not same(was, value) and name not in change.moving
                if is_taken and len(str(value)) < _TELLING:
                    self._doubts[change.operation.label, name].add(change.write.request.body)
                    is_taken = len(self._doubts[change.operation.label, name]) >= _SEEN
                expected = f"{name}, which is readOnly, as the device gave it"
                found = f"{clip(now)} as {name}, and {clip(was)} before"
                yield occasion.case(_OWN, not is_taken, expected, found, cause=f"{item.label} {name}")

    def _judge_stamp(self, occasion: Occasion, item: Operation, change: _Change) -> Iterator[Case]:
        """Judge whether the time of the last change moves, of a thing that has the time of its creation too."""
        names, parts = {plain_name(name): name for name in change.now}, parts_of(item.shape)
        stamp = next((name for text, name in names.items() if _CHANGED_AT.fullmatch(text)), "")
        touched = (change.sent_value.keys() & change.now.keys() & parts.keys()) - change.moving
        is_changed = any(not same(change.before.get(name), change.now[name]) for name in touched)
        if not stamp:
            return
        then, now = _moment(change.now.get(stamp)), _moment(change.write.response.header("date"))
        is_same = same(change.before.get(stamp), change.now[stamp])
        is_record = is_same and any(text.startswith("created") for text in names)
        if not (is_record and is_changed and then and now) or (now - then).total_seconds() <= SETTLES_S:
            return
        doubts = self._doubts[change.operation.label, f"{stamp} stays"]
        doubts.add(change.write.request.body)
        if len(doubts) >= _SEEN:
            expected = f"the time of {change.label} as {stamp}, {now:%H:%M:%S} by the Date of its response"
            found = f"{clip(change.now[stamp])} as {stamp}, as before"
            cause = f"{change.operation.label} {stamp} stays"
            doubt = "the member may count other changes than this one"
            yield occasion.case(_READ, False, expected, found, cause=cause, doubt=doubt)  # noqa: FBT003

    def _values(self, occasion: Occasion, item: Operation, change: _Change) -> Iterator[Case]:
        """Judge values that were taken, but not as they were sent: without fraction, rounded, in another order."""
        shape = parts_of(item.shape)
        there = {name: one for name, one in change.now.items() if name not in change.moving}
        for leaf in leaves_of(parts_of(change.schema), change.sent_value, change.before, there):
            name, part, value, was, now = leaf
            if is_devices(name.rpartition(".")[2], part, self._collections):
                continue
            key, wrong, doubt = (change.operation.label, name), "", ""
            yield from self._judge_same(occasion, item, change, leaf)
            if part.get("format") == "double" and _is_rounded(value, now):
                self._doubts[key].add(str(value).encode())
                is_told = same(change.shown_members.get(leaf.top), change.now[leaf.top])
                is_sure = is_told or len(self._doubts[key]) >= _SEEN
                wrong, doubt = f"{clip(now)} as {name}" if is_sure else "", _COARSE
            elif is_number(value) and is_number(now) and "number" in kinds_of(part) and not float(value).is_integer():
                kept = not float(now).is_integer() or float(part.get("multipleOf", 0.5)).is_integer()
                self._precise |= {key} if kept else set()
                # Of a device that keeps halves, a whole number is one as well.
                self._fine |= {key} if same(now, value) and not float(2 * value).is_integer() else set()
                is_lost = not kept and (key in self._fine or key not in self._precise)
                if is_lost and abs(now - value) < 1 and "integer" not in kinds_of(shape.get(name, {})):
                    self._doubts[key].add(str(value).encode())
                    wrong, doubt = f"{clip(now)} as {name}" if len(self._doubts[key]) >= _SEEN else "", _COARSE
            elif isinstance(value, int) and isinstance(now, int) and abs(value) > _EXACT:
                wrong = f"{now} as {name}" if now != value and abs(abs(now) - abs(value)) <= abs(value) >> 52 else ""
            elif not same(now, was) and _is_other(part, value, now):
                wrong = f"{now} as {name}"
            elif isinstance(value, str) and isinstance(now, str) and is_free_text(part):
                is_lost = is_altered(name, part, value, now) or (says_exactly(part) and value != now)
                wrong = f"{clip(now)} as {name}" if is_lost else ""
                doubt = _LINES if value.splitlines() == now.splitlines() else ""
            elif isinstance(value, list) and isinstance(now, list) and not same(now, was):
                wrong = self._items(name, value, now, part)
                doubt = SET if set(map(clip, value)) == set(map(clip, now)) else ""
            else:
                continue
            expected = f"{clip(value)} as {name}, as {change.label} wrote it"
            cause = f"{change.operation.label} {name} value"
            yield occasion.case(_READ, not wrong, expected, wrong, cause=cause, doubt=doubt)

    def _judge_same(self, occasion: Occasion, item: Operation, change: _Change, leaf: Leaf) -> Iterator[Case]:
        """Judge a value that a write left as it was: an empty one by PUT, or two by PATCH that PUT alone changes."""
        key, last = (item.template, leaf.name), leaf.name.rpartition(".")[2]
        is_same, method = same(leaf.now, leaf.was), change.write.request.method
        if same(leaf.now, leaf.value):
            self._taken[key] |= set() if is_same else {method}
        elif is_same and change.is_settled(leaf.top, change.sent_value) and not is_shared(last):
            expected = f"{clip(leaf.value)} as {leaf.name}, as {change.label} wrote it"
            cause, found = f"{change.operation.label} {leaf.name} value", f"{clip(leaf.now)} as {leaf.name}, as before"
            case = occasion.case(_READ, False, expected, found, cause=cause)  # noqa: FBT003
            is_open = "properties" in leaf.part or same(leaf.was, leaf.part.get("default"))
            is_said = bool(_NULL.search(change.operation.text)) and not change.is_merge
            is_put = method == "PUT" and leaf.value in (None, [], {})
            if not is_open and (is_put or (leaf.value is None and is_said)):
                is_sure = is_said or leaf.value is not None
                yield replace(case, doubt="" if is_sure else "null may mean that the member is not to be changed")
            part: Schema = {"properties": {last: leaf.part}}
            differs = any(differences({last: leaf.value}, {last: leaf.now}, part, None, frozenset()))
            if method == "PATCH" and differs:
                self._ignored[key][change.write.request.body] = case
            # Programs take 0, false and an empty text for nothing.
            self._refused[*key, method, clip(leaf.value)] += differs and leaf.value in (0, "")
            if method in self._taken[key] and self._refused[*key, method, clip(leaf.value)] >= _SEEN:
                yield replace(case, doubt="it may not take this value at the moment")
        if self._taken[key] == {"PUT"} and len(self._ignored[key]) >= _SEEN:
            yield from self._ignored.pop(key).values()

    def _items(self, name: str, value: list[Any], now: list[Any], part: Schema) -> str:
        """Return what differs in a list: its length, the order of its numbers, or members of its objects."""
        inner = flat(part["items"]) if isinstance(part.get("items"), dict) else {}
        if all(isinstance(item, dict) for item in (*value, *now)):
            if len(value) != len(now):
                return f"{len(now)} items in {name} in place of {len(value)}"
            for one, other in zip(value, now, strict=True):
                if text := next(differences(one, other, inner, None, self._collections), ""):
                    return f"{text} in an item of {name}"
        is_plain = all(map(is_number, (*value, *now))) and not part.get("uniqueItems")
        is_other = is_reordered(value, now, part)
        is_fewer = is_plain and len(now) < len(value) and set(value) == set(now)
        if all(isinstance(item, str) and item.strip() == item != "" for item in (*value, *now)):
            # A device may leave out what is there twice, and sort texts.
            is_fewer = set(now) < set(value) or (set(now) > set(value) and name == WHOLE)
            pairs = zip(*(sorted(items, key=str.casefold) for items in (value, now)), strict=False)
            said = {**inner, "description": f"{inner.get('description', '')} {part.get('description', '')}"}
            is_fewer |= len(now) == len(value) and any(is_altered(name, said, *pair) for pair in pairs)
        return f"{clip(now)} as {name}" if is_other or is_fewer else ""

    def _left_out(self, occasion: Occasion, item: Operation, change: _Change) -> Iterator[Case]:
        """Judge whether members that a PUT leaves out get their default, or disappear if the description says so."""
        is_said, bodies = GONE.search(change.operation.text), (change.sent_value, change.before, change.now)
        for leaf, is_needed in left_out_of(parts_of(change.schema), flat(item.shape or {}), bodies):
            name, given, default, was, now = leaf
            is_open = "default" not in given and (not is_said or is_needed)
            if is_open or given.get("readOnly") or same(was, default):
                continue
            if is_devices(name, given, self._collections) or is_shared(name) or leaf.top in change.moving:
                continue
            is_kept = same(now, was) and change.is_settled(leaf.top, change.sent_value)
            of = "the default of what" if "default" in given else "which"
            expected = f"{clip(default) if 'default' in given else 'no value'} as {name}, {of} {change.label} left out"
            found, cause = f"{clip(now)} as {name}, as before", f"{item.label} {name}"
            doubt = "" if DEFAULTED.search(change.operation.text) else "PUT may keep what it leaves out"
            yield occasion.case(_DEFAULTS, not is_kept, expected, found, cause=cause, doubt=doubt)

    def _judge_merge(self, occasion: Occasion, item: Operation, change: _Change) -> Iterator[Case]:
        """Judge whether a merge patch removes by null, merges objects and replaces lists (RFC 7396)."""
        for name, value in change.sent_value.items():
            was, now = change.before.get(name), change.now.get(name)
            shape, given = (flat(parts_of(of).get(name) or {}) for of in (item.shape, change.schema))
            is_own = shape.get("readOnly") or given.get("readOnly")
            if was is None or is_own or name in change.moving or (value is not None and name not in change.now):
                continue
            wrong, expected = "", f"{name} as {change.label} asked for (RFC 7396 2)"
            if value is None:
                default = shape.get("default")
                expected = f"no {name}, which {change.label} removed by null (RFC 7396 2)"
                # If the member is required, null may set a default, and a read may show it as empty.
                is_needed = name in flat(item.shape or {}).get("required", ()) and not fits(shape, None)
                is_kept = same(now, was) and not (same(was, default) or is_needed) and was not in ("", [], {})
                wrong = f"{clip(was)} as {name}" if is_kept and change.is_settled(name, change.sent_value) else ""
            elif isinstance(value, dict) and isinstance(was, dict) and isinstance(now, dict):
                made = merged(was, value)
                lost = [one for one in was if one in made and one not in value and now.get(one) is None is not was[one]]
                kept = [one for one in value if value[one] is None and one in was and same(now.get(one), was[one])]
                kept = kept if any(not same(now.get(one), was.get(one)) for one in value) else []
                wrong = f"no {lost[0]} in {name}" if lost else f"{kept[0]} in {name}" if kept else ""
            elif isinstance(value, list) and isinstance(was, list) and isinstance(now, list) and was:
                is_added = len(now) > len(value) and len(now) >= len(was) and all(one in now for one in (*was, *value))
                wrong = f"{clip(now)} as {name}" if is_added and not same(was, now) else ""
            else:
                continue
            yield occasion.case(_PATCH, not wrong, expected, wrong, cause=f"{item.label} {name} merge")

    def _reset_within(self, change: _Change, name: str) -> str:
        """Return an object's member that a patch has changed although it names only another member of the object.

        One member may follow another one. Two that reset each other, by values that change nothing, do not.
        """
        value, was, now = change.sent_value[name], change.before[name], change.now[name]
        others = [item for item in was if item in now and item not in value and not same(now[item], was[item])]
        doubts = self._doubts[change.operation.label, f"{name} within"]
        if others and change.is_kept:
            doubts.add(f"{clip(was)} {clip(value)}".encode())
            return f"{clip(now[others[0]])} as {others[0]} in {name}" if len(doubts) >= _SEEN else ""
        if all(same(value[item], was.get(item)) for item in value):
            doubts |= {f"{item} resets {other}".encode() for item in value for other in others}
        both = [one for one in others if any(f"{one} resets {other}".encode() in doubts for other in value)]
        return f"{clip(now[both[0]])} as {both[0]} in {name}" if both else ""

    def _others(self, occasion: Occasion, item: Operation, change: _Change) -> Iterator[Case]:
        """Judge whether a patch keeps the members that it does not name; it takes two bodies to rule out chance."""
        parts, label = parts_of(change.schema), change.operation.label
        is_said = change.is_kept
        bodies = (change.sent_value, change.before, change.now)
        for name in set.intersection(*map(set, bodies)) if change.is_merge else ():
            if all(isinstance(body[name], dict) for body in bodies) and name not in change.moving:
                wrong = self._reset_within(change, name)
                expected, cause = f"{name} with the members that {change.label} left out", f"{item.label} {name} merge"
                yield occasion.case(_PATCH, not wrong, expected, wrong, cause=cause)
        for name in change.before.keys() & parts.keys() - change.sent_value.keys() - change.moving:
            was, now, given = change.before[name], change.now.get(name), flat(parts[name])
            if was is None or same(was, now) or is_devices(name, given, self._collections) or is_shared(name):
                continue
            default = flat(parts_of(item.shape).get(name) or {}).get("default", given.get("default"))
            is_empty = now is None or same(now, default) or now in ("", [], {}, 0, False)
            wrote = self._doubts[label, f"{name} to {clip(now)}"]
            wrote.add(change.write.request.body)
            named = set.intersection(*(set(read_json(body).value) for body in wrote))
            if len(wrote) >= _SEEN and (is_empty or is_said or not named):
                expected = f"{clip(was)} as {name}, which {change.label} does not name"
                found, cause = f"{clip(now)} as {name}", f"{label} {name} kept"
                follows = f"{name} may follow {min(named, default='other members')}"
                doubt = "" if is_said or (is_empty and not named) else follows
                yield occasion.case(_PATCH, False, expected, found, cause=cause, doubt=doubt)  # noqa: FBT003


def _entries(occasion: Occasion, change: _Change) -> Iterator[Case]:
    """Judge whether a map has all new entries of a body, if it has one of them."""
    for name, part in parts_of(change.schema).items():
        value, was, now = (item.get(name) for item in (change.sent_value, change.before, change.now))
        if isinstance(value, dict) and isinstance(now, dict) and "properties" not in flat(part):
            new = [item for item in value if item not in (was or {}) and value[item] is not None]
            lost = [item for item in new if item not in now]
            wrong = f"no {lost[0]} in {name}" if 0 < len(lost) < len(new) else ""
            cause, expected = f"{change.operation.label} {name} entries", f"the entries that {change.label} wrote"
            yield occasion.case(_READ, not wrong, expected, wrong, cause=cause)


def _moment(text: Any) -> datetime | None:
    """Return a time by RFC 3339 or of a Date header; None for anything else."""
    for read in (datetime.fromisoformat, parsedate_to_datetime) if isinstance(text, str) else ():
        with suppress(TypeError, ValueError):
            found = read(text)
            return found if found.tzinfo is not None else None
    return None


def _is_rounded(value: Any, now: Any) -> bool:
    """Return whether a double reads as another one that is close to it."""
    if isinstance(value, bool) or isinstance(now, bool) or not (is_number(value) and is_number(now)):
        return False
    return not math.isclose(value, now, rel_tol=_EQUAL) and math.isclose(value, now, rel_tol=_CLOSE)


def _is_other(part: Schema, value: Any, now: Any) -> bool:
    """Return whether a moment or an exact code reads as another one, or XML's NaN as a number, which no limit does."""
    if "number" in kinds_of(part):
        return bool(value == "NaN" and is_number(now))
    is_code = isinstance(value, str) and isinstance(now, str) and says_exactly(part) and not is_free_text(part)
    is_time = part.get("format") in {"date", "date-time"}
    return is_moved(value, now) if is_time else is_code and value != now
