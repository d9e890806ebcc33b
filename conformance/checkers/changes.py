"""States of things over all reads of a run: by which operations they start, and that a finished thing stays finished.

`checkers.writes` judges what PUT and PATCH change.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import unquote

from conformance.api.call_rules import words_of
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import collection_of, doubt_of_life
from conformance.checkers.occasion import ABSENT, MOST_OCTETS, SETTLES_S, Occasion
from conformance.checkers.untouched import KEEPS
from conformance.contract.pack import Contract
from conformance.documents.json_schema import Schema, is_number, kinds_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import SAFE, Operation, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.verdict.evidence import Case

_MOST_THINGS: Final = 1_000
#: How often a change of state must follow an operation, because once may be by chance.
TWICE: Final = 2
_KEPT: Final = "description/refused-keeps"
# How the refusal of a client without valid credentials is noted.
_STRANGER: Final = ("with status 401", "with status 403")
# Phrases in a description: for the state to which an operation leads, and for the conditions on which it is refused.
_LEADS: Final = re.compile(
    r"\b(?:is|are) (?:then|now|afterwards) `?([\w-]+)|\b(?:becomes?|goes (?:in)?to|turns) `?([\w-]+)", re.IGNORECASE
)
_STATES: Final = frozenset({"state", "status", "phase"})
_CANCELLED: Final = frozenset({"cancelled", "canceled", "aborted"})
#: States in which an activity has come to its own end.
DONE: Final = frozenset({"done", "finished", "completed", "complete", "succeeded"})
#: States in which an activity has ended.
FINAL: Final = _CANCELLED | DONE
# States of a thing that was put away. A final state may change to one of them.
_AWAY: Final = frozenset({"archived", "expired", "deleted", "removed", "purged"})
#: Operations that end or interrupt an activity.
ENDING: Final = frozenset({"cancel", "abort", "stop", "pause", "halt", "interrupt"})
# Phrases in a description which say that an operation is refused while another thing is in a certain state.
_ANOTHER: Final = re.compile(r"\b(?:while|if|when) (?:another\b|one is\b)[^.;]*", re.IGNORECASE)
# Words in such a phrase for things that share something: two that do not share it may be in that state.
_SHARING: Final = re.compile(r"\b(?:same|its|this|that|each|per|on|of|for|in|with|by|not)\b", re.IGNORECASE)
# Phrases in a description which say that a number never decreases.
_GROWS: Final = re.compile(
    r"\b(?:never|not) (?:falls?|decreases?|drops?|goes? (?:back|down))\b(?! (?:below|under|to))"
    r"|\bonly (?:grows?|rises?|increases?)\b",
    re.IGNORECASE,
)
# Phrases in a description which say that a state is final, and phrases that limit this.
_IS_FINAL: Final = re.compile(
    r"((?:[^.;:]*[;:,] (?=(?:both|all(?: of them)?|they|these|that|it) (?:is|are) ))?[^.;:]*?)"
    r"\b(?:(?:is|are) (?:final|terminal)|for ?ever|never changes? (?:again|any more))\b",
    re.IGNORECASE,
)
_STAYS_SO: Final = re.compile(r"\b(?:stays|remains) `?([\w-]+)`?(?=[.;]|$)")
_UNLESS: Final = re.compile(r"\b(?:not|no|if|unless|until|when|while|before|after|except|others?)\b", re.IGNORECASE)
# Why a finding may be no fault: the description does not exclude it.
_OWN_REASON: Final = "the thing may have changed its state for a reason of its own"
# Members with the time at which a thing has ended.
_END: Final = re.compile(r"(?:finished|ended|completed|cancell?ed|stopped)(?:at|on|time|date)")
# Operations after which a counter may start again.
_ANEW: Final = frozenset({"reset", "clear", "restart", "reboot", "restore", "zero"})


@dataclass
class _State:
    """The state of one thing.

    Attributes:
        value: as it was last read or told.
        at_s: when, s of the monotonic clock.
        was: what was read before an operation told it; empty if it was read.
        told: the operation that told it.
        by: an operation that was accepted since then, and must not change a final state; empty if there is none.
        refused: an operation of the thing that was refused since then.
        is_kept: whether its description says that nothing changes then.
        ends: the times of its end that were read with it.
    """

    value: str
    at_s: float
    was: str = ""
    told: str = ""
    by: str = ""
    refused: str = ""
    is_kept: bool = False
    ends: Mapping[str, Any] = field(default_factory=dict)


class Changes:
    """Judges each read of a resource by the requests before it."""

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        reads = reads_of(operations)
        self._states = {
            template: name for template, one in reads.items() if collection_of(template) and (name := state_of(one))
        }
        # States that the description calls final, by the thing's path template.
        self._said_final = {
            template: said
            for template, name in self._states.items()
            if (said := _final(reads[template], name, operations))
        }
        # States that only one thing at a time may be in, by operation.
        things = {name: states_of(reads[name], member) for name, member in self._states.items()}
        # Accepted operations since the last read.
        self._alone = {
            operation.label: found
            for operation in operations
            if (found := _alone(operation, things.get(operation.template.rpartition("/")[0], ())))
        }
        # Such states, by what the description says of its creation, by the thing's path template.
        self._single = {
            template: found
            for operation in operations
            for template, states in things.items()
            if (operation.method, operation.template.rstrip("/")) == ("POST", collection_of(template))
            if (found := _alone_states(operation, states))
        }
        # The state to which it leads by its description, by operation.
        self._leads = {
            operation.label: state
            for operation in operations
            if (template := operation.template.rpartition("/")[0]) in self._states
            if (state := leads_to(operation, reads[template], self._states[template]))
        }
        self._claims: dict[str, list[tuple[Occasion, frozenset[str]]]] = defaultdict(list)
        # Members that never decrease, by path template. Below, by path: their last values.
        self._growing = {
            operation.template.rstrip("/"): names for operation in reads.values() if (names := _growing(operation))
        }
        self._grown: dict[str, tuple[dict[str, Any], float]] = {}
        # The thing as it was last read, and the DELETE of it that was refused since then, by path.
        self._there: dict[str, str] = {}
        self._known: dict[str, _State] = {}
        # How often what was refused has cancelled a thing, by the read and the method.
        self._undone = Counter[tuple[str, str]]()
        # Paths of things that an operation ends, now or in a while.
        self._ending: set[str] = set()
        # The state that a thing had at the end, where the description calls that final, by path.
        self._ended: dict[str, str] = {}
        # By the operation that reads them: things that were gone after a client without valid credentials wanted to
        # delete one, and whether one stayed.
        self._gone, self._staying = Counter[str](), set[str]()

    def forget(self) -> None:
        """Forget all states that a request of unknown effect may have changed."""
        self._there.clear()
        self._known.clear()
        self._claims.clear()
        self._grown.clear()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, method, status = occasion.operation, occasion.request.method, occasion.response.status
        path = unquote(occasion.context.target.partition("?")[0]).rstrip("/")
        if method in SAFE:
            if method == "GET" and operation is not None and occasion.context.plain:
                yield from self._read(occasion, operation, path)
        elif refuses(status, operation):
            said = f"{method} {path} with status {status}"
            is_kept = status == HTTPStatus.CONFLICT and operation is not None and KEEPS.search(operation.conflict)
            for state in (self._known[one] for one in (path, path.rpartition("/")[0]) if one in self._known):
                state.refused, state.is_kept = said, bool(is_kept)
            if method == "DELETE" and path in self._there:
                self._there[path] = said
        else:
            self._there.clear()
            if words_of(path) & _ANEW:
                self._grown.clear()
            elif method != "POST":
                self._grown = {key: one for key, one in self._grown.items() if not f"{key}/".startswith(f"{path}/")}
            yield from self._act(occasion, operation, path)

    def _act(self, occasion: Occasion, operation: Operation | None, path: str) -> Iterator[Case]:
        """Take a request that was accepted, or may have been."""
        template = operation.template.rstrip("/") if operation is not None else ""
        above, item = path.rpartition("/")[0], template.rpartition("/")[0]
        if operation is not None and occasion.response.ok and state_of(operation) == self._states.get(item, "-"):
            yield from self._judge_growth(occasion, item, above)
        if operation is not None and occasion.response.ok and item in self._states:
            yield from self._judge_change(occasion, operation, above, self._states[item])
        elif operation is not None and occasion.response.ok and template in self._states:
            self._known.pop(path, None)
            self._ended.pop(path, None)
        elif operation is None or f"{template}/" not in {f"{collection_of(state)}/" for state in self._states}:
            self._known.clear()

    def _judge_change(self, occasion: Occasion, operation: Operation, path: str, name: str) -> Iterator[Case]:
        """Judge the response to an operation on a thing: a finished thing cannot be ended again."""
        before = self._known.pop(path, None)
        self._ending |= {path} if words_of(operation.template) & ENDING else set()
        now = state_in(occasion, name) if state_of(operation) == name else ""
        was = before.value if before is not None and not before.told else ""
        template = operation.template.rstrip("/").rpartition("/")[0]
        if now and before is not None and before.value in self._said_final.get(template, ()):
            expected = f"{before.value} as {name}, which is final by the description, or a refusal"
            holds = now == before.value or now.casefold() in _AWAY
            yield self._case(occasion, holds, expected, f"{now} as {name}", operation.label, doubt="")
        is_kept = was.casefold() in FINAL and "409" in operation.responses and words_of(operation.template) & ENDING
        if is_kept and now:
            expected = f"a refusal, as the thing was {was}, or the same state"
            yield self._case(occasion, now == was, expected, f"{now} as {name}", operation.label)
        if now in self._alone.get(operation.label, ()):
            self._claim(occasion, path, frozenset({now}))
        if now:
            # A device may act later than it responds.
            now = self._leads.get(operation.label, now) if now == was else now
            is_news = now != was
            at_s = occasion.response.received_s
            self._known[path] = _State(now, at_s, was if is_news else "", operation.label if is_news else "")
        elif is_kept and before is not None:
            self._known[path] = _State(was, before.at_s, by=operation.label)

    def _claim(self, occasion: Occasion, path: str, states: frozenset[str]) -> None:
        """Note for each other thing of the collection that has one of some states that another one has one too."""
        for other, state in self._known.items():
            if state.value in states and other != path and other.rpartition("/")[0] == path.rpartition("/")[0]:
                self._claims[other].append((occasion, states))

    def _read(self, occasion: Occasion, operation: Operation, path: str) -> Iterator[Case]:
        """Judge a read of a resource."""
        status = occasion.response.status
        refused = self._there.pop(path, "")
        if status in ABSENT and refused:
            # Things end by themselves, but not each time that a client without credentials wants to delete one.
            self._gone[operation.label] += refused.endswith(_STRANGER)
            is_sure = self._gone[operation.label] >= TWICE and operation.label not in self._staying
            is_sure = is_sure and not doubt_of_life(operation)
            expected = f"what was there before {refused}"
            doubt = "" if is_sure else "the thing may have ended by itself"
            yield occasion.case(_KEPT, False, expected, cause=operation.label, doubt=doubt)  # noqa: FBT003 - see case()
        if not occasion.response.ok:
            return
        if refused:
            self._staying |= {operation.label} if refused.endswith(_STRANGER) else set()
            expected = f"what was there before {refused}"
            yield occasion.case(_KEPT, True, expected, cause=operation.label)  # noqa: FBT003 - see case()
        if len(self._there) < _MOST_THINGS:
            self._there[path] = ""
        template = operation.template.rstrip("/")
        yield from self._judge_growth(occasion, template, path)
        if template in self._states and (state := state_in(occasion, self._states[template])):
            yield from self._state(occasion, operation, path, state)

    def _state(self, occasion: Occasion, operation: Operation, path: str, now: str) -> Iterator[Case]:
        """Judge the state of a thing by its earlier states in responses."""
        template = operation.template.rstrip("/")
        name, sent_s = self._states[template], occasion.sent_s
        yield from self._judge_claims(occasion, path, now)
        if now in (single := self._single.get(template, frozenset())):
            self._claim(occasion, path, single)
        yield from self._judge_final(occasion, operation, path, now)
        before, ends = self._known.get(path), _ends_in(occasion) if now in FINAL else {}
        if before is None or sent_s < before.at_s:
            if before is None and len(self._known) < _MOST_THINGS:
                self._known[path] = _State(now, occasion.response.received_s, ends=ends)
            return
        moved = [one for one in ends if before.ends.get(one, ends[one]) != ends[one] and now == before.value]
        if ends and before.ends:
            expected = f"the {', '.join(ends)} of what was {now} before"
            found = f"{ends[moved[0]]} as {moved[0]}, and {before.ends[moved[0]]} before" if moved else ""
            is_said = now in _CANCELLED or now in self._said_final.get(template, ())
            cause, doubt = f"{operation.label} end", "" if is_said else "it may have run again meanwhile"
            yield occasion.case("description/states", not moved, expected, found, cause=cause, doubt=doubt)
        is_late = sent_s - before.at_s > SETTLES_S
        # The state that the response announced has not come yet.
        if before.told and now != before.value and now.casefold() not in FINAL and not is_late:
            return
        is_said = before.value in self._said_final.get(template, ())
        is_final = is_said or before.value.casefold() in FINAL
        wrong, expected = "", f"{before.value} as {name}, as it was read before"
        if before.told and now != before.value:
            expected = f"{before.value} as {name}, to which {before.told} led by its response or description"
            lost = before.value.casefold() in FINAL and now.casefold() not in _AWAY
            wrong = now if lost or (now == before.was and is_late) else ""
        elif before.refused and now.casefold() in _CANCELLED and not is_final and path not in self._ending:
            expected += f" and as {before.refused} must leave it"
            wrong, label = now, before.refused.partition(" ")[0]
            self._undone[operation.label, label] += before.is_kept
            is_said = before.is_kept and self._undone[operation.label, label] >= TWICE
        elif is_final and now != before.value and now.casefold() not in _AWAY:
            reason = before.refused or before.by
            expected += f" and as {reason} must leave it" if reason else ""
            # A thing that is done may start again by itself, for example by a timetable.
            wrong = now if is_said or reason or before.value.casefold() in _CANCELLED or now.casefold() in FINAL else ""
        doubt = "" if is_said else _OWN_REASON
        yield self._case(occasion, not wrong, expected, f"{now} as {name}", operation.label, doubt=doubt)
        self._known[path] = _State(now, occasion.response.received_s, ends=ends)

    def _judge_final(self, occasion: Occasion, operation: Operation, path: str, now: str) -> Iterator[Case]:
        """Judge whether a thing that was in a final state is still in that state, whatever was sent since."""
        template = operation.template.rstrip("/")
        final, name = self._ended.get(path, ""), self._states[template]
        if final and path not in self._known:
            holds, expected = now == final or now.casefold() in _AWAY, f"{final} as {name}, which is final"
            yield self._case(occasion, holds, expected, f"{now} as {name}", operation.label, doubt="")
        if now in self._said_final.get(template, ()) and len(self._ended) < _MOST_THINGS:
            self._ended[path] = now

    def _judge_claims(self, occasion: Occasion, path: str, now: str) -> Iterator[Case]:
        """Judge whether another thing had a state while this one had it too, which one alone may have."""
        for claim, states in self._claims.pop(path, ()):
            if now in states and occasion.sent_s >= claim.response.received_s:
                label = claim.operation.label if claim.operation is not None else ""
                state = " or ".join(sorted(states))
                other = f"a state other than {state}" if claim.request.method == "GET" else "a refusal with 409"
                expected = f"{other}, as {path} was {now} before and after it, and one alone may be so"
                yield claim.case("description/states", False, expected, cause=f"{label} another")  # noqa: FBT003

    def _judge_growth(self, occasion: Occasion, template: str, path: str) -> Iterator[Case]:
        """Judge the members of a thing that never decrease, by the description."""
        names, answer = self._growing.get(template, frozenset()), occasion.response
        now = {name: one for name, one in occasion.members(names).items() if name in names and is_number(one)}
        before, at_s = self._grown.get(path, ({}, 0.0))
        if occasion.sent_s >= at_s and now:
            for name in now.keys() & before.keys():
                expected = f"at least {before[name]} as {name}, which never falls by the description"
                holds, cause = now[name] >= before[name], f"{template} {name} falls"
                yield occasion.case("description/states", holds, expected, f"{now[name]} as {name}", cause=cause)
            self._grown[path] = now, answer.received_s

    @staticmethod
    def _case(
        occasion: Occasion,
        holds: bool,  # noqa: FBT001 - as case()
        expected: str,
        found: str,
        cause: str,
        doubt: str = _OWN_REASON,
    ) -> Case:
        return occasion.case("description/states", holds, expected, found, cause=f"{cause} state", doubt=doubt)


def _ends_in(occasion: Occasion) -> dict[str, Any]:
    """Return the times in a response at which a thing has ended."""
    value = read_json(occasion.response.body).value
    found = {str(name): one for name, one in value.items() if isinstance(one, str)} if isinstance(value, dict) else {}
    return {name: one for name, one in found.items() if _END.fullmatch(plain_name(name))}


def reads_of(operations: Iterable[Operation]) -> dict[str, Operation]:
    """Return the GET operations whose response has a schema, by path template."""
    return {one.template.rstrip("/"): one for one in operations if one.method == "GET" and one.shape}


def state_of(read: Operation) -> str:
    """Return the member that contains a thing's state, if some of its values are final; empty if there is none."""
    outer = flat(read.shape or {}).get("properties", {})
    inner = [flat(item).get("properties", {}) for item in outer.values() if isinstance(item, dict)]
    parts = ((name, flat(one)) for part in (outer, *inner) for name, one in part.items() if isinstance(one, dict))
    named = (
        str(name)
        for name, one in parts
        if plain_name(name) in _STATES and FINAL & {str(item).casefold() for item in one.get("enum", ())}
    )
    return next(named, "")


