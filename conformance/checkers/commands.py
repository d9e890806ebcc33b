"""Judge commands named after a switch or state: the thing gets that state, and the response equals the next read.

A command is a POST below what a GET reads, such as `POST /pump/enable` beside `GET /pump`. Only a read, one command and
reads with nothing between them count.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final, NamedTuple

from conformance.api.call_rules import words_of
from conformance.api.rest.listing import listing_of
from conformance.api.rest.patches import same
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import id_member, object_in, parts_of
from conformance.checkers.changes import DONE, FINAL, leads_to, state_of
from conformance.checkers.occasion import SETTLES_S, Occasion
from conformance.checkers.transitions import state_member
from conformance.contract.pack import Contract
from conformance.documents.json_schema import kinds_of
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.verdict.evidence import Case

_TWICE = 2  # failures that count; a single one may be chance
_MOST = 1_000  # things that are remembered
_AT_ONCE_S = 0.15  # a read within this time shows what the response had to show, s
# Phrases in a description which say that a command acts later or not always, or that its response shows what was.
_LATER: Final = re.compile(
    r"\b(?:asynchron\w*|eventual\w*|later|schedul\w*|background|once|when|if|unless|previous(?:ly)?|before|after|request)\b",
    re.IGNORECASE,
)
#: States of an activity that goes on.
LIVE: Final = frozenset({"running", "active", "executing", "inprogress", "started", "moving", "working"})
_WAITING: Final = frozenset({"queued", "pending", "scheduled", "created", "new", "waiting", "accepted", "paused"})
_IDLE: Final = frozenset({"idle", "ready", "stopped"})
# Commands that keep an activity from its end.
_ENDS: Final = frozenset({"cancel", "abort"})
# For each command: names of the switch that it sets, or of the state that follows, and the states before it.
_OFF: Final = {
    "disable": "enable", "deactivate": "activate", "unlock": "lock", "close": "open", "disarm": "arm",
    "unmute": "mute", "off": "on",
}  # fmt: skip
_SWITCHES: Final = {
    "enable": ("enabled",), "activate": ("active", "activated"), "lock": ("locked",), "open": ("open", "opened"),
    "arm": ("armed",), "mute": ("muted",), "on": ("on",),
}  # fmt: skip
_STATES: Final = {
    "cancel": ({"cancelled", "canceled"}, LIVE | _WAITING), "abort": ({"aborted"}, LIVE | _WAITING),
    "pause": ({"paused"}, LIVE), "stop": ({"stopped", *_IDLE}, LIVE), "resume": (LIVE, {"paused"}),
    "start": (LIVE, _IDLE | {"created", "new", "paused"}),
    "lock": ({"locked"}, {"unlocked"}), "unlock": ({"unlocked"}, {"locked"}), "open": ({"open", "opened"}, {"closed"}),
    "close": ({"closed"}, {"open", "opened"}), "enable": ({"enabled"}, {"disabled"}),
    "disable": ({"disabled"}, {"enabled"}), "arm": ({"armed"}, {"disarmed"}), "disarm": ({"disarmed"}, {"armed"}),
}  # fmt: skip


class Command(NamedTuple):
    """An operation on a thing.

    Attributes:
        operation: a POST.
        read: the GET of the thing.
        switch: the boolean that it sets, and its value then; None if it sets none.
        state: the member with the thing's state, and the states from which the command leads to another; None: none.
        leads: that member, and the state to which the command leads by its description; None if it says none.
    """

    operation: Operation
    read: Operation
    switch: tuple[str, bool] | None
    state: tuple[str, frozenset[str]] | None
    leads: tuple[str, str] | None

    def is_due(self, before: dict[str, Any], now: dict[str, Any]) -> str:
        """Return the member that the command has to change and has not, or an empty text."""
        if self.leads is not None and str(before.get(self.leads[0])).casefold() not in FINAL:
            name, to = self.leads
            if name in before and before[name] == now.get(name) != to:
                return name
        if self.switch is not None:
            name, value = self.switch
            return name if before.get(name) is (not value) and now.get(name) is (not value) else ""
        if self.state is not None:
            name, states = self.state
            is_undone = bool(words_of(self.operation.template) & _ENDS) and plain_name(str(now.get(name))) in DONE
            return name if str(before.get(name)) in states and (before[name] == now.get(name) or is_undone) else ""
        return ""

    def other_state(self, answer: Any, before: dict[str, Any], now: dict[str, Any]) -> str:
        """Return the state in the response, if it or that at a read is not the one to which the command leads."""
        name, to = self.leads or ("", "")
        told = str(object_in(answer, {plain_name(one) for one in now}).get(name, to))
        # What is on its way says so.
        is_waiting = told.endswith("ing") or plain_name(told) in _WAITING
        is_astray = told == now.get(name) and not is_waiting and told.casefold() not in FINAL
        is_old = told == before.get(name) and now.get(name) == to
        return told if told != to and (is_astray or is_old) and before.get(name) != to else ""

    def untrue(self, answer: Any, before: dict[str, Any], now: dict[str, Any]) -> str:
        """Return the member that the response shows changed and a read does not, or an empty text."""
        told = object_in(answer, {plain_name(name) for name in now})
        if self.read.parameter("path") and id_member(told, self.read) != id_member(now, self.read):
            return ""
        own, shape = parts_of(self.operation.shape), parts_of(self.read.shape)
        # A response such as {"status": "ok"} is on the command itself.
        is_thing = len(shape) > 1 and all(flat(own.get(name, {})) == flat(part) for name, part in shape.items())
        names = (name for name in shape if is_thing and name in told and name in before)
        return next(
            (name for name in names if same(before[name], now.get(name)) and not same(told[name], now.get(name))), ""
        )


def commands_of(operations: list[Operation]) -> list[Command]:
    """Return the commands of an API."""
    reads = {one.template.rstrip("/"): one for one in operations if one.method == "GET" and listing_of(one) is None}
    found, paths = [], {one.template.rstrip("/") for one in operations if one.method == "GET"}
    for operation in operations:
        above, _, last = operation.template.rstrip("/").rpartition("/")
        read = reads.get(above)
        is_command = operation.method == "POST" and "{" not in last and operation.template.rstrip("/") not in paths
        if is_command and read is not None and parts_of(read.shape):
            words = words_of(last)
            verb = next(iter(words)) if len(words) == 1 and not _LATER.search(operation.text) else ""
            name = state_of(read)
            leads = (name, to) if name and (to := leads_to(operation, read, name)) else None
            found.append(Command(operation, read, _switch(verb, read), _state(verb, read), leads))
    return found


def _switch(verb: str, read: Operation) -> tuple[str, bool] | None:
    names = _SWITCHES.get(_OFF.get(verb, verb), ())
    parts = {
        plain_name(name).removeprefix("is"): name
        for name, part in parts_of(read.shape).items()
        if kinds_of(part) == {"boolean"}
    }
    return next(((parts[name], verb not in _OFF) for name in names if name in parts), None)


def _state(verb: str, read: Operation) -> tuple[str, frozenset[str]] | None:
    name = state_member(read)
    states = {str(one): plain_name(str(one)) for one in flat(parts_of(read.shape).get(name, {})).get("enum", ())}
    to, start = _STATES.get(verb, (frozenset(), frozenset()))
    usable = frozenset(one for one, plain in states.items() if plain in start)
    # An activity that has ended may be idle again, if the device has no state for an ended one.
    is_told = verb != "start" or bool(DONE & set(states.values()))
    return (name, usable) if usable and is_told and to & set(states.values()) else None


class Commands:
    """Judges the first reads after a command."""

    def __init__(self, contract: Contract) -> None:
        known = commands_of([*operations_of(contract)] if contract.openapi_path else [])
        self._commands = {one.operation.label: one for one in known}
        self._reads = {one.read.label for one in known}
        # The members of a thing at the last read, by path.
        self._seen: dict[str, dict[str, Any]] = {}
        self._sent: dict[str, tuple[Occasion, dict[str, Any]]] = {}  # the last command since then, and earlier ones
        # Members that change by themselves.
        self._moving: set[tuple[str, str]] = set()
        self._missed = Counter[str]()  # how often a command had no effect, or another than it said

    def forget(self) -> None:
        """Forget all reads: something else may have changed the things."""
        self._seen.clear()
        self._sent.clear()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, status = occasion.operation, occasion.response.status
        path = occasion.context.target.partition("?")[0].rstrip("/")
        if occasion.request.method in SAFE:
            is_read = occasion.request.method == "GET" and operation is not None and operation.label in self._reads
            if is_read and operation is not None and occasion.response.ok and occasion.context.plain:
                yield from self._read(occasion, operation, path)
        elif not refuses(status, operation):
            command = self._commands.get(operation.label) if operation is not None else None
            before = self._seen.get(above := path.rpartition("/")[0])
            self.forget()
            if command and before and occasion.response.ok and status != HTTPStatus.ACCEPTED:
                self._sent[above] = occasion, before

    def _read(self, occasion: Occasion, read: Operation, path: str) -> Iterator[Case]:
        now, before = occasion.members(parts_of(read.shape)), self._seen.get(path, {})
        sent, was = self._sent.get(path, (None, {}))
        self._moving |= {(read.label, name) for name in before if not sent and not same(before[name], now.get(name))}
        if sent is not None and sent.operation is not None and sent.response.received_s <= occasion.sent_s:
            command = self._commands[sent.operation.label]
            # The device may also change the state itself, but only to the state that the command leads to.
            state = (command.state or command.leads or ("",))[0]
            kept = {name: one for name, one in was.items() if name == state or (read.label, name) not in self._moving}
            yield from self._judge(occasion, command, kept, now)
        if path not in self._sent and len(self._seen) < _MOST:
            self._seen[path] = now

    def _judge(
        self, occasion: Occasion, command: Command, before: dict[str, Any], now: dict[str, Any]
    ) -> Iterator[Case]:
        """Judge a command by a read after it, if the device has acted or had the time for it."""
        path = occasion.context.target.partition("?")[0].rstrip("/")
        sent = self._sent[path][0]
        label, answer = command.operation.label, sent.response
        told = read_json(answer.body).value if is_json(answer.media_type) else None
        untrue = "" if _LATER.search(command.operation.text) else command.untrue(told, before, now)
        missed = command.is_due(before, now)
        other = command.other_state(told, before, now) if command.leads and not missed else ""
        if command.leads and not missed and occasion.sent_s - answer.received_s < _AT_ONCE_S:
            self._missed[f"{label} other"] += bool(other)
            if not other or self._missed[f"{label} other"] >= _TWICE:
                expected = f"{command.leads[1]} as {command.leads[0]}, to which {label} leads by its description"
                found, cause = f"{other} as {command.leads[0]} in its response", f"{label} leads"
                yield sent.case("description/states", not other, expected, found, cause=cause)
        is_over = bool(missed) and plain_name(str(now.get(missed))) in DONE
        if (untrue or missed) and not is_over and occasion.sent_s - answer.received_s < SETTLES_S:
            return
        del self._sent[path]
        for id_, name in (("description/written-is-read", untrue), ("description/states", missed)):
            self._missed[f"{label} {id_}"] += bool(name)
            if not name or self._missed[f"{label} {id_}"] >= _TWICE:
                why = "for which it is named" if id_ == "description/states" else "that its response shows"
                expected = f"the effect of {label} {why}"
                found = f"{clip(now.get(name))} as {name}" + ", as before" * same(before.get(name), now.get(name))
                yield occasion.case(id_, not name, expected, found, cause=label)
