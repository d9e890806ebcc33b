"""State-dependent operations by the description: the states they start from."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final

from conformance.api.rest.things import collection_of, represented
from conformance.checkers.occasion import Occasion
from conformance.contract.pack import Contract
from conformance.documents.json_text import read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.verdict.evidence import Case

_STATES: Final = frozenset({"state", "status", "phase", "mode"})
# Phrases in a description on what an operation does in every other state.
_ELSE: Final = re.compile(r"\b(?:an)?other state|\botherwise\b", re.IGNORECASE)
_NEGATED: Final = re.compile(r"\b(?:not|never|unless|except|cannot|no)\b", re.IGNORECASE)
# _TWICE: how often a state change must follow an operation, because once may be by chance. _OCTETS, _MOST: size and
# number of responses kept.
_TWICE: Final = 2
_OCTETS, _MOST = 65_536, 1_000


class Transitions:
    """Judges operations of things by the read before them.

    Args:
        contract: the description's.
    """

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        reads = {
            operation.template.rstrip("/"): operation
            for operation in operations
            if operation.method == "GET" and operation.shape
        }
        # By template: the member with the thing's state. Below: the states from which each operation starts.
        self._states = {template: name for template, one in reads.items() if (name := state_member(one))}
        self._starts = {operation.label: named for operation in operations if (named := self._named(reads, operation))}
        # By path: members of the thing at the last read.
        self._seen: dict[str, dict[str, Any]] = {}
        self._taken: Counter[tuple[str, str]] = Counter()

    def _named(self, reads: dict[str, Operation], operation: Operation) -> frozenset[str]:
        """Return the states that the description of an operation names; none where they may mean something else."""
        above = operation.template.rstrip("/").rpartition("/")[0]
        if operation.method != "POST" or "409" not in operation.responses or above not in self._states:
            return frozenset()
        given = flat(flat(reads[above].shape or {}).get("properties", {}).get(self._states[above], {}))
        sentences = re.split(r"(?<=[.;])\s+", operation.text)
        said = [sentence for sentence in sentences if not _ELSE.search(sentence)]
        named = {
            str(state): [item for item in said if _word(str(state)).search(item)] for state in given.get("enum", ())
        }
        is_open = any(_NEGATED.search(item) or "409" in item for found in named.values() for item in found)
        is_said = any(_ELSE.search(sentence) and "409" in sentence for sentence in sentences)
        return frozenset(state for state, found in named.items() if found) if is_said and not is_open else frozenset()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, status = occasion.operation, occasion.response.status
        path = occasion.context.target.partition("?")[0].rstrip("/")
        above = path.rpartition("/")[0]
        if occasion.request.method in SAFE:
            if occasion.request.method == "GET" and operation is not None:
                self._read(occasion, operation.template.rstrip("/"), path)
            return
        before = self._seen.get(above)
        if operation is not None and before is not None and operation.method == "POST" and occasion.context.usual:
            yield from self._act(occasion, operation, before)
            if status == HTTPStatus.CONFLICT:
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

    def _read(self, occasion: Occasion, template: str, path: str) -> None:
        """Record the members of a thing as read."""
        answer, name = occasion.response, self._states.get(template, "")
        is_usable = bool(name) and answer.ok and is_json(answer.media_type) and len(answer.body) < _OCTETS
        now = represented(read_json(answer.body).value, {plain_name(name)}) if is_usable else {}
        self._seen.pop(path, None)
        if now and len(self._seen) < _MOST:
            self._seen[path] = now


def state_member(read: Operation) -> str:
    """Return the member that contains a thing's state; empty if there is none."""
    parts = flat(read.shape or {}).get("properties", {}) if collection_of(read.template) else {}
    named = (name for name, one in parts.items() if plain_name(name) in _STATES and len(flat(one).get("enum", ())) > 1)
    return next(named, "")


def _word(state: str) -> re.Pattern[str]:
    return re.compile(rf"\b{'[ _-]'.join(map(re.escape, re.split('[ _-]', state)))}\b", re.IGNORECASE)
