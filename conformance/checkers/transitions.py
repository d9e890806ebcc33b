"""Judge operations in states in which their descriptions say that they are refused."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final

from conformance.api.rest.references import singular
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import collection_of
from conformance.checkers.changes import FINAL, TWICE, another_of, reads_of, state_in, states_of, word_of
from conformance.checkers.occasion import MOST_OCTETS, Occasion
from conformance.contract.pack import Contract
from conformance.documents.json_schema import kinds_of
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.documents.writing import text_of
from conformance.verdict.evidence import Case

_MOST_THINGS: Final = 1_000
_REFUSED: Final = re.compile(
    r"\b(?:409|refuse[sd]?|conflict)\b([^.;:]*?\b(?:if|when|while|unless)\b[^.;:]*)", re.IGNORECASE
)
# The same with the condition first, as in "While the belt is archived, it is refused with 409".
_WHILE: Final = re.compile(
    r"\b((?:if|when|while|as long as)\b[^.;:]*),[^.,;:]*\b(?:409|refuse[sd]?|conflict)\b", re.IGNORECASE
)
# The same with the only state in which it is accepted, as in "Only while the belt is stopped: 409 otherwise".
_ONLY_WHILE: Final = re.compile(
    r"\bonly (?:if|when|while|as long as) ([^.;:,]*)[.;:,] ?(?:(?:otherwise|else),? )?409\b(?! (?:if|when|unless))",
    re.IGNORECASE,
)
# What cannot be done to a thing in some state: "A job that has finished cannot be cancelled", "A cancelled job: 409".
_CANNOT: Final = re.compile(
    r"([^.;:]*?)\b(?:cannot|can not|can no longer|must not|may not) be\b|\b(an? [\w -]+): 409(?=[.;]|$)", re.IGNORECASE
)
# The only state in which an operation is accepted, as in "only a queued mission can be started" or "not queued".
_ONLY: Final = re.compile(
    r"(?:\bonly (?:an? |the |for |if |when |while |it is |allowed |possible )*|^not )`?([\w-]+)(?!.*(?:,| or ))",
    re.IGNORECASE,
)
# Words before a condition.
_NEEDS: Final = re.compile(
    r"\b(?:only|unless|must|ha(?:s|ve) to|needs?|until|before|requires?|should|can|may)\b", re.IGNORECASE
)
_ENDED: Final = re.compile(r"\b(?:final|terminal|finished|ended|over)\b", re.IGNORECASE)
_AND_WHILE: Final = re.compile(r",?\s+(?:and|or)\s+(?:if|when|while|as long as)\s+", re.IGNORECASE)
#: Phrases in a description which say that an operation is refused the second time.
ONCE: Final = re.compile(r"\b(?:second time|twice)\b[^.;]*\b(?:409|refuse[sd]?|conflict)\b", re.IGNORECASE)
# The subject of such a condition, and its predicate; words beside a state in that.
_IS: Final = re.compile(r"\b(unless )?(?<!of )(it|the [\w-]+) (?:is|are) (not |no longer )?([^.;:]*)", re.IGNORECASE)
_BESIDE: Final = re.compile(
    r"\b(?:already|still|currently|also|yet|now|been|any ?more|any longer)\b|[`()]", re.IGNORECASE
)
_STATE_NAMES: Final = frozenset({"state", "status", "phase", "mode"})
# Phrases in a description on what an operation does in every other state.
_ELSE: Final = re.compile(r"\b(?:an)?other (?:state|status|phase|mode)|\botherwise\b", re.IGNORECASE)
# A phrase for the state to which an operation leads, as in "queued becomes running".
_BECOMES: Final = re.compile(r"\b(?:becomes?|goes (?:in)?to) `?[\w-]+", re.IGNORECASE)
# Words for other conditions on which an operation is refused, and for the state alone.
_CONDITION: Final = re.compile(
    r"\b(?:if|when|while|unless|until|except|only|may|can|as long as|and in|and with|mode|not|never|no)\b",
    re.IGNORECASE,
)
_ON_STATE: Final = re.compile(r"\b(?:state|status|phase)\b", re.IGNORECASE)
_OTHER: Final = re.compile(r"\b(?:or|another|if|when|while|unless)\b", re.IGNORECASE)
_NEGATED: Final = re.compile(r"\b(?:not|never|unless|except|cannot|no)\b", re.IGNORECASE)
# States that a thing leaves by an operation alone.
_RESTING: Final = frozenset({"paused", "suspended", "draft", "archived"})


class Transitions:
    """Judges operations in states in which they are refused by the description, by the read before them."""

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        self._reads = {path: read for path, read in reads_of(operations).items() if collection_of(path)}
        # The things on whose state it depends, by path template, and what each forbids, by operation.
        self._barred = {
            operation.label: found
            for operation in operations
            if operation.method not in SAFE and "409" in operation.responses
            if (
                found := {
                    path: barred_by(operation, one) for path, one in self._reads.items() if _is_at(operation, path)
                }
            )
        }
        # Operations on a thing that are refused the second time.
        self._once = {one.label for one in operations if one.parameter("path") and ONCE.search(one.text)}
        self._done: set[str] = set()  # paths of those that were accepted
        # Members of the thing at the last read, by path.
        self._seen: dict[str, dict[str, Any]] = {}
        self._taken: Counter[tuple[str, str]] = Counter()
        # The states from which it must be accepted, by operation; then things that were refused in one of them.
        self._starts = {
            one.label: starts
            for one in operations
            if (read := self._reads.get(one.template.rpartition("/")[0])) and (starts := starts_of(one, read))
        }
        self._due: dict[str, Occasion] = {}
        self._refused: dict[str, set[str]] = defaultdict(set)

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, status = occasion.operation, occasion.response.status
        path = occasion.context.target.partition("?")[0].rstrip("/")
        if occasion.request.method in SAFE:
            if occasion.request.method == "GET" and operation is not None:
                yield from self._judge_refusal(occasion, path)
                self._read(occasion, operation.template.rstrip("/"), path)
            return
        if operation is not None and occasion.context.usual:
            if operation.label in self._once and path in self._done:
                expected, cause = "a refusal, as it was done before", f"{operation.label} twice"
                yield occasion.case("description/states", not occasion.response.ok, expected, cause=cause)
            for template, barred in self._barred.get(operation.label, {}).items():
                yield from self._act(occasion, operation, barred, "/".join(path.split("/")[: template.count("/") + 1]))
            self._keep_refusal(occasion, operation, path)
        if not refuses(status, operation):
            self._seen.clear()
            self._due.clear()
            is_once = operation is not None and operation.label in self._once
            self._done = {*self._done, path} if is_once else set()
            for at in (path, path.rpartition("/")[0]) if operation is not None and status == HTTPStatus.OK else ():
                template = operation.template.rstrip("/") if operation else ""
                read = self._reads.get(template if at == path else template.rpartition("/")[0])
                # A device may reach other states later than it tells them.
                if read is not None and operation is not None and operation.shape == read.shape:
                    name = state_member(read)
                    told = state_in(occasion, name) if name else ""
                    self._seen |= {at: {name: told}} if told.casefold() in FINAL else {}

    def _act(
        self, occasion: Occasion, operation: Operation, barred: dict[str, frozenset[str]], path: str
    ) -> Iterator[Case]:
        """Judge an operation by the thing's state before it. A state that changes by itself may have changed since."""
        for name, states in barred.items():
            value = self._seen.get(path, {}).get(name)
            state = text_of(value) if isinstance(value, str | bool) else ""
            if state:
                is_taken = occasion.response.ok and state in states
                self._taken[operation.label, state] += is_taken
                is_sure = isinstance(value, bool) or state in FINAL or state.casefold() in _RESTING
                is_sure |= self._taken[operation.label, state] >= TWICE
                if not is_taken or is_sure:
                    expected = f"a refusal with 409, as the description says where {name} is {state}"
                    found, cause = f"status {occasion.response.status}", f"{operation.label} {name} {state}"
                    yield occasion.case("description/states", not is_taken, expected, found, cause=cause)

    def _keep_refusal(self, occasion: Occasion, operation: Operation, path: str) -> None:
        """Keep a refusal for the state of a thing from which the operation starts, by its description."""
        label, above = operation.label, path.rpartition("/")[0]
        states = self._starts.get(label, frozenset())
        name = state_member(self._reads[operation.template.rpartition("/")[0]]) if states else ""
        if self._seen.get(above, {}).get(name) in states:
            if occasion.response.status == HTTPStatus.CONFLICT and occasion.is_valid:
                self._due[above] = occasion
            elif occasion.response.ok:
                self._starts[label] = frozenset()  # it is accepted at times

    def _judge_refusal(self, occasion: Occasion, path: str) -> Iterator[Case]:
        """Judge a refusal by the next read, if the thing is in the same state, and others were refused as well."""
        sent = self._due.pop(path, None)
        if sent is None or sent.operation is None or not occasion.response.ok:
            return
        label = sent.operation.label
        name = state_member(self._reads[sent.operation.template.rpartition("/")[0]])
        if state := state_in(occasion, name):
            is_same = state == self._seen.get(path, {}).get(name) and state in self._starts[label]
            self._refused[label] |= {path} if is_same else set()
            if len(self._refused[label]) >= TWICE:
                expected = f"a status other than 409, as {label} starts from {state} by its description"
                found = f"status 409, and {state} as {name} before and after it"
                yield sent.case("description/states", not is_same, expected, found, cause=f"{label} {state} refused")

    def _read(self, occasion: Occasion, template: str, path: str) -> None:
        """Record the members of a thing as read."""
        answer, read = occasion.response, self._reads.get(template)
        is_usable = read is not None and answer.ok and is_json(answer.media_type) and len(answer.body) <= MOST_OCTETS
        shape = flat(read.shape or {}).get("properties", {}) if read is not None else {}
        now = occasion.members(shape) if is_usable else {}
        self._seen.pop(path, None)
        if now and len(self._seen) < _MOST_THINGS:
            self._seen[path] = now


