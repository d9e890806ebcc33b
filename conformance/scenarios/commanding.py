"""Send commands to things, such as `POST /jobs/{id}/cancel`, and read the things before and after each."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Final

from conformance.api.rest.inputs import Inputs, request_of, usual_inputs, with_new_values
from conformance.api.rest.things import collection_of, creator_of, object_in, parts_of
from conformance.api.rest.variations import Kind, Variation
from conformance.checkers.commands import SETTLES_S, Command, commands_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation
from conformance.documents.parameters import plain_name
from conformance.scenarios.creating import FULL, created_path, location_of
from conformance.scenarios.singletons import is_free
from conformance.scenarios.survey import Surveyor
from conformance.scenarios.writing import Writer
from conformance.transport.exchange import NoAnswerError, Outgoing

# Commands that are tried, and how often each. _PAUSE_S: between two reads of a thing that has not acted yet, s.
_MOST, _TURNS, _PAUSE_S = 12, 2, 0.3
# Bodies that are tried until one is taken.
_TRIED: Final = 8
_CREATED: Final = frozenset({201, 202})
#: Time after which a thing that was commanded is read again, s.
_LASTS_S: Final = 1.5


def send_commands(surveyor: Surveyor, operations: Mapping[tuple[str, str], Operation]) -> None:
    """Create things that are made later (202), and send each command twice, to new things where that is possible."""
    _accept(surveyor, operations)
    known = [one for one in commands_of([*operations.values()]) if is_free(one.operation, one.operation.template)]
    again: list[tuple[Operation, Outgoing]] = []
    began = time.monotonic()
    for turn in range(_TURNS):
        for command in known[:_MOST]:
            with suppress(NoAnswerError):  # the survey reports a broken connection
                read = _send(surveyor, operations, command, turn)
                if read is not None and command.state is not None:
                    again.append((command.read, read))
    if again:
        time.sleep(max(0.0, _LASTS_S - (time.monotonic() - began)))
    for operation, read in again:
        with suppress(NoAnswerError):
            surveyor.send(operation, Variation(Kind.AGAIN, "", "", Inputs()), read)


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
                    surveyor.send(read, Variation(Kind.AGAIN, "", "", Inputs()), whole)


def _send(
    surveyor: Surveyor, operations: Mapping[tuple[str, str], Operation], command: Command, turn: int
) -> Outgoing | None:
    """Send a command, and read its thing until it has acted; return the request of that, or None if it is refused."""
    operation, read, again = command.operation, command.read, Variation(Kind.AGAIN, "", "", Inputs())
    whole, create = request_of(read, usual_inputs(read, surveyor.values)[0]), creator_of(operations, read)
    if read.parameter("path") and create is not None and create.template != operation.template:
        path = created_path(surveyor, create, read, _CREATED)
        whole = replace(whole, target=path) if path else whole
    names = {plain_name(name) for name in parts_of(read.shape)}
    before = surveyor.send(read, again, whole).exchange
    if before is None or not before.response.ok:
        return None
    target = whole.target.partition("?")[0].rstrip("/") + operation.template[len(read.template.rstrip("/")) :]
    for number in range(turn, _TRIED, _TURNS):
        inputs = usual_inputs(operation, surveyor.values)[0]
        bodies = Writer(surveyor.api, surveyor.values).bodies(operation, number) if operation.bodies else []
        inputs = with_new_values(operation, replace(inputs, body=bodies[0]) if bodies else inputs, surveyor.values)
        request = replace(request_of(operation, inputs), target=target)
        sent = surveyor.send(operation, Variation(Kind.AGAIN, "", "", inputs), request)
        # Another thing may have this value already.
        if sent.status not in FULL or not bodies:
            break
    was, until = object_in(read_json(before.response.body).value, names), time.monotonic() + SETTLES_S
    while sent.ok and sent.exchange is not None and (found := surveyor.send(read, again, whole).exchange) is not None:
        now, told = object_in(read_json(found.response.body).value, names), read_json(sent.exchange.response.body).value
        if not (command.is_due(was, now) or command.untrue(told, was, now)):
            return whole
        if time.monotonic() > until + _PAUSE_S:
            break
        time.sleep(_PAUSE_S)
    return None