def another_of(operation: Operation) -> str:
    """Return the states of another thing in which an operation is refused, as its description puts it."""
    is_conflict = operation.conflict.lower().startswith("another ")
    return " ".join([found[0] for found in _ANOTHER.finditer(operation.text)] + [operation.conflict] * is_conflict)


def _alone(operation: Operation, states: tuple[str, ...]) -> frozenset[str]:
    """Return the states of another thing in which an operation is refused, also those that are words in backticks."""
    said = re.findall(r"`([\w -]+)`", another_of(operation)) if "409" in operation.responses else ()
    return _alone_states(operation, states).union(said)


def _alone_states(operation: Operation, states: tuple[str, ...]) -> frozenset[str]:
    """Return the states that only one thing may have at a time, according to the description."""
    said = another_of(operation)
    if "409" not in operation.responses or _SHARING.search(said.partition(",")[0]):
        return frozenset()
    return frozenset(state for state in states if word_of(state).search(said))


def states_of(read: Operation, name: str) -> tuple[str, ...]:
    """Return the values of a member by the schema of a read."""
    return tuple(map(str, flat(flat(read.shape or {}).get("properties", {}).get(name, {})).get("enum", ())))


def leads_to(operation: Operation, read: Operation, name: str) -> str:
    """Return the one state to which an operation leads by its description, as in "The job is then paused"."""
    sentences = [text for text in re.split(r"[.;:]\s|, (?=and )", operation.text) if not _UNLESS.search(text)]
    said = {word for text in sentences for found in _LEADS.finditer(text) for word in found.groups() if word}
    found = [state for state in states_of(read, name) if state in said]
    return found[0] if len(found) == 1 else ""


