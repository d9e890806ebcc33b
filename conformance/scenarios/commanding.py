"""Send commands to things, such as `POST /jobs/{id}/cancel`, and read the things before and after each."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Final
from urllib.parse import quote

from conformance.api.call_rules import words_of
from conformance.api.rest.inputs import Inputs, request_of, usual_inputs, with_new_values
from conformance.api.rest.listing import items_of
from conformance.api.rest.things import collection_of, creator_of, identifier_of, object_in, parts_of
from conformance.api.rest.variations import Kind, Variation
from conformance.checkers.changes import ENDING
from conformance.checkers.commands import LIVE, Command, commands_of
from conformance.checkers.occasion import SETTLES_S
from conformance.checkers.transitions import barred_by
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation
from conformance.documents.parameters import plain_name
from conformance.scenarios.creating import FULL, created_path, location_of
from conformance.scenarios.singletons import is_free
from conformance.scenarios.survey import Probe, Surveyor
from conformance.scenarios.writing import Writer
from conformance.transport.exchange import NoAnswerError, Outgoing

_MOST = 12  # most commands that are tried, and most tries of each
_TURNS = 2
_PAUSE_S = 0.3  # between two reads of a thing that has not acted yet, s
# Bodies that are tried until one is taken.
_TRIED: Final = 8
_CREATED: Final = frozenset({201, 202})
_AGAIN: Final = Variation(Kind.AGAIN, "", "", Inputs())
#: Time after which a thing that was commanded is read again, s.
_LASTS_S: Final = 1.5


def send_commands(surveyor: Surveyor, operations: Mapping[tuple[str, str], Operation]) -> None:
    """Create things that are made later (202), and send each command twice, to new things where that is possible."""
    _accept(surveyor, operations)
    known = [one for one in commands_of([*operations.values()]) if is_free(one.operation, one.operation.template)]
    sender, again = _Sender(surveyor, operations, known[:_MOST]), list[tuple[Operation, Outgoing]]()
    began = time.monotonic()
    for turn in range(_TURNS):
        for command in sender.known:
            with suppress(NoAnswerError):  # the survey reports a broken connection
                read = sender.send(command, turn)
                if read is not None and command.state is not None:
                    again.append((command.read, read))
    if again:
        time.sleep(max(0.0, _LASTS_S - (time.monotonic() - began)))
    for operation, read in again:
        with suppress(NoAnswerError):
            surveyor.send(operation, _AGAIN, read)


def _accept(surveyor: Surveyor, operations: Mapping[tuple[str, str], Operation]) -> None:
    """Create things of other values each time where a creation is answered 202, and read them if they are there."""
    writer = Writer(surveyor.api, surveyor.values)
    for (method, template), read in operations.items():
        create = creator_of(operations, read) if method == "GET" and collection_of(template) else None
        if create is None or "201" in create.responses or "202" not in create.responses:
            continue
        for turn in range(_TURNS + 1):
            bodies = writer.bodies(create, turn)
            inputs = usual_inputs(create, surveyor.values)[0]
            inputs = replace(inputs, body=bodies[0]) if bodies else inputs
            with suppress(NoAnswerError):
                made = surveyor.send(create, Variation(Kind.AGAIN, "", "", inputs)).exchange
                path = location_of(surveyor.api, read, made) if made is not None and made.response.ok else ""
                if path:
                    whole = replace(request_of(read, usual_inputs(read, surveyor.values)[0]), target=path)
                    surveyor.send(read, _AGAIN, whole)


@dataclass
class _Sender:
    surveyor: Surveyor
    operations: Mapping[tuple[str, str], Operation]
    known: list[Command]
    # Whether what ran was ended, as it may keep other things from running.
    is_calm: bool = False

    def send(self, command: Command, turn: int) -> Outgoing | None:
        """Send a command, and read its thing until it has acted; return that read, or None if it has not."""
        whole = self._thing_of(command)
        was = self._lead(command, whole)
        sent = None if was is None else self._act(command.operation, command.read, whole, turn)
        until = time.monotonic() + SETTLES_S + _PAUSE_S
        while was is not None and sent is not None and sent.ok and sent.exchange is not None:
            now, told = self._read(command.read, whole), read_json(sent.exchange.response.body).value
            is_done = now is not None and not (command.is_due(was, now) or command.untrue(told, was, now))
            if is_done or now is None or time.monotonic() > until:
                self._calm(command.read, whole)
                return whole if is_done else None
            time.sleep(_PAUSE_S)
        return None

    def _thing_of(self, command: Command) -> Outgoing:
        """Return the GET of a new thing, where one can be created, or the usual one."""
        read, surveyor = command.read, self.surveyor
        whole, create = request_of(read, usual_inputs(read, surveyor.values)[0]), creator_of(self.operations, read)
        if read.parameter("path") and create is not None and create.template != command.operation.template:
            path = created_path(surveyor, create, read, _CREATED)
            whole = replace(whole, target=path) if path else whole
        return whole

    def _read(self, read: Operation, whole: Outgoing) -> dict[str, Any] | None:
        found = self.surveyor.send(read, _AGAIN, whole).exchange
        names = {plain_name(name) for name in parts_of(read.shape)}
        is_there = found is not None and found.response.ok
        return object_in(read_json(found.response.body).value, names) if is_there and found is not None else None

    def _lead(self, command: Command, whole: Outgoing) -> dict[str, Any] | None:
        """Bring a thing to a state from which a command leads, by other commands, and read it.

        There, what the description forbids in this state is tried.
        """
        now = self._read(command.read, whole)
        # Operations that end an activity come last.
        others = sorted(self.known, key=lambda one: bool(words_of(one.operation.template) & ENDING))
        for other in others if command.state is not None else ():
            name, states = command.state or ("", frozenset())
            if now is None or str(now.get(name)) in states:
                break
            if other.read is command.read and other is not command:
                if self._act(other.operation, other.read, whole, 0).status in FULL and not self.is_calm:
                    self.is_calm = True
                    self._calm_all()
                    self._act(other.operation, other.read, whole, 0)
                now = self._read(command.read, whole)
        name = command.state[0] if command.state is not None else ""
        for method in ("PUT", "DELETE") if name else ():
            change = self.operations.get((method, command.read.template))
            barred = barred_by(change, command.read).get(name, ()) if change is not None else ()
            if change is not None and now is not None and str(now.get(name)) in barred:
                self._act(change, command.read, whole, 0)
                now = self._read(command.read, whole)
        return now

    def _calm_all(self) -> None:
        """End what a list shows as running, from earlier scenarios."""
        for command in {one.read.label: one for one in self.known if one.state is not None}.values():
            (name, states), above = command.state or ("", frozenset()), collection_of(command.read.template)
            lister = self.operations.get(("GET", above))
            is_usable = lister is not None and not lister.parameter("path")
            listed = self.surveyor.send(lister, _AGAIN).exchange if is_usable and lister is not None else None
            for item in items_of(read_json(listed.response.body).value) or () if listed is not None else ():
                if isinstance(item, dict) and plain_name(str(item.get(name))) in LIVE & set(map(plain_name, states)):
                    whole = request_of(command.read, usual_inputs(command.read, self.surveyor.values)[0])
                    id_ = quote(identifier_of(item, command.read), safe="")
                    self._calm(command.read, replace(whole, target=f"{above}/{id_}"))

    def _calm(self, read: Operation, whole: Outgoing) -> None:
        """End what runs, as it may keep others from running."""
        for other in self.known:
            if other.read is read and words_of(other.operation.template) & ENDING:
                self._act(other.operation, read, whole, 0)

    def _act(self, operation: Operation, read: Operation, whole: Outgoing, turn: int) -> Probe:
        """Send an operation to a thing, with other values until they are taken."""
        values, target = self.surveyor.values, whole.target.partition("?")[0].rstrip("/")
        target += operation.template[len(read.template.rstrip("/")) :]
        for number in range(turn, _TRIED, _TURNS):
            inputs = usual_inputs(operation, values)[0]
            bodies = Writer(self.surveyor.api, values).bodies(operation, number) if operation.bodies else []
            inputs = with_new_values(operation, replace(inputs, body=bodies[0]) if bodies else inputs, values)
            request = replace(request_of(operation, inputs), target=target)
            sent = self.surveyor.send(operation, Variation(Kind.AGAIN, "", "", inputs), request)
            # Another thing may have this value already.
            if sent.status not in FULL or not bodies:
                break
        return sent
