"""Things that go on and end, such as jobs: begin, cancel and leave some; and delete things in use.

`checkers.changes` judges the states of things by all reads of a run.
"""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Final

from conformance.api.call_rules import words_of
from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.inputs import usual_inputs, whole_body
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.listing import items_of
from conformance.api.rest.references import singular, thing_of
from conformance.api.rest.samples import fits
from conformance.api.rest.things import collection_of, creator_of, id_member, object_in
from conformance.api.rest.values import Values
from conformance.checkers.changes import ENDING, FINAL, TWICE, another_of, leads_to, state_of
from conformance.checkers.transitions import barred_by, state_member
from conformance.checkers.untouched import KEEPS, OFTEN
from conformance.documents.json_schema import is_number, kinds_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.scenarios.creating import location_of, path_of_usual
from conformance.scenarios.living import ABSENT
from conformance.scenarios.scenario import NoOccasionError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.writing import Writer, members
from conformance.transport.exchange import Exchange, NoAnswerError

_BEGINNING = 2  # operations that start an activity
_KINDS = 3  # kinds of things that are tried
# Words in names of numbers for the duration of an activity; factor for it; most things that are created for it.
_LASTING: Final = frozenset(
    {
        "ms",
        "s",
        "sec",
        "second",
        "seconds",
        "minutes",
        "duration",
        "time",
        "interval",
        "step",
        "steps",
        "delay",
        "dwell",
    }
)
_LONGER, _NEW = 20, 2
_READY_S = 1.2  # how long the suite waits for a new thing to get ready, s
_PAUSE_S = 0.1  # pause between reads, s
_CONFLICT: Final = 409
# How long after it was cancelled an activity is read again, s.
_GOES_ON_S: Final = 2.5
# Phrases in a description which say that 409 means a thing in use.
_IN_USE: Final = re.compile(
    r"\b(?:in use|while|empty|refer|contain|assign|attach|link|need|depend|belong|stand|used|uses|has|have)",
    re.IGNORECASE,
)

# Operations after which an activity can continue.
_PAUSING: Final = frozenset({"pause", "halt", "interrupt"})

_Operations = Mapping[tuple[str, str], Operation]


@dataclass(frozen=True)
class Ended:
    """Things of one collection that have a state.

    Attributes:
        read: reads one of them.
        state: the member with its state.
        actions: operations of one of them, those that end it last.
        changes: a PATCH of one of them.
        paths: of those that were cancelled, and left to go on.
        at_s: when that was, s of the monotonic clock.
        tried: how often an operation was sent in a state in which its description says that it is refused.
    """

    read: Operation
    state: str
    actions: tuple[Operation, ...]
    changes: tuple[Operation, ...] = ()
    paths: tuple[str, ...] = ()
    at_s: float = 0.0
    tried: Counter[tuple[str, str]] = field(default_factory=Counter)


def begin_and_end(api: RestInterface, values: Values) -> list[Ended]:
    """Create two things of each collection with states: begin one and end it twice, and begin the other.

    Each is paused before it begins, and begun twice, which its description may forbid.
    Of a collection in which nothing can be created, the usual thing goes through its states.
    """
    operations = callable_operations(api)
    found, writer = list[Ended](), Writer(api, values)
    for (method, path), read in operations.items():
        create = creator_of(operations, read)
        state = (state_of(read) or (state_member(read) if create is None else "")) if method == "GET" else ""
        actions = _actions(read, operations) if state and len(read.parameter("path")) == 1 else ()
        if not actions or len(found) >= _KINDS or not collection_of(path):
            continue
        changes = [one for key, one in operations.items() if key == ("PATCH", path)]
        kind, paths = Ended(read, state, actions, tuple(changes)), list[str]()
        begins = [operation for operation in actions if not _ends(operation)][:_BEGINNING]
        ends = [operation for operation in actions if _ends(operation)]
        pauses = list(filter(_pauses, ends))[:1]
        ends = [operation for operation in ends if operation not in pauses][:1]
        first = [*pauses, *begins[:1], *begins]
        is_single = create is not None and bool(ends) and _is_single(create)
        active = ""
        if is_single and create is not None:
            with api.run.limit.lift(), suppress(NoAnswerError):
                _end_active(writer, kind, "")
                active = _begin_together(writer, kind, create, operations, pauses)
        for steps in (
            [*first, *(pauses + begins) * bool(ends), *(ends or pauses), *begins, *(ends or pauses)],
            first,
            *([_again_and_again(actions)] if len(actions) > _BEGINNING and create is not None else ()),
        ):
            api.run.limit.check()
            with api.run.limit.lift(), suppress(NoAnswerError):  # the survey reports a broken connection
                if create is None:
                    _walk(writer, kind, path_of_usual(read, values), _again_and_again(actions))
                    break
                if is_single:
                    _end_active(writer, kind, active)
                made = _begin(writer, kind.state, create, operations)
                if (path := location_of(api, read, made)) and made.response.ok:
                    paths.append(path)
                    active = path
                    _walk(writer, kind, path, steps)
        found.append(replace(kind, paths=tuple(paths), at_s=time.monotonic()))
    return found


