"""What an item's path leads to: the item with the identifier in the path (RFC 9110 9.3.1)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Final
from urllib.parse import unquote

from conformance.api.rest.listing import listed
from conformance.api.rest.things import collection_of, identifier_of
from conformance.checkers.occasion import Occasion
from conformance.documents.json_text import read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.verdict.case import Case

# So many identifiers of a run are remembered.
_REMEMBERED: Final = 50_000


class Identities:
    """Judges each GET of an item by the identifiers that the run has seen.

    An item may have other names, and a path may have a name of its own such as ``current``. So only a path counts that
    has led to its own item before; or one whose identifier the list has, if it leads to another item of the list.
    """

    def __init__(self) -> None:
        # By the path of a collection: the identifiers in its list, and those whose path has led to their own item.
        self._listed: dict[str, set[str]] = defaultdict(set)
        self._own: dict[str, set[str]] = defaultdict(set)
        self._items: dict[str, Operation] | None = None
        self._count = 0

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, answer = occasion.operation, occasion.response
        method = occasion.request.method
        if self._items is None:
            found = [one for one in operations_of(occasion.contract) if one.method == "GET"]
            self._items = {collection_of(one.template): one for one in found if collection_of(one.template)}
        if not self._items or operation is None or not answer.ok or method in SAFE - {"GET"}:
            return
        path = occasion.context.target.partition("?")[0].rstrip("/")
        above, _, last = path.rpartition("/")
        id_ = unquote(last).casefold()
        if method != "GET":
            # It may be renamed, or become another one.
            self._own[above].discard(id_)
        if method != "GET" or answer.cut or not is_json(answer.media_type):
            return
        item = self._items.get(operation.template.rstrip("/"))
        if item is not None:
            items = listed(read_json(answer.body).value) or []
            ids = {identifier_of(one, item) for one in items if isinstance(one, dict)} - {""}
            self._count += len(ids)
            if self._count < _REMEMBERED:
                self._listed[path] |= ids
        if collection_of(operation.template):
            yield from self._item(occasion, operation, above, id_)

    def _item(self, occasion: Occasion, operation: Operation, above: str, id_: str) -> Iterator[Case]:
        own, known = self._own[above], self._listed[above]
        text = identifier_of(read_json(occasion.response.body).value, operation)
        if not text:
            return
        is_own = text == id_
        if is_own and len(own) < _REMEMBERED:
            own.add(id_)
        if is_own or id_ in own or (own and id_ in known and text in known):
            expected = f"the item with the identifier {id_} in the path"
            yield occasion.case(
                "description/own-identifier",
                is_own,
                expected,
                f"the item with the identifier {text}",
                cause=operation.label,
            )