def _is_at(operation: Operation, path: str) -> bool:
    """Return whether an operation acts on a thing with this path template, or on something below it."""
    return f"{operation.template}/".startswith(f"{path}/")


def barred_by(operation: Operation, read: Operation) -> dict[str, frozenset[str]]:
    """Return the values of a thing's members with which an operation is refused by its description, by member.

    That says "409 if the job is running", "409 unless it is queued", or "in another state it is answered 409".
    """
    parts, name = flat(read.shape or {}).get("properties", {}), state_member(read)
    # Its values, with the word for each in a text, by member.
    known = {word: {"true": word, "false": ""} for word, one in parts.items() if kinds_of(one) == {"boolean"}}
    known |= {name: {state: state for state in states_of(read, name)}} if name else {}
    thing, found = singular(collection_of(read.template).rpartition("/")[2]), defaultdict[str, set[str]](set)
    is_own = operation.template.count("{") == read.template.count("{")
    conditions = [found[1] for said in (_REFUSED, _WHILE) for found in said.finditer(operation.text)]
    conditions += [f"unless {found[1]}" for found in _ONLY_WHILE.finditer(operation.text)]
    # The description of a 409 is a condition itself, if it does not say what is needed.
    conditions += [text for text in re.split(r"[.;:]\s", operation.conflict) if not _NEEDS.search(text)]
    only = {one.lower() for one in _ONLY.findall(operation.conflict)} & known[name].keys() if name and is_own else set()
    for said in (clause for condition in conditions for clause in _AND_WHILE.split(condition)):
        for unless, subject, no, rest in _IS.findall(said):
            for member, values in known.items() if subject.lower() in {f"the {thing}", *(["it"] * is_own)} else ():
                if named := _values_in(rest, values):
                    found[member] |= set(values) - named if bool(unless) != bool(no) else named
    for said in _CANNOT.finditer(operation.text) if name and is_own and "409" in operation.responses else ():
        if not _NEGATED.search(text := said[1] or said[2]):
            named = {state for state in known[name] if word_of(state).search(text)}
            found[name] |= named or (FINAL & known[name].keys() if _ENDED.search(text) else set())
    starts = _states_named(operation, set(known[name])) if name and operation.method == "POST" and is_own else set()
    if (starts | only) and not found[name]:
        found[name] = set(known[name]) - starts - only
    return {member: frozenset(values) for member, values in found.items() if values}