def _begin(
    writer: Writer, name: str, create: Operation, operations: _Operations, base: dict[str, Any] | None = None
) -> Exchange:
    """Create an activity; if it is refused, or has ended at once by its member ``name``, for new things.

    The second one also has more to do: numbers that tell how long it lasts are greater.
    """
    made = writer.send(create, "", base)
    is_over = str(members(made, (name,)).get(name)).casefold() in FINAL
    is_given, base = base is not None, base or _body_of(writer, create)
    if base is None or (made.response.ok and not is_over):
        return made
    schema, body = next(iter(create.bodies.values())).schema, dict(base)
    for member, part in flat(schema).get("properties", {}).items():
        given: Any = flat(part)
        value: Any = body.get(member, given.get("default"))
        is_list = "array" in kinds_of(given)
        is_renewed = is_list if is_over else member in base and not is_given
        if is_number(value) and is_over and words_of(member) & _LASTING:
            body[member] = min(given.get("maximum", value * _LONGER), value * _LONGER)
        elif is_renewed and (ids := _fresh(writer, operations, member, _NEW if is_list else 1)):
            body[member] = ids if is_list else ids[0]
    return writer.send(create, "", body) if body != base and fits(schema, body) else made


def _fresh(writer: Writer, operations: _Operations, name: str, count: int) -> list[Any]:
    """Return the identifiers of new things to which a member refers; each has what can be created below it."""
    for (method, path), read in operations.items():
        create, thing = operations.get(("POST", collection_of(path))), singular(collection_of(path).rpartition("/")[2])
        if method != "GET" or create is None or thing != thing_of(name):
            continue
        below = [
            one
            for (other, at), one in operations.items()
            if other == "POST" and at.rpartition("/")[0] == path and "201" in one.responses
        ]
        found = list[Any]()
        for _ in range(count):
            made = writer.send(create)
            found += [id_ for id_ in [id_member(read_json(made.response.body).value, read)[1]] if id_ is not None]
            place = location_of(writer.api, read, made) if made.response.ok else ""
            for one in below if place else ():
                writer.send(one, f"{place}/{one.template.rpartition('/')[2]}")
        return found
    return []


def _is_single(create: Operation) -> bool:
    """Return whether a creation is refused by its description while another thing is active."""
    return "409" in create.responses and bool(another_of(create))


def _end_active(writer: Writer, kind: Ended, path: str) -> None:
    """End a thing that is active, or that its list shows as active, and wait until it has ended."""
    active = path or _path_in_list(writer, kind, is_done=False)
    if active:
        ends = [operation for operation in kind.actions if _ends(operation)]
        _walk(writer, kind, active, sorted(ends, key=_pauses)[:1])
        writer.until(
            lambda: writer.send(kind.read, active),
            lambda found: str(members(found, (kind.state,)).get(kind.state)).casefold() in {*FINAL, "none"},
        )


def _begin_together(
    writer: Writer, kind: Ended, create: Operation, operations: _Operations, pauses: list[Operation]
) -> str:
    """Start two things by two clients at once, and one while another is paused: each time one must be refused.

    Return the path of one that is active.
    """
    first = _begin(writer, kind.state, create, operations)
    body = read_json(first.request.body).value
    _end_active(writer, kind, location_of(writer.api, kind.read, first) if first.response.ok else "")
    sent = writer.api.send_together([writer.request(create, "", body)] * 2)
    made = [one for one in sent if isinstance(one, Exchange) and one.response.ok]
    paths = [path for one in made if (path := location_of(writer.api, kind.read, one))]
    for path in (*paths, *paths[:1]):
        writer.send(kind.read, path)
    if len(paths) == 1 and pauses:
        _walk(writer, kind, paths[0], pauses)
        second = writer.send(create, "", body)
        other = location_of(writer.api, kind.read, second) if second.response.ok else ""
        for path in (other, *paths, other) if other else ():
            writer.send(kind.read, path)
    return paths[0] if paths else ""


