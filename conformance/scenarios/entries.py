"""Create, change and delete entries that only their list shows, and read the list after each of these requests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import islice
from typing import Any, Final
from urllib.parse import quote, unquote

from conformance.api.rest.inputs import request_of, usual_inputs
from conformance.api.rest.listing import Listing, listing_of, page_of
from conformance.api.rest.samples import fits
from conformance.api.rest.things import collection_of, id_member, identifier_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation
from conformance.documents.representation import flat
from conformance.scenarios.creating import FULL, makes_room, with_texts
from conformance.scenarios.survey import Surveyor
from conformance.scenarios.writing import Writer
from conformance.transport.exchange import Exchange

_LISTS: Final = 4  # lists that are tried
_ENTRIES: Final = 3  # entries that are created in each list
_LIMIT: Final = 100  # items to request for a page if no maximum is declared
# In this turn, the usual body is sent.
_USUAL: Final = 1
_CHANGES: Final = ("PATCH", "PUT")


def change_entries(surveyor: Surveyor, operations: Mapping[tuple[str, str], Operation]) -> None:
    """Write to lists whose entries no operation reads by themselves."""
    read = {collection_of(template) for method, template in operations if method == "GET"}
    lists = (
        (create, lister, listing)
        for (method, template), create in operations.items()
        if method == "POST" and template not in read
        if (lister := operations.get(("GET", template))) is not None and (listing := listing_of(lister)) is not None
    )
    for create, lister, listing in islice(lists, _LISTS):
        of_entry = {
            method: operation
            for (method, template), operation in operations.items()
            if collection_of(template) == create.template.rstrip("/")
        }
        _Entries(Writer(surveyor.api, surveyor.values), create, lister, listing, of_entry).write()


class _Entries:
    """A list, and what changes its entries."""

    def __init__(
        self, writer: Writer, create: Operation, lister: Operation, listing: Listing, of_entry: Mapping[str, Operation]
    ) -> None:
        self._writer, self._create, self._lister, self._of_entry = writer, create, lister, of_entry
        usual = request_of(lister, usual_inputs(lister, writer.values)[0])
        self._path = usual.target.partition("?")[0]
        most = flat(listing.limit.schema).get("maximum", _LIMIT) if listing.limit is not None else None
        is_fit = listing.limit is not None and fits(listing.limit.schema, most)
        self._query = {listing.limit.name: most} if listing.limit is not None and is_fit else {}

    def write(self) -> None:
        """Create entries, change and delete one in their midst, create another, and read the list each time."""
        self._read()
        paths = [self._create_one(turn) for turn in range(_ENTRIES)]
        self._read()
        # Neither the newest nor the oldest: a device may delete another than the one that is named.
        path = next(filter(None, (*paths[1:], *paths)), "") or self._own()
        for turn, method in enumerate(_CHANGES if path else (), _ENTRIES + 1):
            change = self._of_entry.get(method)
            for body in self._writer.bodies(change, turn)[:1] if change is not None else ():
                old = page_of(self._read().response, self._lister)
                if change is not None and self._writer.conditional(change, self._lister, path, body).response.ok:
                    self._read_until(lambda items: old is None or items != old.items)  # noqa: B023 - called at once
        delete = self._of_entry.get("DELETE")
        if delete is not None and path:
            self._read()
            id_ = unquote(path.rstrip("/").rpartition("/")[2]).casefold()
            if self._writer.send(delete, path).response.ok:
                self._read_until(lambda items: id_ not in {identifier_of(one, delete) for one in items})
            # An identifier that counts the entries is that of another one now.
            self._create_one(0)
            self._read()

    def _create_one(self, turn: int) -> str:
        """Create an entry, another one each turn; return the path by which it is changed, or an empty text."""
        body = next(islice(self._writer.bodies(self._create, turn), int(turn == _USUAL), None), None)
        first = body if turn or body is None else with_texts(self._create, body) or body
        made = self._writer.send(self._create, self._path, first)
        if made.response.status in FULL and makes_room(self._writer.api, made):
            made = self._writer.send(self._create, self._path, body)
        for other in (body, None) if body is not None else ():
            made = made if made.response.ok else self._writer.send(self._create, self._path, other)
        item = next(iter(self._of_entry.values()), None)
        id_: Any = id_member(read_json(made.response.body).value, item)[1] if item is not None else None
        end = "/" if item is not None and item.template.endswith("/") else ""
        return f"{self._path.rstrip('/')}/{quote(str(id_), safe='')}{end}" if made.response.ok and id_ else ""

    def _own(self) -> str:
        """Return the path of an entry that the run created before; empty without one."""
        left = self._writer.api.left
        ours = left.created_in(self._path) if left is not None else []
        return ours[len(ours) // 2] if ours else ""

    def _read(self) -> Exchange:
        return self._writer.send(self._lister, self._path, query=self._query)

    def _read_until(self, holds: Callable[[tuple[Any, ...]], bool]) -> None:
        """Read the list until its items meet a condition, or for a few seconds."""

        def is_done(exchange: Exchange) -> bool:
            page = page_of(exchange.response, self._lister)
            return page is None or holds(page.items)

        self._writer.until(self._read, is_done)