def starts_of(operation: Operation, read: Operation) -> frozenset[str]:
    """Return the states from which an operation is accepted by its description, if that names no other condition.

    It says "paused becomes running. In every other status: 409", and what it says of 409 is the state alone.
    """
    name, text = state_member(read), operation.text
    states = set(states_of(read, name)) if name and operation.method == "POST" else set()
    conflict = next(iter(re.split(r"[.;]", operation.conflict)), "")
    is_on_state = (" " not in conflict or _ON_STATE.search(conflict)) and not _OTHER.search(conflict)
    if another_of(operation) or _CONDITION.search(text) or not is_on_state:
        return frozenset()
    said = [found[1] for found in re.finditer(rf"([^.;:]*?)\b{_BECOMES.pattern[2:]}", text, re.IGNORECASE)]
    before = {state for state in states if any(word_of(state).search(item) for item in said)}
    return frozenset(before & (states - barred_by(operation, read).get(name, frozenset())))


def _values_in(predicate: str, words: dict[str, str]) -> set[str]:
    """Return the values that begin a predicate, as in "running or paused, or has items"; none if it has "and"."""
    found = set[str]()
    for part in re.split(r"\s*,\s*(?:or\s+)?|\s+or\s+", predicate.strip()):
        text = _BESIDE.sub("", part).strip()
        value = next((value for value, word in words.items() if word and word_of(word).fullmatch(text)), "")
        if not value:
            return set() if part.startswith("and ") else found
        found.add(value)
    return found


def _states_named(operation: Operation, states: set[str]) -> set[str]:
    """Return the states that an operation starts from, by the description; none where they may mean something else."""
    sentences = re.split(r"(?<=[.;])\s+", operation.text)
    said = [_BECOMES.sub("", sentence) for sentence in sentences if not _ELSE.search(sentence)]
    named = {state: [item for item in said if word_of(state).search(item)] for state in states}
    is_open = any(_NEGATED.search(item) or "409" in item for found in named.values() for item in found)
    is_said = any(_ELSE.search(sentence) and "409" in sentence for sentence in sentences)
    return {state for state, found in named.items() if found} if is_said and not is_open else set()


def state_member(read: Operation) -> str:
    """Return the member that contains a thing's state; empty if there is none."""
    parts = flat(read.shape or {}).get("properties", {}) if collection_of(read.template) else {}
    named = (
        name for name, one in parts.items() if plain_name(name) in _STATE_NAMES and len(flat(one).get("enum", ())) > 1
    )
    # A mode is the state of what has no other one.
    return min(named, key=lambda name: plain_name(name) == "mode", default="")