def look_at_ended(api: RestInterface, values: Values, begun: list[Ended]) -> None:
    """Read again the activities that were started and ended, and try to end a finished thing."""
    writer = Writer(api, values)
    for kind in begun:
        ends = [operation for operation in kind.actions if _ends(operation)][:1]
        # A cancelled activity that goes on nevertheless shows this when it is done.
        time.sleep(max(0.0, kind.at_s + _GOES_ON_S - time.monotonic()) if kind.paths and ends else 0)
        with suppress(NoAnswerError):
            done = ""
            for path in kind.paths:
                now = members(writer.send(kind.read, path), (kind.state,)).get(kind.state)
                done = path if str(now).casefold() in FINAL and path != kind.paths[0] else done
            done = done or (_path_in_list(writer, kind, is_done=True) if ends else "")
            if done:
                _walk(writer, kind, done, ends)


def _walk(writer: Writer, kind: Ended, path: str, steps: list[Operation]) -> None:
    """Call operations of a thing, and read it before and after each, until it has the expected state."""
    found, waits = writer.send(kind.read, path), True
    if not found.response.ok:
        return
    for step in steps:
        _try_barred(writer, kind, path, found)
        at = path.rstrip("/") + step.template[len(kind.read.template.rstrip("/")) :]
        sent = writer.send(step, at)
        if sent.response.status == _CONFLICT and waits and _pauses(step):
            # A new activity may have to get ready before it can be paused.
            waits = False
            sent = writer.send(step, at) if _is_ready(writer, kind, path) else sent
        told = members(sent, (kind.state,)).get(kind.state) if sent.response.ok else None
        told = told and (leads_to(step, kind.read, kind.state) or told)

        def is_so(found: Exchange, told: Any = told) -> bool:
            now = members(found, (kind.state,)).get(kind.state)
            return told is None or now == told or str(now).casefold() in FINAL or not found.response.ok

        found = writer.until(lambda: writer.send(kind.read, path), is_so)
        if KEEPS.search(step.text):
            # Members that change by themselves have changed now too.
            writer.send(kind.read, path)


def _try_barred(writer: Writer, kind: Ended, path: str, found: Exchange) -> None:
    """Send each operation that is refused, by its description, in the state that a thing was just read with."""
    for action in (*kind.actions, *kind.changes):
        state = str(members(found, (kind.state,)).get(kind.state))
        if state in barred_by(action, kind.read).get(kind.state, ()) and kind.tried[action.label, state] < TWICE:
            kind.tried[action.label, state] += 1
            writer.send(action, path.rstrip("/") + action.template[len(kind.read.template.rstrip("/")) :])
            found = writer.send(kind.read, path)


def _is_ready(writer: Writer, kind: Ended, path: str) -> bool:
    """Return whether the state of a thing changes soon, and not to a final one."""
    until, states = time.monotonic() + _READY_S, list[Any]()
    while len(set(states)) < len(("before", "after")) and time.monotonic() < until:
        time.sleep(_PAUSE_S if states else 0)
        states.append(members(writer.send(kind.read, path), (kind.state,)).get(kind.state))
    return states[-1] != states[0] and str(states[-1]).casefold() not in FINAL


def _again_and_again(actions: tuple[Operation, ...]) -> list[Operation]:
    """Return operations one after another, each until it is refused for sure, and twice in the opposite order."""
    forth = [operation for operation in actions for _ in range(OFTEN + 1 if KEEPS.search(operation.text) else 2)]
    return [*forth, *reversed(actions), *reversed(actions)]


def _path_in_list(writer: Writer, kind: Ended, *, is_done: bool) -> str:
    """Return the path of a listed thing that is done, or of one that is not."""
    lister = callable_operations(writer.api).get(("GET", collection_of(kind.read.template)))
    items = items_of(read_json(writer.send(lister).response.body).value) if lister is not None else None
    for item in items or []:
        id_ = id_member(item, kind.read)[1]
        state = str(item.get(kind.state, "")).casefold() if isinstance(item, dict) and id_ is not None else ""
        if state and (state in FINAL) is is_done:
            return f"{collection_of(kind.read.template)}/{id_}"
    return ""


def _actions(read: Operation, operations: _Operations) -> tuple[Operation, ...]:
    """Return the operations of a thing that act on it, those that end it last."""
    item = read.template.rstrip("/")
    found = [
        one
        for (method, path), one in operations.items()
        if method == "POST" and path.rpartition("/")[0] == item and not path.endswith("}") and not one.motion
    ]
    return tuple(sorted(found, key=_ends))


def _pauses(action: Operation) -> bool:
    return bool(words_of(action.template.rpartition("/")[2]) & _PAUSING)


def _ends(action: Operation) -> bool:
    return bool(words_of(action.template.rpartition("/")[2]) & ENDING)


