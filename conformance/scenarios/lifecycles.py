"""The life of things that an API creates: create one, read it, change it, delete it, read it again."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import quote, unquote, urlsplit

from conformance.api.rest.applicable import allowed
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.listing import listed
from conformance.api.rest.samples import fits
from conformance.api.rest.statuses import HELD, held_text
from conformance.api.rest.things import collection_of, identified
from conformance.api.rest.values import Values
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, operations_of
from conformance.scenarios.scenario import NotPossibleError, NotSeenError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.writing import Write, Writer
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.transport.reach import is_same, joined, path_of

# So many things of a collection are created: where nothing deletes them, at quick, and at the other efforts.
_KEPT, _FEW, _MANY = 2, 3, 20
_ABSENT: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.GONE})
# Identifiers that a client may choose for what it creates.
_CHOSEN: Final = ("roaas-{}", "roaas{}", "3fa85f64-5717-4562-b3fc-2c963f66af{:02}")
_CHOSEN_NUMBER: Final = 987_001


@dataclass(frozen=True)
class Life:
    """One thing that was created.

    Attributes:
        create, read, delete: labels of the operations; an empty one was not sent.
        created: the request that created it.
        found: the GET after it.
        deleted: the DELETE, or None.
        gone: the GET after that, or None.
        id: what identifies it by the response that created it; empty if that does not say it.
        found_id: what identifies it by the GET; empty if that does not say it.
        listing: the list of the collection after the DELETE, or None.
        is_listed: whether it is in that list.
        writes: what was written to it, the creation first.
    """

    create: str
    read: str
    created: Exchange
    found: Exchange
    delete: str = ""
    deleted: Exchange | None = None
    gone: Exchange | None = None
    id: str = ""
    found_id: str = ""
    listing: Exchange | None = None
    is_listed: bool = False
    writes: tuple[Write, ...] = ()


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.INPUT)
def lifecycles(api: RestInterface, values: Values) -> tuple[Life, ...]:
    """Create things of each collection, read them, change them, delete them, and read them again."""
    operations = {
        (item.method, item.template.rstrip("/")): item for item in operations_of(api.run.contract) if allowed(api, item)
    }
    lives, held = list[Life](), dict[str, int]()
    for (method, path), read in operations.items():
        collection = collection_of(path)
        create = operations.get(("POST", collection)) or operations.get(("PUT", path))
        if method == "GET" and collection and create is not None:
            api.run.limit.check()
            cycle = _Cycle(Writer(api, values), create, read, operations, held)
            # What was created is deleted.
            with api.run.limit.lifted():
                lives += cycle.run()
    if held and not lives:
        raise NotSeenError(held_text(held, set(held.values())))
    if not lives:
        raise NotPossibleError("no POST or PUT that may be called creates a thing that a GET reads")
    return tuple(lives)


@dataclass
class _Cycle:
    """The things of one collection. If the device's state did not allow one, the status is noted in ``held``."""

    writer: Writer
    create: Operation
    read: Operation
    operations: dict[tuple[str, str], Operation]
    held: dict[str, int]
    things: list[tuple[str, Life]] = field(default_factory=list)
    # Paths of things that were there before, which are neither changed nor deleted.
    others: set[str] = field(default_factory=set)

    def run(self) -> list[Life]:
        """Return what became of the things."""
        effort, path = self.writer.api.run.effort, self.read.template.rstrip("/")
        delete = self.operations.get(("DELETE", path))
        changes = [one for one in (self.operations.get((name, path)) for name in ("PUT", "PATCH")) if one]
        count = _KEPT if delete is None else _FEW if effort.name == "quick" or effort.slow else _MANY
        until = time.monotonic() + effort.budget_s
        try:
            for turn in range(count):
                if time.monotonic() > until or not self._create(turn):
                    break
            for turn, (path, life) in enumerate(self.things):
                if path in self.others:
                    continue
                done = [self.writer.change(one, self.read, path, turn + 1) for one in changes if life.found.response.ok]
                self.things[turn] = path, replace(life, writes=(*life.writes, *(one for one in done if one)))
            for turn, (path, life) in enumerate(self.things):
                if delete is not None and path not in self.others:
                    self.things[turn] = path, self._deleted(life, delete, path)
        except NoAnswerError:
            pass  # the survey tells what breaks a connection
        return [life for _, life in self.things]

    def _create(self, turn: int) -> bool:
        """Create one thing and read it; return whether another one may be tried."""
        path, before = "", self._ids()
        if self.create.method == "PUT":
            path = self._chosen(turn)
            if not path or self.writer.send(self.read, path).response.status not in _ABSENT:
                return False
        usual = [None] if turn == 0 and self.create.method == "POST" else []
        for body in [*usual, *self.writer.bodies(self.create, turn)]:
            created = self.writer.send(self.create, path, body)
            status = created.response.status
            if status in HELD and not self.things:
                self.held[self.create.label] = status
            if created.response.ok or status == HTTPStatus.SEE_OTHER:
                break
        else:
            return False
        if self.create.method == "PUT":
            if status == HTTPStatus.ACCEPTED:
                return False
            self._found(created, path, "")
            return True
        id_ = str(identified(read_json(created.response.body).value, self.read)[1] or "")
        is_new = status in {HTTPStatus.CREATED, HTTPStatus.SEE_OTHER} or (
            # A POST that is answered 200 may search, or log in.
            status == HTTPStatus.OK and before is not None and bool(id_) and id_ not in before
        )
        paths = dict.fromkeys(self._paths(created, id_)) if is_new else {}
        for one in paths:
            if unquote(one.rstrip("/").rpartition("/")[2]) in (before or ()):
                self.others.add(one)
            self._found(created, one, id_)
        return bool(paths)

    def _found(self, created: Exchange, path: str, id_: str) -> None:
        """Read a thing that was created, and compare it with the request."""
        absent = self.writer.until(
            lambda: self.writer.send(self.read, path), lambda one: one.response.status not in _ABSENT
        )
        write = None if not absent.response.ok else self.writer.read_back(self.create, self.read, path, created)
        found = absent if write is None else write.found
        found_id = str(identified(read_json(found.response.body).value, self.read)[1] or "") if write else ""
        writes = (write,) if write else ()
        life = Life(self.create.label, self.read.label, created, found, id=id_, found_id=found_id, writes=writes)
        self.things.append((path, life))

    def _deleted(self, life: Life, delete: Operation, path: str) -> Life:
        """Delete a thing, read it again, and look for it in the list."""
        deleted = self.writer.send(delete, path)
        if deleted.response.status not in {HTTPStatus.OK, HTTPStatus.NO_CONTENT}:
            return replace(life, delete=delete.label, deleted=deleted, gone=self.writer.send(self.read, path))
        gone = self.writer.until(lambda: self.writer.send(self.read, path), lambda one: not one.response.ok)
        life = replace(life, delete=delete.label, deleted=deleted, gone=gone)
        lister = self.operations.get(("GET", collection_of(self.read.template)))
        if lister is None or not life.found_id:
            return life
        listing = self.writer.until(
            lambda: self.writer.send(lister, self._base(path)), lambda one: life.found_id not in self._ids_of(one)
        )
        return replace(life, listing=listing, is_listed=life.found_id in self._ids_of(listing))

    def _base(self, path: str) -> str:
        """Return the path of the collection that an item is in, as the list's operation writes it."""
        lister = self.operations[("GET", collection_of(self.read.template))]
        return path.rstrip("/").rpartition("/")[0] + ("/" if lister.template.endswith("/") else "")

    def _ids(self) -> set[str] | None:
        """Return the identifiers in the list of the collection; None if it cannot be read."""
        lister = self.operations.get(("GET", collection_of(self.read.template)))
        if lister is None or self.create.method == "PUT":
            return None
        listing = self.writer.send(lister)
        return self._ids_of(listing) if listing.response.ok else None

    def _ids_of(self, listing: Exchange) -> set[str]:
        items = listed(read_json(listing.response.body).value) or []
        return {str(identified(one, self.read)[1]) for one in items if isinstance(one, dict)}

    def _paths(self, created: Exchange, id_: str) -> list[str]:
        """Return the paths of a created thing: by its Location, and by an identifier in the body of the same kind."""
        sent = created.request.url
        path = urlsplit(sent).path
        below = path[: len(path) - len(_end_of(path, self.create.template))]
        by_id = f"{path.removeprefix(below).rstrip('/')}/{quote(id_, safe='')}" if id_ else ""
        by_id += "/" if by_id and self.read.template.endswith("/") else ""
        location = created.response.header("location")
        if not location:
            return [by_id] if by_id else []
        target = joined(sent, location)
        if not is_same(target, sent):
            return []
        there = path_of(target).removeprefix(below)
        last = unquote(there.partition("?")[0].rstrip("/").rpartition("/")[2])
        is_item = re.fullmatch(
            re.sub(r"\\{[^{}]*\\}", "[^/]+", re.escape(self.read.template.rstrip("/"))), there.rstrip("/")
        )
        if created.response.status == HTTPStatus.SEE_OTHER and not is_item:
            return []
        # Two identifiers of another kind may both be right: a number, and a readable name.
        return [there, by_id] if by_id and is_item and last != id_ and last.isdigit() and id_.isdigit() else [there]

    def _chosen(self, turn: int) -> str:
        """Return the path of a thing that does not exist, with an identifier that the client chooses; else empty."""
        parameter = self.read.parameter("path")[-1]
        candidates: list[Any] = [one.format(turn) for one in _CHOSEN] + [_CHOSEN_NUMBER + turn]
        id_ = next((one for one in candidates if fits(parameter.schema, one)), None)
        if id_ is None or len(self.read.parameter("path")) > 1:
            return ""
        return self.read.template.replace(f"{{{parameter.name}}}", str(id_))


def _end_of(path: str, template: str) -> str:
    """Return the end of a URL's path that a template has written: as many segments as it has."""
    return "/" + "/".join(path.split("/")[-template.count("/") :])
