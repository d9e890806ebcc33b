"""Conditions, single members and undeclared methods, tried on resources that the run created or may write."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import islice, pairwise
from typing import Any, Final
from urllib.parse import quote

from conformance.api.rest.applicable import allows, callable_operations
from conformance.api.rest.inputs import Inputs, request_of, usual_inputs, with_new_values
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.listing import Listing, listing_of, page_of
from conformance.api.rest.patches import same
from conformance.api.rest.references import singular
from conformance.api.rest.things import collection_of, creator_of, identifier_of, path_chosen
from conformance.api.rest.values import Values
from conformance.api.rest.variations import NO_FORMAT, Kind, Variation
from conformance.checkers.entity_tags import GUARDED, REVISION
from conformance.checkers.memory import ending_with
from conformance.checkers.totals import is_left
from conformance.documents.files import file_of, keeps_octets
from conformance.documents.json_text import clip
from conformance.documents.openapi import Operation, is_json, operations_of, resources_of
from conformance.documents.parameters import plain_name
from conformance.documents.representation import flat
from conformance.documents.security import demands
from conformance.scenarios.commanding import send_commands
from conformance.scenarios.creating import created_path, path_of_usual, with_texts
from conformance.scenarios.entries import change_entries
from conformance.scenarios.list_queries import choosing
from conformance.scenarios.lists import Paged, pages_below
from conformance.scenarios.living import ABSENT
from conformance.scenarios.neighbours import NO_TAG, read_parts
from conformance.scenarios.posted_files import FILES, post_files
from conformance.scenarios.scenario import scenario
from conformance.scenarios.siblings import write_siblings
from conformance.scenarios.singletons import is_changeable, is_free
from conformance.scenarios.special_bodies import by_format, is_list_of_changes, special_bodies
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.survey import Probe, Survey, Surveyor
from conformance.scenarios.whole_list import read_numbers
from conformance.scenarios.writing import Writer, members, takes_tags
from conformance.transport.exchange import Exchange, NoAnswerError, NotPermittedError, Outgoing
from conformance.transport.parallel import send_together

#: Way by which a list below another thing is read.
ANOTHER: Final = "another thing"
_STANDARD: Final = ("GET", "PUT", "POST", "DELETE", "PATCH")
_SETTLES_S = 3.2  # how long a deleted thing may still be listed, s
_PAUSE_S = 0.4  # pause between reads, s
_NEITHER: Final = f'{NO_TAG}, "roaas-nor-this"'  # a list of entity tags that no content has
_GONE_PLACE, _STALE = "path of what was deleted", "earlier revision in the body"
_OCTETS, _TEXT = "application/octet-stream", "text/plain"
# How a client sends content of unknown length (RFC 9112 7.1).
_IN_CHUNKS: Final = ("Transfer-Encoding", "chunked")
# Texts of equal length in bytes, with several kinds of line ends.
_TEXTS: Final = tuple(f"roaas {word}\n two  words\r\n\ttab\n".encode() * 200 + b"end" for word in ("one", "other"))
# Number for an identifier that no other check uses.
_TURN: Final = 98
# Members that are written singly after all together, to see whether the others stay.
_SINGLES: Final = 4


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.EFFECT)
def own_things(api: RestInterface, values: Values) -> Survey:
    """Create a thing of each collection; write to it with right and wrong conditions; send undeclared methods."""
    operations = callable_operations(api)
    surveyor = Surveyor(api, values)
    for (method, path), read in operations.items():
        if method != "GET":
            continue
        api.run.limit.check()
        changes = [operations[name, path] for name in ("PATCH", "PUT") if (name, path) in operations]
        create = creator_of(operations, read) or operations.get(("PUT", path))
        delete = operations.get(("DELETE", path))
        with api.run.limit.lift(), suppress(NoAnswerError):
            is_item = bool(read.parameter("path"))
            make = _put if create is not None and create.method == "PUT" else created_path
            thing_path = make(surveyor, create, read) if is_item and create is not None and collection_of(path) else ""
            # If nothing can be created here, an existing thing is changed and restored.
            is_fixed = not is_item or (bool(collection_of(path)) and (create is None or make is _put))
            free = [operation for operation in changes if not is_item or is_free(operation, path)]
            if free and is_fixed and not thing_path:
                kept = _Thing(surveyor, read, path_of_usual(read, values), is_own=False)
                kept.write(free)
                if not is_item and is_free(free[0], path):
                    kept.upload()
            if create is not None and thing_path:
                thing = _Thing(surveyor, read, thing_path)
                thing.try_undeclared()
                if "206" in read.responses:
                    thing.in_parts(read, thing.target)
                thing.write(changes)
                thing.upload()
                thing.beside(create, delete)
                thing.listed_below(operations, changes)
                if values.unique.knows(create) and changes:
                    thing.made_alike(create, changes, delete)
                thing.delete(delete, operations.get(("GET", collection_of(path))))
    with api.run.limit.lift(), suppress(NoAnswerError):
        post_files(surveyor, operations)
        change_entries(surveyor, operations)
        send_commands(surveyor, operations)
        write_siblings(surveyor, operations)
    return surveyor.trace


def _put(surveyor: Surveyor, create: Operation, read: Operation) -> str:
    """Create a thing under an identifier that the client chooses; return its path if nothing was there before."""
    path = path_chosen(read, _TURN)
    thing = _Thing(surveyor, read, path)
    if not path or thing.get(place="path of what does not exist").status not in ABSENT:
        return ""
    return path if thing.send(create, None).ok else ""


@dataclass
class _Thing:
    """A thing that the run has created, or a resource that it may write."""

    surveyor: Surveyor
    read: Operation
    target: str
    tag: str = ""
    last: Exchange | None = None
    revisions: set[str] = field(default_factory=set)
    # Whether the run has created it.
    is_own: bool = True
    # Existing files below it.
    below: list[tuple[Operation, Outgoing]] = field(default_factory=list)
    # Reads of files that were uploaded, with the last upload and all files.
    uploads: list[tuple[Operation, Outgoing, list[bytes]]] = field(default_factory=list)

    @property
    def api(self) -> RestInterface:
        """The interface that it is at."""
        return self.surveyor.api

    def get(self, *fields: tuple[str, str], place: str = "") -> Probe:
        """Read it, and note its entity tag."""
        probe = self.send(self.read, None, *fields, place=place)
        if probe.ok and probe.exchange is not None:
            self.last, self.tag = probe.exchange, probe.exchange.response.header("etag") or ""
            self.revisions |= {str(one) for name, one in self._members().items() if REVISION.search(plain_name(name))}
        return probe

    def _as_of_now(self, body: Any) -> Any:
        """Return a body with the present revision, where it has an earlier one."""
        now = self._members() if isinstance(body, dict) else {}
        now = {name: one for name, one in now.items() if str(body.get(name)) in self.revisions}
        return (
            {**body, **{name: one for name, one in now.items() if REVISION.search(plain_name(name))}} if now else body
        )

    def send(self, operation: Operation, body: Any, *fields: tuple[str, str], place: str = "") -> Probe:
        """Send an operation to it, with its usual body or another one."""
        inputs = usual_inputs(operation, self.surveyor.values)[0]
        inputs = inputs if body is None else replace(inputs, body=body if place == _STALE else self._as_of_now(body))
        request = request_of(operation, inputs)
        given = {name.lower() for name, _ in fields}
        headers = (*(pair for pair in request.headers if pair[0].lower() not in given), *fields)
        kind = Kind.ODD if given or place else Kind.AGAIN
        request = replace(request, target=self.target, headers=headers)
        return self.surveyor.send(operation, Variation(kind, "", place, inputs), request)

    def try_undeclared(self) -> None:
        """Send methods that the description does not have, to the thing and to paths below it."""
        if not self.get().ok:
            return
        template = self.read.template.rstrip("/")
        for resource in resources_of(self.api.run.contract):
            below = resource.template.removeprefix(template)
            if not resource.template.startswith(template) or "{" in below:
                continue
            for method in ("OPTIONS", *(one for one in _STANDARD if one not in resource.methods)):
                with suppress(NotPermittedError):
                    self.api.send(Outgoing(method, self.target.rstrip("/") + below))
        self.get()

    def write(self, changes: list[Operation]) -> None:
        """Write one member at a time, with wrong conditions and with right ones."""
        first = self.get()
        if not first.ok or first.exchange is None:
            return
        for change in changes:
            bodies = self._bodies(change)
            # A JSON patch has no members, so use the first patch that changes something.
            if refusable := bodies or list(islice(self._special(change), 1 if self.tag else 0)):
                self._send_refusable(change, refusable)
            self._at_once(change, bodies)
            alone = self._singly(change, bodies, whole_last=bool(self.tag and change is changes[0]))
            refused = self._write_each(change, bodies, alone, is_first=change is changes[0])
            if GUARDED.search(change.text) and len(self.revisions) > 1:
                self.send(change, bodies[0], *self._current(), place=_STALE)
                self.get()
            taken = [body for body in bodies[:-1] if body not in refused]
            if change.method == "PATCH" and refused and taken:
                # A device may store the part of a body that it would take alone.
                self.send(change, {**taken[0], **refused[0]}, *self._current())
                self.get()
            waits = True
            # Special bodies show what is written in other formats.
            formats = by_format(change)
            for own in formats[1:] if self.tag else ():
                self._send_refusable(own, list(islice(self._special(own), 1)))
            for one, body in ((own, body) for own in formats for body in self._special(own)):
                before, until = self._members(), time.monotonic() + _SETTLES_S
                is_done = self.send(one, body, *self._current(), place="body").ok
                self.get()
                # A JSON patch describes the change, which a device may carry out later.
                while waits and is_done and is_list_of_changes(before, body) and self._members() == before:
                    waits = time.monotonic() < until
                    time.sleep(_PAUSE_S if waits else 0)
                    self.get()

    def _write_each(self, change: Operation, bodies: list[Any], alone: list[Any], *, is_first: bool) -> list[Any]:
        """Write bodies one after another, and read after each; return those of one member that are refused."""
        refused, is_behind = list[Any](), False
        beyond_ascii = (one for one in bodies if not all(str(item).isascii() for item in one.values()))
        for turn, body in enumerate(alone if self.tag else [*islice(beyond_ascii, 1), *alone]):
            old = self.tag
            is_done = self.send(change, body, *self._current(None if turn else change)).ok
            if is_done or not turn:
                self.get()
            elif body in bodies[:-1]:
                refused.append(body)
            if is_done and old not in {"", self.tag} and is_first and not is_behind:
                is_behind = True
                self._behind(change, bodies[-1], old)
        return refused

    def _singly(self, change: Operation, bodies: list[Any], *, whole_last: bool) -> list[Any]:
        """Return bodies of several writes: each member alone, and all together, which restores them.

        A PATCH writes all twice, in either order: it must leave the others as they are. A PUT writes all, few, all.
        """
        is_patch, now = change.method == "PATCH", self._members()
        singles = bodies[:-1][:_SINGLES] if is_patch else bodies[-3:-1]
        old = [{name: now[name] for name in singles[0] if name in now}] if is_patch and len(singles) > 1 else []
        again = [*old, *(reversed(singles) if old else ())] if is_patch else bodies[-1:] if singles else []
        return [*bodies[:-1], *again, *bodies[-1:]] if whole_last else [*bodies[-1:], *singles, *again]

    def _send_refusable(self, change: Operation, bodies: Sequence[Any] = ()) -> None:
        """Send requests whose headers alone let the device refuse them, and read after each.

        That is a wrong condition or none, no format that the device has, and no credentials.
        """
        names = {parameter.name.lower() for parameter in change.parameter("header")}
        # Twice, because a device may take the second try for a wish to overwrite.
        tried: list[tuple[tuple[str, str], ...]] = [(("If-Match", NO_TAG),)] * 2 if self.tag else []
        if self._current() and "if-match" in names:
            # Strong comparison: a weak tag matches none (RFC 9110 13.1.1).
            tried += [
                (("If-Match", f"W/{self.tag}"),),
                *([(("If-Match", _NEITHER),)] if takes_tags(change, _NEITHER) else []),
            ]
        if self.tag and "428" in change.responses:
            tried.append(())
        if self.tag and "if-none-match" in names:
            tried.append((("If-None-Match", "*"),))
        if self._current() and "if-match" in names and change.method != "DELETE" and takes_tags(change, "*"):
            tried.append((("If-Match", "*"),))
        if "406" in change.responses:
            tried.append((("Accept", NO_FORMAT),))
        # First without credentials: a later request may be carried out.
        if demands(self.api.run.contract.openapi, change):
            body, inputs = self._other(bodies), usual_inputs(change, self.surveyor.values)[0]
            request = request_of(change, inputs if body is None else replace(inputs, body=body))
            headers = (*request.headers, *self._current())
            self.api.client.send(change.method, self.target, headers=headers, body=request.body, authorized=False)
            self.get()
        for fields in tried:
            is_right = fields and fields[0][0] != "If-Match"
            self.send(change, self._other(bodies), *fields, *(self._current() if is_right else ()))
            if not self.get().ok:
                return

    def _at_once(self, change: Operation, bodies: Sequence[Any]) -> None:
        """Write from two clients at the same moment with the same entity tag; one of them must be refused.

        What they have changed is restored, so that each write after it changes its member, whoever was first.
        """
        names = {parameter.name.lower() for parameter in change.parameter("header")}
        now = self._members()
        others = [one for one in bodies if any(not same(now.get(name), one[name]) for name in one)]
        if self._current() and "if-match" in names and len(others) > 1:
            inputs = usual_inputs(change, self.surveyor.values)[0]
            own = [request_of(change, replace(inputs, body=body)) for body in others[:2]]
            fields = [tuple(pair for pair in own[0].headers if pair[0].lower() != "if-match"), self._current()]
            requests = [replace(request, target=self.target, headers=(*fields[0], *fields[1])) for request in own]
            send_together([[(self.api.client, request) for request in requests]])
            self.get()
            self.send(change, bodies[-1], *self._current())
            self.get()

    def _other(self, bodies: Sequence[Any]) -> Any:
        """Return a body that would change it; None without any."""
        now = self._members()
        objects = (body for body in bodies if isinstance(body, dict))
        others = (item for item in objects if any(not same(now.get(name), item[name]) for name in item))
        return next(others, bodies[0] if bodies else None)

    def _behind(self, change: Operation, body: Any, old: str) -> None:
        """Write and read by the entity tag that it had before: a client that missed a change (RFC 9110 13.1)."""
        self.send(change, body, ("If-Match", old))
        self.get()
        for tag in (old, NO_TAG):
            self.get(("If-None-Match", tag))
            self.get()

    def upload(self) -> None:
        """Upload files to a thing or to a sub-resource, and read them back: all bytes must be the same."""
        own = self.read.template.rstrip("/")
        operations = {
            (operation.method, operation.template): operation for operation in operations_of(self.api.run.contract)
        }
        for (method, template), read in operations.items():
            put = operations.get(("PUT", template))
            below = template.rstrip("/").removeprefix(own)
            if method != "GET" or put is None or not f"{template}/".startswith(f"{own}/") or "{" in below:
                continue
            media_type, *others = [body for body in put.bodies if keeps_octets(body)] or [""]
            if not (media_type or _TEXT in put.bodies) or not (allows(self.api, put) and allows(self.api, read)):
                continue
            path = self.target.rstrip("/") + below
            whole = replace(request_of(read, usual_inputs(read, self.surveyor.values)[0]), target=path)
            files = [(media_type, file_of(media_type, octets)) for octets in FILES if media_type]
            files += [(_TEXT, octets) for octets in _TEXTS if _TEXT in put.bodies]
            first = self.surveyor.send(read, Variation(Kind.AGAIN, "", "", Inputs()), whole)
            # Another media type comes first: a refused one ends the uploads.
            for other in others[:1]:
                inputs = replace(usual_inputs(put, self.surveyor.values)[0], media_type=other)
                for octets in FILES[:2]:
                    sent = replace(inputs, body=file_of(other, octets))
                    request = replace(request_of(put, sent), target=path)
                    self.surveyor.send(put, Variation(Kind.ODD, "", "", sent), request)
                    self.surveyor.send(read, Variation(Kind.AGAIN, "", "", Inputs()), whole)
            for number, (kept_as, octets) in enumerate(files, 1):
                inputs = replace(usual_inputs(put, self.surveyor.values)[0], body=octets, media_type=kept_as)
                request = replace(request_of(put, inputs), target=path)
                # A device may look into an image, and refuse one that is too small or too wide.
                kind = Kind.AGAIN if kept_as == _OCTETS else Kind.ODD
                if not self.surveyor.send(put, Variation(kind, "", "", inputs), request).ok:
                    break
                self.in_parts(read, path, more="206" in read.responses and number == len(FILES))
            else:
                for _, octets in files[-2:]:
                    coded = replace(request, body=octets, headers=(*request.headers, _IN_CHUNKS))
                    self.surveyor.send(put, Variation(Kind.ODD, "", "", inputs), coded)
                    self.surveyor.send(read, Variation(Kind.AGAIN, "", "", Inputs()), whole)
                earlier = [octets for _, octets in files[:-1]]
                earlier += [first.exchange.response.body] if first.exchange is not None and first.ok else []
                earlier += [file_of(other, octets) for other in others[:1] for octets in FILES[:2]]
                self._look_again(read, whole, earlier)
                for again in (replace(whole, method="HEAD"), whole):
                    self.surveyor.send(read, Variation(Kind.ODD, "", "", Inputs()), again, fresh=False)
                self.surveyor.send(put, Variation(Kind.ODD, "", "", inputs), replace(request, body=b""))
                self._end_file(put, read, operations.get(("DELETE", template)), request, whole)
                self.uploads.append((read, request, [octets for _, octets in files]))

    def beside(self, create: Operation, delete: Operation | None) -> None:
        """Upload files to another thing, which is created for this, and to this one in turn; read that of the other."""
        other = created_path(self.surveyor, create, self.read) if self.uploads and create.method == "POST" else ""
        for read, own, files in self.uploads if other else ():
            there = other.rstrip("/") + own.target.removeprefix(self.target.rstrip("/"))
            whole = replace(request_of(read, usual_inputs(read, self.surveyor.values)[0]), target=there)
            for first, second in pairwise(files):
                for target, octets in ((there, first), (own.target, second)):
                    self.api.send(replace(own, target=target, body=octets))
                self.surveyor.send(read, Variation(Kind.AGAIN, "", "", Inputs()), whole)
        if delete is not None and other:
            Writer(self.api, self.surveyor.values).conditional(delete, self.read, other)

    def listed_below(self, operations: Mapping[tuple[str, str], Operation], changes: Sequence[Operation]) -> None:
        """Create items in each list below it, and look for them there, in parts, and below another thing."""
        own, values = self.read.template.rstrip("/"), self.surveyor.values
        for (method, template), create in operations.items():
            read, below = operations.get(("GET", template)), template.removeprefix(own)
            listing = listing_of(read) if read is not None else None
            if method != "POST" or read is None or not template.startswith(f"{own}/") or "{" in below:
                continue
            usual = usual_inputs(create, values)[0]
            bodies = [usual.body, with_texts(create, usual.body)] if listing is not None else []
            fresh = (with_new_values(create, replace(usual, body=body), values) for body in bodies if body is not None)
            made = [self._at(create, inputs, below) for inputs in fresh]
            if not made or listing is None:
                continue
            known = (str(item) for item in values.known_ids(self.read, self.read.parameter("path")[-1]))
            others = (f"{self.target.rstrip('/').rpartition('/')[0]}/{quote(text, safe='')}{below}" for text in known)
            other = next((one for one in others if one != self.target.rstrip("/") + below), "")
            before = self._items(listing, other)
            for outgoing, inputs in made:
                self.surveyor.send(create, Variation(Kind.AGAIN, "", "", inputs), outgoing)
            # At once: as often as makes several pages.
            send_together([[(self.api.client, one) for one, _ in (made[0], *made)]])
            inputs = usual_inputs(read, values)[0]
            outgoing, _ = self._at(read, inputs, below)
            found = self.surveyor.send(read, Variation(Kind.AGAIN, "", "", inputs), outgoing).exchange
            read_numbers(Writer(self.api, values), read, outgoing.target.partition("?")[0])
            for change in changes:
                bodies = self._bodies(change) if is_left(change, template) and self.get().ok else []
                if bodies and self.send(change, bodies[-1], *self._current()).ok:
                    self.api.send(replace(outgoing, target=outgoing.target.partition("?")[0]))
            page = page_of(found.response, read) if found is not None else None
            after = self._items(listing, other) if before is not None and page is not None else None
            if after is not None and before is not None and page is not None:
                both = [item for item in after[1] if item in page.items and item not in before[1]]
                expected, fault = f"no item that was created at {outgoing.target}", f"{clip(both[0])}" if both else ""
                self.surveyor.paged.append(Paged(read.label, ANOTHER, after[0], expected, fault))
                self._read_elsewhere(operations, template, page.items[-1], other)
            self.surveyor.paged += pages_below(self.api, values, listing, outgoing.target.partition("?")[0])

    def _read_elsewhere(
        self, operations: Mapping[tuple[str, str], Operation], template: str, value: Any, other: str
    ) -> None:
        """Read what is in a list below this thing as if it were below another one."""
        for (method, path), item in operations.items():
            id_ = identifier_of(value, item) if method == "GET" and collection_of(path) == template else ""
            if id_:
                found = self.api.send(Outgoing("GET", f"{other}/{quote(id_, safe='')}"))
                expected = f"a refusal, as {id_} is not below that thing"
                fault = found.came if found.response.ok else ""
                doubt = "identifiers may be unique among all things"
                self.surveyor.paged.append(Paged(item.label, ANOTHER, found, expected, fault, doubt))

    def _at(self, operation: Operation, inputs: Inputs, below: str) -> tuple[Outgoing, Inputs]:
        """Return a request to what is below it, with the inputs that it has."""
        request = request_of(operation, inputs)
        target = self.target.rstrip("/") + below + "".join(request.target.partition("?")[1:])
        return replace(request, target=target), inputs

    def _items(self, listing: Listing, path: str) -> tuple[Exchange, tuple[Any, ...]] | None:
        """Read a list below another thing; None without one."""
        found = self.api.send(Outgoing("GET", path)) if path else None
        page = page_of(found.response, listing.operation) if found is not None else None
        return (found, tuple(page.items)) if found is not None and page is not None else None

    def in_parts(self, read: Operation, path: str, *, more: bool = True) -> None:
        """Read a file, ranges of it, and the file again."""
        whole = replace(request_of(read, usual_inputs(read, self.surveyor.values)[0]), target=path)
        self.surveyor.send(read, Variation(Kind.AGAIN, "", "", Inputs()), whole)
        read_parts(self.surveyor, read, whole, more=more)

    def _end_file(
        self, put: Operation, read: Operation, delete: Operation | None, request: Outgoing, whole: Outgoing
    ) -> None:
        """Write to a file that is there as if it were not, delete it, and write it again; read it after each."""
        conditions = {"if-none-match": ("If-None-Match", "*"), "if-match": ("If-Match", NO_TAG)}
        names = {parameter.name.lower() for parameter in put.parameter("header")}
        steps: list[tuple[Operation, Outgoing, tuple[tuple[str, str], ...]]] = [
            (put, request, (field,)) for name, field in conditions.items() if name in names
        ]
        if delete is not None and allows(self.api, delete):
            own = request_of(delete, usual_inputs(delete, self.surveyor.values)[0])
            steps.append((delete, replace(own, target=whole.target), ()))
        for operation, outgoing, fields in steps:
            headers = (*(pair for pair in outgoing.headers if pair[0].lower() not in conditions), *fields)
            odd = Variation(Kind.ODD, "", "", Inputs())
            done = self.surveyor.send(operation, odd, replace(outgoing, headers=headers))
            if operation is delete and done.ok:
                self._look_at_gone(read, whole)
                self.surveyor.send(put, odd, request)
                self.below.append((read, whole))
            else:
                self.surveyor.send(read, odd, whole)

    def _look_again(self, read: Operation, request: Outgoing, earlier: list[bytes]) -> None:
        """Read a file until it is no longer the earlier one, or the time for that is over."""
        began, again = time.monotonic(), Variation(Kind.AGAIN, "", "", Inputs())
        while (found := self.surveyor.send(read, again, request).exchange) and found.response.body in earlier:
            if time.monotonic() - began > _SETTLES_S:
                return
            time.sleep(_PAUSE_S)

    def _look_at_gone(self, read: Operation, request: Outgoing) -> None:
        """Read a deleted thing until it is gone, or the time for that is over."""
        began = time.monotonic()
        while self.surveyor.send(read, Variation(Kind.ODD, "", _GONE_PLACE, Inputs()), request).ok:
            if time.monotonic() - began > _SETTLES_S:
                return
            time.sleep(_PAUSE_S)

    def _bodies(self, change: Operation) -> list[Any]:
        is_there = not self.is_own and bool(self.read.parameter("path"))
        may = partial(is_changeable, collections=self.surveyor.values.collections) if is_there else lambda *_: True
        return Writer(self.api, self.surveyor.values).singly(change, self._members(), may)

    def _members(self) -> dict[str, Any]:
        return members(self.last, ()) if self.last is not None else {}

    def _special(self, change: Operation) -> Iterator[Any]:
        """Yield bodies with other values for members that the device sets, and with missing, null or wrong members."""
        media_type, values = next(iter(change.bodies), ""), self.surveyor.values
        if not is_json(media_type) or self.last is None:
            return
        parts = flat(change.bodies[media_type].schema).get("properties", {})
        single = not self.is_own

        def may(name: str) -> bool:
            return not single or is_changeable(name, parts.get(name, {}), values.collections)

        if not single or is_free(change, self.read.template):
            yield from special_bodies(
                change, self.read, lambda: members(self.last, parts) if self.last else {}, values, may
            )

    def made_alike(self, create: Operation, changes: list[Operation], delete: Operation | None) -> None:
        """Give the thing a value that only one thing may have, taken from a thing that is created for this."""
        unique = self.surveyor.values.unique
        path = created_path(self.surveyor, create, self.read)
        other = _Thing(self.surveyor, self.read, path)
        if not path or path == self.target or not other.get().ok or not self.get().ok:
            return
        for change in changes:
            parts = flat(change.bodies[next(iter(change.bodies))].schema).get("properties", {}) if change.bodies else {}
            own = members(self.last, parts) if self.last else {}
            theirs = members(other.last, parts) if other.last else {}
            taken = {name: theirs[name] for name in unique.names(create) if name in theirs and name in parts}
            kept = {name: one for name, one in own.items() if name in parts and not parts[name].get("readOnly")}
            if taken:
                # What is right beside it must not be stored either.
                bodies, names = self._bodies(change), unique.names(change)
                more = {name: one for body in bodies[:-1] for name, one in body.items() if name not in names}
                right = more if change.method == "PATCH" else {**kept, **more}
                self.send(change, {**right, **taken}, *self._current(), place="body")
                self.get()
                other.get()
        if delete is not None:
            other.send(delete, None, *other._current())

    def _current(self, second: Operation | None = None) -> tuple[tuple[str, str], ...]:
        """Return If-Match with the thing's entity tag; a weak tag never matches (RFC 9110 13.1.1).

        Args:
            second: for this operation it is the second of two tags, if the schema of the field allows a list.
        """
        tags = f"{NO_TAG}, {self.tag}"
        tags = tags if second is not None and takes_tags(second, tags) else self.tag
        return (("If-Match", tags),) if self.tag and not self.tag.startswith("W/") else ()

    def delete(self, delete: Operation | None, lister: Operation | None) -> None:
        """Send DELETE with a wrong condition, then with a right one; look for the thing in the list by each filter."""
        if delete is None or not self.get().ok:
            return
        was, began = members(self.last, ()) if self.last is not None else {}, time.monotonic()
        listing = listing_of(lister) if lister is not None and lister.label not in self.api.streams else None
        id_ = identifier_of(was, self.read)
        queries = list(choosing(listing, was)) if listing is not None and id_ else []
        read_numbers(Writer(self.api, self.surveyor.values), lister, self.target.rpartition("/")[0])
        for query in queries:
            # A device may cache the response.
            self._look_in(listing, query, id_, began - _SETTLES_S)
        self._send_refusable(delete)
        ends, own = ending_with(delete), self.read.template.rstrip("/")
        for read in operations_of(self.api.run.contract):
            above, _, last = read.template.rstrip("/").rpartition("/")
            is_ending = read.method == "GET" and above == own and singular(last) in ends
            if is_ending and "404" in read.responses and allows(self.api, read):
                there = Outgoing("GET", f"{self.target.rstrip('/')}/{last}")
                self.below.append((read, there))
        if not self.get().ok:
            return
        if not self.send(delete, None, *self._current(delete)).ok:
            self.get()
            self.send(delete, None, *self._current())
        self.get(place=_GONE_PLACE)
        head = replace(request_of(self.read, usual_inputs(self.read, self.surveyor.values)[0]), method="HEAD")
        variation = Variation(Kind.ODD, "", _GONE_PLACE, Inputs())
        self.surveyor.send(self.read, variation, replace(head, target=self.target), fresh=False)
        is_gone = self.get(place=_GONE_PLACE).status in ABSENT
        for read, request in self.below if is_gone else ():
            self._look_at_gone(read, request)
        read_numbers(Writer(self.api, self.surveyor.values), lister, self.target.rpartition("/")[0])
        for query in queries if is_gone else ():
            self._look_in(listing, query, id_, began)

    def _look_in(self, listing: Listing | None, query: dict[str, Any], id_: str, began: float) -> None:
        """Read a list until a deleted thing has left it, or the time for that is over."""
        if listing is None:
            return
        inputs = usual_inputs(listing.operation, self.surveyor.values)[0]
        inputs = replace(inputs, query={**inputs.query, **query})
        while True:
            is_last = time.monotonic() - began > _SETTLES_S
            found = self.surveyor.send(listing.operation, Variation(Kind.AGAIN, "", "", inputs)).exchange
            page = page_of(found.response, listing.operation) if found is not None else None
            if is_last or page is None or id_ not in {identifier_of(item, self.read) for item in page.items}:
                return
            time.sleep(_PAUSE_S)