def _growing(read: Operation) -> frozenset[str]:
    """Return the numbers of a resource that never become less by its description."""
    parts = flat(read.shape or {}).get("properties", {})
    given = {name: flat(one) for name, one in parts.items() if isinstance(one, dict)}

    def grows(name: str, schema: Schema) -> bool:
        said = re.compile(rf"\b{re.escape(name)}`? (?:{_GROWS.pattern})", re.IGNORECASE).search(read.text)
        return bool(said or _GROWS.search(str(schema.get("description", ""))))

    return frozenset(
        name for name, one in given.items() if kinds_of(one) & {"integer", "number"} and grows(str(name), one)
    )


def _final(read: Operation, name: str, operations: Iterable[Operation]) -> frozenset[str]:
    """Return the states of a thing that its operations call final, as in "done and failed are final"."""
    given = flat(flat(read.shape or {}).get("properties", {}).get(name, {}))
    own = [
        operation.text
        for operation in operations
        if f"{operation.template}/".startswith(f"{read.template.rstrip('/')}/")
    ]
    own.append(str(given.get("description", "")))
    said = [found[1] for text in own for found in _IS_FINAL.finditer(text) if not _UNLESS.search(found[1])]
    words = {word for text in said for word in re.findall(r"[\w-]+", text.casefold())}
    words |= {word for text in own for word in _STAYS_SO.findall(text.casefold()) if word in FINAL}
    return frozenset(str(item) for item in given.get("enum", ()) if str(item).casefold() in words)


def state_in(occasion: Occasion, name: str) -> str:
    """Return the state that a response shows in a member; empty if it has none."""
    found = occasion.members([name]).get(name) if len(occasion.response.body) <= MOST_OCTETS else None
    return found if isinstance(found, str) else ""


def word_of(state: str) -> re.Pattern[str]:
    """Return a pattern that finds a state in a text, its words apart in any way."""
    return re.compile(rf"\b{'[ _-]'.join(map(re.escape, re.split('[ _-]', state)))}\b", re.IGNORECASE)
