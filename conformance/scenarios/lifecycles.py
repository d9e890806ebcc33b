"""The life of things that an API creates: create some, read, change and delete them, and look at the others."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import quote, unquote, urlsplit

from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.listing import items_of
from conformance.api.rest.samples import entry_of, fits
from conformance.api.rest.statuses import HELD, held_text
from conformance.api.rest.things import (
    collection_of,
    creator_of,
    doubt_of_deletion,
    id_member,
    identifier_of,
    parts_of,
    path_chosen,
)
from conformance.api.rest.values import Values
from conformance.checkers.transitions import ONCE, barred_by
from conformance.checkers.untouched import says_named
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import Operation
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.documents.writing import text_of
from conformance.scenarios.chosen import Chosen
from conformance.scenarios.living import ABSENT, Kind, Life, Living, State, Thing
from conformance.scenarios.parts import write_parts
from conformance.scenarios.refusing import is_refused, look_refused, refuse_changes, refuse_creation, refuse_deletion
from conformance.scenarios.scenario import NotPossibleError, NotSeenError, scenario
from conformance.scenarios.singletons import is_free, singletons
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.writing import Write, Writer, members
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.transport.reach import is_same, joined, path_of

# Things to create in a collection: _KEPT if no operation deletes them, else _FEW at quick and _MANY at other efforts.
_KEPT, _FEW, _MANY = 2, 3, 20
_BUDGETS = 10  # one collection may take this many times the time of an exploration
_SLOW_BUDGETS = 3  # the same with a slow device
# Operations of a thing that are called.
_ACTIONS: Final = 3
# How long a thing is left alone at most, s.
_ALONE_S: Final = 6.0
_BESIDE = 4  # writes around which things beside are read, and most times of each
_CLIENTS = 2  # clients that create things at the same time
_AT_ONCE = 110  # number from which the values of their first things are made
# Numbers from which values are made, so that they differ: for changes, refused requests, and an identifier that is
# never created.
_CHANGED, _REFUSED, _NEVER = 30, 60, 99
# Members with the time or version of a change.
_TIMES: Final = re.compile(r"(?:created|updated|modified|changed|timestamp|time|at|on|version|revision|etag)$")


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.INPUT)
def lifecycles(api: RestInterface, values: Values) -> tuple[Life, ...]:
    """Create things of each collection, read them, change them, delete them, and read them again."""
    operations = callable_operations(api)
    lives, held = list[Life](), dict[str, int]()
    for (method, path), read in operations.items():
        collection = collection_of(path)
        create = creator_of(operations, read) or operations.get(("PUT", path))
        if method == "GET" and collection and create is not None:
            api.run.limit.check()
            # Created things are deleted even after the time limit.
            with api.run.limit.lift():
                lives += _seen_twice(partial(_Cycle, Writer(api, values), create, read, operations, held))
    _look_beside(Writer(api, values), operations)
    lives += singletons(Writer(api, values), operations)
    write_parts(Writer(api, values), operations)
    if held and not lives:
        raise NotSeenError(held_text(held, set(held.values())))
    if not lives:
        raise NotPossibleError("no POST or PUT that may be called creates a thing that a GET reads")
    return tuple(lives)


def _look_beside(writer: Writer, operations: dict[tuple[str, str], Operation]) -> None:
    """Write to what no GET has, with reads of other things around each request; a checker judges these.

    These are things like the one of which a part is written. If the description says that no request changes what it
    does not name, resources that clients set are read too, each after it was set.
    """
    single = {
        path: one for (method, path), one in operations.items() if method == "PUT" and ("GET", path) in operations
    }
    is_said = says_named(writer.api.run.contract)
    single = {path: one for path, one in single.items() if is_said and not one.parameter("path") and is_free(one, path)}
    writes = [one for (method, path), one in operations.items() if method in {"PUT", "PATCH"} and one.bodies]
    writes = [one for one in writes if ("GET", one.template) not in operations and is_free(one, one.template)]
    for write in writes[:_BESIDE]:
        item, targets = (
            operations.get(("GET", write.template.rpartition("/")[0])),
            [(operations["GET", one], one) for one in single],
        )
        if item is not None and len(item.parameter("path")) == 1:
            name, ids = item.parameter("path")[0].name, writer.values.of(item, item.parameter("path")[0])
            targets += [(item, item.template.replace(f"{{{name}}}", quote(str(one), safe=""))) for one in ids]
        for turn in range(_BESIDE if single else 2 if targets else 0):
            with suppress(NoAnswerError):  # the survey reports a broken connection
                for path, change in single.items():
                    writer.conditional(change, operations["GET", path], path)
                for read, path in targets:
                    writer.send(read, path)
                writer.send(write, "", next(iter(writer.bodies(write, turn)[:: (-1, 1)[turn % 2]]), None))
                for read, path in targets:
                    writer.send(read, path)


def _seen_twice(cycle: Callable[[int], _Cycle]) -> list[Life]:
    """Return the lives of a cycle, with its faults if the second cycle shows such a fault as well.

    Another client may have changed or deleted something once. Things that change or end without any request are told by
    one that is left alone for as long.
    """
    lives = cycle(0).run()
    wrong = [look for life in lives for look in life.looks if look.other]
    if not wrong:
        return lives
    kinds = set[Kind]()
    if not cycle(1).changes_alone(min(_ALONE_S, max(look.after_s for look in wrong))):
        kinds |= {look.kind for life in cycle(2).run() for look in life.looks if look.other}
    kept = [tuple(look for look in life.looks if not look.other or look.kind in kinds) for life in lives]
    return [replace(life, looks=looks) for life, looks in zip(lives, kept, strict=True)]


@dataclass
class _Cycle:
    """The things of one collection. If the device's state forbids one, the status is noted in ``held``."""

    writer: Writer
    create: Operation
    read: Operation
    operations: dict[tuple[str, str], Operation]
    held: dict[str, int]
    round: int
    living: Living = field(init=False)

    def __post_init__(self) -> None:
        lister = self.operations.get(("GET", collection_of(self.read.template)))
        if self._is_below:
            lister = self.operations.get(("GET", self.create.template.rstrip("/")))
        effort = self.writer.api.run.effort
        until = time.monotonic() + (_SLOW_BUDGETS if effort.slow else _BUDGETS) * effort.budget_s
        self.living = Living(self.writer, self.read, lister, until)
        self.item = self.read.template.rstrip("/")
        changes = (self.operations.get((name, self.item)) for name in ("PUT", "PATCH"))
        self._changes = [operation for operation in changes if operation is not None]

    @property
    def _is_below(self) -> bool:
        """Whether things are created below another thing, and have paths of their own."""
        above = collection_of(self.read.template)
        return self.create.method == "POST" and self.create.template.rstrip("/") != above

    def run(self) -> list[Life]:
        """Create, change and delete things of a collection; return the record of each thing."""
        effort, things = self.writer.api.run.effort, self.living.things
        delete = self.operations.get(("DELETE", self.item))
        count = _KEPT if delete is None else _FEW if effort.name == "quick" or effort.slow else _MANY
        with suppress(NoAnswerError):  # the survey reports a broken connection
            self._create_all(count)
            self.living.look_at_older()
            self._change_all()
            Chosen(self.living, self._changes, self.operations).look()
            self._act()
            barring = next((one for one in self.living.of(State.ALIVE) if one.is_own), None)
            if barring is not None and not self.living.is_over:
                self._call_barred(barring)
        with suppress(NoAnswerError):
            if delete is not None:
                self._delete_all(delete)
                self._create_at_once(delete, count)
        return [replace(thing.life, looks=tuple(self.living.looks) if thing is things[0] else ()) for thing in things]

    def changes_alone(self, seconds: float) -> bool:
        """Return whether a thing that was created changes, or is gone, after a time without any request."""
        things, delete = self.living.things, self.operations.get(("DELETE", self.item))
        try:
            self._create(_FEW * self.round)
            time.sleep(seconds)
            found = [self.living.other(thing, self.writer.send(self.read, thing.path)) for thing in things]
            if delete is not None:
                for thing in things:
                    self._delete_and_read(thing, delete)
        except NoAnswerError:
            return True
        return any(found)

    def _create_all(self, count: int) -> None:
        """Create things; after each, read the others. Near the end, one is created after a change and a refusal."""
        for turn in range(count):
            if turn == max(1, min(2, count - 1)):
                self._change(self.living.things[0], 0)
                if self.create.method == "POST" and not self.living.is_over:
                    refuse_creation(self.living, self.create, _REFUSED + 2 * self.round)
            if self.create.method == "POST" and self.living.things:
                self._ask_for_next(self.living.things[-1].path)
            if self.living.is_over or not self._create(count * self.round + turn):
                break
            thing = self.living.things[-1]
            self.living.look(thing.life.created, self.create.label, thing)

    def _change_all(self) -> None:
        """Send changes of one thing that must be refused, and then change the others."""
        for turn, thing in enumerate(self.living.of(State.ALIVE)):
            if turn == 0:
                for change in self._changes if not self.living.is_over else ():
                    refuse_changes(self.living, change, thing, _REFUSED + 1 + 2 * self.round)
            else:
                self._change(thing, turn)

    def _change(self, thing: Thing, turn: int) -> None:
        """Change a thing by each operation that does, and read the others."""
        done = list[Write]()
        for change in self._changes if thing.state is State.ALIVE and thing.is_own else ():
            write = self.writer.change(change, self.read, thing.path, _CHANGED + turn)
            if write is not None:
                done.append(write)
                self.living.remember(thing, write, change)
        thing.life = replace(thing.life, writes=(*thing.life.writes, *done))
        if done:
            self.living.look(done[-1].sent, done[-1].operation, thing)

    def _act(self) -> None:
        """Call the operations below a thing that respond with it, and read whether it is as in the response."""
        acting = [
            one
            for (method, path), one in self.operations.items()
            if method == "POST" and path.startswith(f"{self.item}/")
        ]
        usable = [operation for operation in acting if operation.template.count("{") == self.item.count("{")]
        for action in usable[:_ACTIONS]:
            thing = next(reversed(self.living.of(State.ALIVE)), None)
            if thing is not None and self._is_item(thing.path) and not self.living.is_over:
                self._act_on(action, thing)
                self._change_barred(thing)

    def _act_on(self, action: Operation, thing: Thing) -> None:
        """Call an operation of a thing, and read the thing until it shows the change in the response."""
        living, before, said = self.living, self.writer.send(self.read, thing.path), dict[str, Any]()
        target = thing.path.rstrip("/") + action.template[len(self.item) :]
        sent = self.writer.send(action, target)
        if is_refused(sent):
            living.check(thing, sent, action.label, Kind.REFUSED)
        elif sent.response.ok and before.response.ok:
            was = members(before, ())
            said = _news(was, members(sent, was)) if _is_alike(action, self.read) else {}

            def unseen(found: Exchange) -> list[str]:
                now = members(found, said) if found.response.ok else {}
                return [f"{clip(was[name])} as {name}, as before it" for name in said if now.get(name) == was[name]]

            found = self.writer.settle(lambda: self.writer.send(self.read, thing.path), unseen)
            told = ", ".join(f"{clip(one)} as {name}" for name, one in said.items()) or "the thing"
            expected, doubt = f"{told}, as {action.label} with status {sent.response.status} said", "it may act later"
            living.note(Kind.KEPT, action.label, found.exchange, expected, "; ".join(found.wrong), thing, doubt)
            thing.has_acted = True
            thing.last = found.exchange if found.exchange.response.ok else thing.last
            # An operation may change members that were written, and end the thing.
            wrong = living.other(thing, found.exchange)
            thing.state = thing.state if found.exchange.response.ok else State.UNKNOWN
            thing.kept = {} if wrong else thing.kept
        living.look(sent, action.label, thing, said)
        if sent.response.ok and ONCE.search(action.text):
            body = next(iter(self.writer.bodies(action, _REFUSED)), None)
            look_refused(living, thing, action, self.writer.send(action, target, body))
        Chosen(living, self._changes, self.operations).look_after(thing, members(before, ()))

    def _change_barred(self, thing: Thing) -> None:
        """Send a change that the description forbids in the state to which an operation has led."""
        now, turn = members(thing.last, parts_of(self.read.shape)), _REFUSED + _FEW * self.round
        for change in self._changes if thing.state is State.ALIVE else ():
            barred = barred_by(change, self.read)
            body = next(iter(self.writer.bodies(change, turn, now)), None)
            if body is not None and any(text_of(now.get(name)) in states for name, states in barred.items()):
                look_refused(self.living, thing, change, self.writer.conditional(change, self.read, thing.path, body))

    def _call_barred(self, thing: Thing) -> None:
        """Call operations of a thing in a state in which they are refused by the description, set by a PATCH."""
        patch = next((change for change in self._changes if change.method == "PATCH" and change.bodies), None)
        if patch is None:
            return
        parts = flat(next(iter(patch.bodies.values())).schema).get("properties", {})
        below = [one for (method, path), one in self.operations.items() if path.startswith(f"{self.item}/")]
        for operation in [one for one in below if not one.safe and one.template.count("{") == self.item.count("{")]:
            for name, states in barred_by(operation, self.read).items():
                values: list[Any] = [True, *sorted(states)] if "true" in states else sorted(states)
                value = next((one for one in values if name in parts and fits(parts[name], one)), None)
                was = members(self.writer.send(self.read, thing.path), (name,)).get(name)
                if value is None or was == value or was is None:
                    continue
                if self.writer.conditional(patch, self.read, thing.path, {name: value}).response.ok:
                    self.writer.send(self.read, thing.path)
                    self.writer.send(operation, thing.path + operation.template[len(self.item) :])
                    self.writer.conditional(patch, self.read, thing.path, {name: was})
        if below:
            self.living.read_anew()

    def _delete_all(self, delete: Operation) -> None:
        """Delete each thing; after each, the others and the deleted ones are read."""
        living = self.living
        alive = living.of(State.ALIVE)
        if alive and not living.is_over:
            refuse_deletion(living, delete, alive[-1], self._absent(alive[-1].path))
        for number, thing in enumerate(living.things):
            if not thing.is_own:
                continue
            deleted = self._delete_and_read(thing, delete)
            if number == 0 and thing.state is State.GONE and not living.is_over:
                self.writer.send(delete, thing.path)
                if self.create.method == "PUT":
                    self._create_again(thing, delete)
            living.look(deleted, delete.label, thing)

    def _create_again(self, thing: Thing, delete: Operation) -> None:
        """Create a deleted thing again, by the same request."""
        first = thing.life.created
        sent = self.writer.send(self.create, thing.path, read_json(first.request.body).value)
        if sent.response.ok:
            is_same = first.response.status != HTTPStatus.CREATED or sent.response.status == HTTPStatus.CREATED
            expected = f"status 201 for what was created by {self.create.label} and deleted before"
            self.living.note(Kind.THERE, self.create.label, sent, expected, "" if is_same else sent.came, thing)
            there = self.writer.until(
                lambda: self.writer.send(self.read, thing.path), lambda exchange: exchange.response.status not in ABSENT
            )
            other = there.came if there.response.status in ABSENT else ""
            self.living.note(Kind.THERE, self.create.label, there, "the thing that was created again", other, thing)
            write = self.writer.read_back(self.create, self.read, thing.path, sent)
            thing.life = replace(thing.life, writes=(*thing.life.writes, write))
            self.writer.send(delete, thing.path)

    def _create(self, turn: int) -> bool:
        """Create one thing and read it; return whether another one may be tried."""
        path, before, things = self.living.at, self._ids(), self.living.things
        if self.create.method == "PUT":
            path = path_chosen(self.read, turn)
            if not path or self.writer.send(self.read, path).response.status not in ABSENT:
                return False
        usual = [None] if not things and self.create.method == "POST" else []
        bodies = self.writer.bodies(self.create, turn)
        for body in [*usual, *self.writer.with_items(self.create, bodies, turn, whole=True)]:
            created = self.writer.send(self.create, path, body)
            status = created.response.status
            if status in HELD and not things:
                self.held[self.create.label] = status
            if created.response.ok or status == HTTPStatus.SEE_OTHER:
                break
        else:
            return False
        if self.create.method == "PUT":
            if status == HTTPStatus.ACCEPTED:
                return False
            self._read_created(created, path, "")
            return True
        is_new = self._register(created, before)
        if is_new and self._is_below:
            self.living.at = urlsplit(created.request.url).path.removeprefix(self.writer.api.client.prefix)
        if not is_new:
            # A POST may have changed what is there, such as a thing with the same key.
            self.living.read_anew()
        return is_new

    def _ask_for_next(self, path: str) -> None:
        """Read what the next thing may be called: a device must not keep in mind that it was not there."""
        number = re.search(r"\d{1,9}(?=/?$)", path)
        if number is not None:
            text = str(int(number[0]) + 1).rjust(len(number[0]), "0")
            self.writer.send(self.read, path[: number.start()] + text + path[number.end() :])

    def _create_at_once(self, delete: Operation, count: int) -> None:
        """Create a thing by each of two clients at the same moment, and delete both."""
        writer, turns = self.writer, [count * self.round + _AT_ONCE + number for number in range(_CLIENTS)]
        if self.create.method != "POST" or not self.living.of(State.GONE) or self.living.is_over:
            return
        bodies = [next(iter(writer.bodies(self.create, turn)), None) for turn in turns]
        requests = [writer.request(self.create, self.living.at, body) for body in bodies if body is not None]
        if len({request.body for request in requests}) == len(turns):
            sent = writer.api.send_together(requests)
            made = [one for one in sent if isinstance(one, Exchange) and one.response.ok]
            new = [one for one in made if one.response.status == HTTPStatus.CREATED]
            for created in new:
                if self._register(created, None) and len(new) < len(made):
                    # The other one may have changed what this one has created.
                    self.living.things[-1].life = replace(self.living.things[-1].life, writes=())
            if writer.api.single.get(self.create.label) or writer.values.unique.knows(self.create):
                self._create_twins(turns[-1] + 1)
            for thing in self.living.of(State.ALIVE):
                self._delete_and_read(thing, delete)

    def _create_twins(self, turn: int) -> None:
        """Create two equal things at once; if both are created, another one after them must not be refused."""
        body, before = next(iter(self.writer.bodies(self.create, turn)), None), len(self.living.things)
        if body is None:
            return
        request = self.writer.request(self.create, self.living.at, body)
        sent = self.writer.api.send_together([request] * _CLIENTS)
        made = [one for one in sent if isinstance(one, Exchange) and one.response.status == HTTPStatus.CREATED]
        third = self.writer.api.send(request) if len(made) == _CLIENTS else None
        for created in (*made, *([third] if third is not None else [])):
            self._register(created, None)
        if len(self.living.things) > before:
            is_wrong = third is not None and is_refused(third)
            expected = "one creation of two equal ones at once, as the device refuses one that comes later"
            other = f"status {made[-1].response.status} for both" if is_wrong else ""
            self.living.note(Kind.THERE, self.create.label, made[-1], expected, other, self.living.things[-1])

    def _register(self, created: Exchange, before: set[str] | None) -> bool:
        """Register the thing that a POST created, by the identifiers known before; return whether it is new."""
        status = created.response.status
        id_ = str(id_member(read_json(created.response.body).value, self.read)[1] or "")
        is_new = status in {HTTPStatus.CREATED, HTTPStatus.SEE_OTHER} or (
            # A POST that is answered 200 may be a search or a login.
            status == HTTPStatus.OK and before is not None and bool(id_) and id_.casefold() not in before
        )
        paths = dict.fromkeys(self._paths(created, id_)) if is_new else {}
        for path in paths:
            again = next((thing for thing in self.living.of(State.ALIVE) if thing.path == path), None)
            if again is not None:
                expected, sent = f"another path than {path}, where an earlier thing is", again.life.created.request.body
                # A text that was sent may be the identifier: the later thing replaces the earlier one.
                last = unquote(path.rstrip("/").rpartition("/")[2]).casefold()
                body = re.sub(r"\W+", "-", created.request.body.decode(errors="replace")).casefold()
                is_named = f"-{last}-" in body and not last.isdecimal()
                other = f"{path} once more" if sent != created.request.body and not is_named else ""
                self.living.note(Kind.THERE, self.create.label, created, expected, other, again)
                return False
            self._read_created(created, path, id_)
            # Two paths may lead to one thing.
            is_known = any(thing.life.created is created for thing in self.living.of(State.ALIVE)[:-1])
            is_old = is_known or unquote(path.rstrip("/").rpartition("/")[2]).casefold() in (before or ())
            self.living.things[-1].is_own = not is_old
        return bool(paths)

    def _read_created(self, created: Exchange, path: str, id_: str) -> None:
        """Read a thing that was created, and compare it with the request."""
        absent = self.writer.until(
            lambda: self.writer.send(self.read, path), lambda exchange: exchange.response.status not in ABSENT
        )
        write = None if not absent.response.ok else self.writer.read_back(self.create, self.read, path, created)
        found = absent if write is None else write.found
        found_id = str(id_member(read_json(found.response.body).value, self.read)[1] or "") if write else ""
        if self.living.lister is not None and entry_of(self.living.lister.shape) is not None:
            found_id = unquote(path.rstrip("/").rpartition("/")[2])
        writes = (write,) if write else ()
        life = Life(self.create.label, self.read.label, created, found, id=id_, found_id=found_id, writes=writes)
        thing = Thing(path, life, found, state=State.ALIVE if found.response.ok else State.UNKNOWN)
        self.living.things.append(thing)
        self.living.remember(thing, write, self.create)

    def _delete_and_read(self, thing: Thing, delete: Operation) -> Exchange:
        """Delete a thing, and read it again."""
        deleted = self.writer.conditional(delete, self.read, thing.path)
        is_done = deleted.response.status in {HTTPStatus.OK, HTTPStatus.NO_CONTENT}
        gone = self.writer.until(
            lambda: self.writer.send(self.read, thing.path), lambda exchange: not is_done or not exchange.response.ok
        )
        thing.state = State.GONE if is_done and gone.response.status in ABSENT else State.UNKNOWN
        doubt = doubt_of_deletion(delete)
        thing.life = replace(thing.life, delete=delete.label, deleted=deleted, gone=gone, doubt=doubt)
        return deleted

    def _ids(self) -> set[str] | None:
        """Return the identifiers in the list of the collection; None if it cannot be read."""
        if self.living.lister is None or self.create.method == "PUT":
            return None
        if self.living.listing is not None:
            return set(self.living.listing.ids)
        listing = self.writer.send(self.living.lister, self.living.at)
        items = items_of(read_json(listing.response.body).value) or []
        ids = {identifier_of(item, self.read) for item in items if isinstance(item, dict)}
        return ids if listing.response.ok else None

    def _paths(self, created: Exchange, id_: str) -> list[str]:
        """Return the paths of a created thing: by its Location, and by an identifier in the body of the same kind."""
        sent = created.request.url
        path = urlsplit(sent).path
        below = path[: len(path) - len(_end_of(path, self.create.template))]
        base = collection_of(self.item) if self._is_below else path.removeprefix(below).rstrip("/")
        by_id = f"{base}/{quote(id_, safe='')}" if id_ else ""
        by_id += "/" if by_id and self.read.template.endswith("/") else ""
        location = created.response.header("location")
        if not location:
            return [by_id] if by_id else []
        target = joined(sent, location)
        if not is_same(target, sent):
            return []
        there = path_of(target).removeprefix(below)
        last = unquote(there.partition("?")[0].rstrip("/").rpartition("/")[2])
        is_item = self._is_item(there)
        if created.response.status == HTTPStatus.SEE_OTHER and not is_item:
            return []
        # Two different identifiers may both be right: a number, and a readable name.
        return [there, by_id] if by_id and is_item and last != id_ and last.isdigit() and id_.isdigit() else [there]

    def _is_item(self, path: str) -> bool:
        """Return whether a path is that of an item, as the description writes it."""
        template = re.sub(r"\\{[^{}]*\\}", "[^/]+", re.escape(self.item))
        return re.fullmatch(template, path.rstrip("/")) is not None

    def _absent(self, path: str) -> str:
        """Return the path of a thing that probably does not exist, made from another's; empty if impossible."""
        found = path_chosen(self.read, _NEVER)
        above, _, last = path.rstrip("/").rpartition("/")
        return found and f"{above}/{found.rstrip('/').rpartition('/')[2]}{path[len(above) + 1 + len(last) :]}"


def _news(was: dict[str, Any], said: dict[str, Any]) -> dict[str, Any]:
    """Return the texts and booleans in a response that differ from the read before."""
    changed = {name: one for name, one in said.items() if name in was and one != was[name]}
    usable = [name for name, one in changed.items() if isinstance(one, str | bool)]
    return {name: changed[name] for name in usable if not _TIMES.search(plain_name(name))}


def _is_alike(action: Operation, read: Operation) -> bool:
    """Return whether an action answers with the thing itself, by its schema."""
    one, other = (set(flat(item.shape or {}).get("properties", {})) for item in (action, read))
    return bool(one) and one == other


def _end_of(path: str, template: str) -> str:
    """Return the end of a URL's path that fits a template: as many segments as the template has."""
    return "/" + "/".join(path.split("/")[-template.count("/") :])