@dataclass(frozen=True)
class Deletion:
    """A DELETE of a thing that another one refers to.

    Attributes:
        operation: label of the DELETE.
        deleted: the DELETE.
        user: the read of the thing that refers to it, after the DELETE.
        fault: what is wrong, as a noun phrase; empty if there is none.
    """

    operation: str
    deleted: Exchange
    user: Exchange
    fault: str = ""


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.LATE)
def used_things(api: RestInterface, values: Values) -> tuple[Deletion, ...]:
    """Create a thing and one that refers to it, and delete the first, where the description refuses that by 409."""
    operations, found = callable_operations(api), list[Deletion]()
    for (method, path), delete in operations.items():
        if method == "DELETE" and "409" in delete.responses and _IN_USE.search(_said_of(api, delete)):
            api.run.limit.check()
            with api.run.limit.lift(), suppress(NoAnswerError):
                found += _delete_used(Writer(api, values), operations, path, delete)
    if not found:
        raise NoOccasionError("the description says of no DELETE that it refuses by 409 what is in use")
    return tuple(found)


def _delete_used(writer: Writer, operations: _Operations, path: str, delete: Operation) -> Iterator[Deletion]:
    read, create = operations.get(("GET", path)), operations.get(("POST", collection_of(path)))
    thing = singular(collection_of(path).rpartition("/")[2])
    users = [
        (one, operations["GET", item], name)
        for (method, collection), one in operations.items()
        for item in {key[1] for key in operations if key[0] == "GET" and collection_of(key[1]) == collection}
        if method == "POST" and collection != collection_of(path)
        for name in _references(one, thing)
    ]
    if read is None or create is None or not users:
        return
    made, (maker, reader, name) = writer.send(create), users[0]
    place, id_ = location_of(writer.api, read, made), id_member(read_json(made.response.body).value, read)[1]
    body = _referring(writer, maker, name, place.rpartition("/")[2] if id_ is None else id_) if place else None
    if body is None:
        return
    using = _begin(writer, state_of(reader), maker, operations, body)
    at = location_of(writer.api, reader, using) if using.response.ok else ""
    if at and members(writer.send(reader, at), (name,)).get(name) == body[name]:
        deleted = writer.conditional(delete, read, place)
        user, there = writer.send(reader, at), writer.send(read, place)
        # A thing that has ended no longer refers to anything.
        is_over = str(members(user, ("state",)).get(state_of(reader))).casefold() in FINAL
        refers = not is_over and user.response.ok and members(user, (name,)).get(name) == body[name]
        is_lost = deleted.response.ok and refers and there.response.status in ABSENT
        wrong = f"{name} of {at} leads to {place}, which does not exist any more" if is_lost else ""
        yield Deletion(delete.label, deleted, user, wrong)
        discard = operations.get(("DELETE", reader.template.rstrip("/")))
        if discard is not None:
            writer.conditional(discard, reader, at)
    writer.conditional(delete, read, place)


def _references(create: Operation, thing: str) -> list[str]:
    """Return the members of a body that refer to a kind of thing."""
    schema = next(iter(create.bodies.values())).schema if create.bodies else {}
    return [
        name for name in flat(schema).get("properties", {}) if plain_name(name) != thing and thing_of(name) == thing
    ]


def _referring(writer: Writer, create: Operation, name: str, id_: Any) -> dict[str, Any] | None:
    """Return the usual body of a creation with a reference; None if the schema does not allow it."""
    schema, base = next(iter(create.bodies.values())).schema, _body_of(writer, create)
    is_list = "array" in kinds_of(flat(schema).get("properties", {}).get(name, {}))
    body = {**base, name: [id_] if is_list else id_} if base is not None else None
    body = writer.values.unique.with_new_values(create, body, schema) if body is not None else None
    return {**body, name: [id_] if is_list else id_} if body is not None and fits(schema, body) else None


def _body_of(writer: Writer, create: Operation) -> dict[str, Any] | None:
    """Return the usual JSON object of a creation; None if it has none."""
    usual = usual_inputs(create, writer.values)[0].body if create.bodies else None
    whole = whole_body(create, writer.values)[1] if create.bodies else None
    return usual if isinstance(usual, dict) else whole if isinstance(whole, dict) else None


def _said_of(api: RestInterface, operation: Operation) -> str:
    """Return the description's texts on an operation and its 409."""
    given: Any = api.run.contract.openapi.get("paths", {}).get(operation.template, {}).get(operation.method.lower(), {})
    said = object_in(given.get("responses", {}).get("409", {}), ()).get("description")
    return f"{operation.text} {said if isinstance(said, str) else ''}"
