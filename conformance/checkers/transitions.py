"""State-dependent operations by the description: the states they start from, and what a refusal leaves unchanged."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final, NamedTuple

from conformance.api.rest.patches import same
from conformance.api.rest.things import collection_of, represented
from conformance.checkers.occasion import Occasion
from conformance.contract.pack import Contract
from conformance.documents.json_text import read_json, shown
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.verdict.evidence import Case

_STATES: Final = frozenset({"state", "status", "phase", "mode"})
# Texts of a description on what an operation does in all states that another sentence does not name.
_ELSE: Final = re.compile(r"\b(?:an)?other state|\botherwise\b", re.IGNORECASE)
#: Texts of a description that say that a refusal changes nothing.
KEEPS: Final = re.compile(r"nothing (?:is )?chang|not chang|unchanged|no effect|without effect", re.IGNORECASE)
_NEGATED: Final = re.compile(r"\b(?:not|never|unless|except|cannot|no)\b", re.IGNORECASE)
# Times that a change must follow: once may be a change by itself at that moment.
_TWICE: Final = 2
#: Refusals after each of which a change must follow: a change by itself does not.
OFTEN: Final = 3
_OCTETS, _MOST = 65_536, 1_000


class _Seen(NamedTuple):
    """The members of a thing, as they were last read, and the refused operation since then."""

    members: dict[str, Any]
    refused: Operation | None = None


class Transitions:
    """Judges operations of things by the read before them, and each read by the refused operation before it.

    Args:
        contract: the description's.
    """

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        reads = {one.template.rstrip("/"): one for one in operations if one.method == "GET" and one.shape}
        # The member with the state of a thing, and the states from which each operation of it starts.
        self._states = {template: name for template, one in reads.items() if (name := state_member(one))}
        self._starts = {one.label: named for one in operations if (named := self._named(reads, one))}
        self._seen: dict[str, _Seen] = {}
        self._taken: Counter[tuple[str, str]] = Counter()
        # By operation: how often it was refused between two reads, and which members were others then; "": by nothing.
        self._refused: Counter[str] = Counter()
        self._changed: dict[str, Counter[str]] = defaultdict(Counter)

    def _named(self, reads: dict[str, Operation], operation: Operation) -> frozenset[str]:
        """Return the states that the description of an operation names; none where they may mean something else."""
        above = operation.template.rstrip("/").rpartition("/")[0]
        if operation.method != "POST" or "409" not in operation.responses or above not in self._states:
            return frozenset()
        given = flat(flat(reads[above].shape or {}).get("properties", {}).get(self._states[above], {}))
        sentences = re.split(r"(?<=[.;])\s+", operation.text)
        said = [one for one in sentences if not _ELSE.search(one)]
        named = {str(state): [one for one in said if _word(str(state)).search(one)] for state in given.get("enum", ())}
        is_open = any(_NEGATED.search(one) or "409" in one for found in named.values() for one in found)
        is_said = any(_ELSE.search(one) and "409" in one for one in sentences)
        return frozenset(state for state, found in named.items() if found) if is_said and not is_open else frozenset()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, status = occasion.operation, occasion.response.status
        path = occasion.context.target.partition("?")[0].rstrip("/")
        above = path.rpartition("/")[0]
        if occasion.request.method in SAFE:
            if occasion.request.method == "GET" and operation is not None:
                yield from self._read(occasion, operation.template.rstrip("/"), path)
            return
        before = self._seen.get(above)
        if operation is not None and before is not None and operation.method == "POST" and occasion.context.usual:
            yield from self._act(occasion, operation, before.members)
            if status == HTTPStatus.CONFLICT and before.refused is None:
                self._seen[above] = _Seen(before.members, operation)
                return
        self._seen.clear()

    def _act(self, occasion: Occasion, operation: Operation, before: dict[str, Any]) -> Iterator[Case]:
        """Judge an operation by the state that the thing had."""
        starts = self._starts.get(operation.label, frozenset())
        state = str(before.get(self._states[operation.template.rstrip("/").rpartition("/")[0]], ""))
        if starts and state:
            is_taken = occasion.response.ok and state not in starts
            self._taken[operation.label, state] += is_taken
            if not is_taken or self._taken[operation.label, state] >= _TWICE:
                expected = f"status 409, as the description says of other states than {' and '.join(sorted(starts))}"
                found, cause = f"status {occasion.response.status}, and {state} before", f"{operation.label} {state}"
                yield occasion.case("description/states", not is_taken, expected, found, cause=cause)

    def _read(self, occasion: Occasion, template: str, path: str) -> Iterator[Case]:
        """Judge a read by the one before it, where an operation was refused in between."""
        answer = occasion.response
        value = read_json(answer.body).value if is_json(answer.media_type) and len(answer.body) < _OCTETS else None
        name, before = self._states.get(template, ""), self._seen.pop(path, None)
        now = represented(value, {plain_name(name)}) if name and answer.ok else {}
        if not now:
            return
        if len(self._seen) < _MOST:
            self._seen[path] = _Seen(now)
        if before is None or (before.refused is not None and not KEEPS.search(before.refused.text)):
            return
        label = before.refused.label if before.refused is not None else ""
        self._refused[label] += 1
        self._changed[label].update(one for one in now if not same(now[one], before.members.get(one)))
        always = [one for one, count in self._changed[label].items() if count == self._refused[label]]
        # What changes between two reads alone, and by other refusals, changes by itself.
        others = {one for other, found in self._changed.items() if other != label for one in found}
        wrong = next((one for one in always if one not in others), "")
        if label and self._refused[label] >= OFTEN:
            expected = f"the members as before {label} with status 409, after which nothing changes by the description"
            found = f"{shown(now[wrong])} as {wrong}, and {shown(before.members.get(wrong))} before" if wrong else ""
            yield occasion.case("description/refused-keeps", not wrong, expected, found, cause=f"{label} refused")


def state_member(read: Operation) -> str:
    """Return the member that contains a thing's state; empty if there is none."""
    parts = flat(read.shape or {}).get("properties", {}) if collection_of(read.template) else {}
    named = (name for name, one in parts.items() if plain_name(name) in _STATES and len(flat(one).get("enum", ())) > 1)
    return next(named, "")


def _word(state: str) -> re.Pattern[str]:
    return re.compile(rf"\b{'[ _-]'.join(map(re.escape, re.split('[ _-]', state)))}\b", re.IGNORECASE)
