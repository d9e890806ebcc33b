"""The state in which a run left a described device: things that it created, changed, deleted and started last.

At its end, a run deletes what it created, and writes back what it changed, as far as the description allows that.
"""

from __future__ import annotations

import json
import time
from collections import defaultdict
from collections.abc import Iterable
from contextlib import suppress
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import unquote, urlsplit

from conformance.api.rest.applicable import allows
from conformance.api.rest.listing import items_of
from conformance.api.rest.things import collection_of, id_member, may_create
from conformance.api.rest.values import IDS
from conformance.documents.files import keeps_octets
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation, is_json, matching
from conformance.documents.representation import flat
from conformance.transport.exchange import Exchange, NoAnswerError, NotPermittedError
from conformance.transport.reach import is_same, joined, path_of
from conformance.verdict.finding import few_of

if TYPE_CHECKING:
    from conformance.api.rest.interface import RestInterface

# Ids, paths and operations that a line of the summary names; the result has all. _ID: characters of an id.
_NAMED: Final = 3
_ID: Final = 60
_WANTS_CONDITION: Final = frozenset({HTTPStatus.PRECONDITION_FAILED, HTTPStatus.PRECONDITION_REQUIRED})
_GONE: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.GONE})


class LeftBehind:
    """Follows the exchanges of a run, and keeps those that changed something for good.

    Args:
        operations: operations of the description.
        base_url: URL below which they are.
    """

    def __init__(self, operations: Iterable[Operation], base_url: str) -> None:
        self._base_url = base_url
        items = ((collection_of(operation.template), operation) for operation in operations)
        self._items = {collection: item for collection, item in items if collection}
        self._created: dict[str, tuple[str, str]] = {}
        self._new: set[str] = set()
        self._of_own: set[str] = set()
        self._changed: dict[str, tuple[str, bytes | None]] = {}
        self._deleted: dict[str, str] = {}
        self._read: dict[str, bytes] = {}
        self._last: dict[str, int] = {}

    def follow(self, operation: Operation, exchange: Exchange) -> None:
        """Record what an exchange with an operation changes on the device."""
        request, answer = exchange.request, exchange.response
        path = request.url.removeprefix(self._base_url).partition("?")[0]
        if operation.method == "GET":
            self._look(path, exchange)
        if operation.safe or not answer.ok:
            return
        # A thing that is written again becomes the last one written.
        self._last.pop(operation.label, None)
        self._last[operation.label] = answer.status
        made = self.created_path(operation, path, exchange)
        if operation.method == "DELETE":
            ours = [text for text in self._created if text == path or text.startswith(f"{path.rstrip('/')}/")]
            for text in ours:
                del self._created[text]
            if ours:
                self._of_own.add(operation.label)
            else:
                self._deleted[path] = operation.label
        elif made:
            self._of_own.add(operation.label)
            self._created[made] = operation.label, unquote(made.rstrip("/").rpartition("/")[2])
            known = self._read.get(path.rstrip("/"), self._read.get(path))
            items = None if known is None else items_of(read_json(known).value)
            item = self._items.get(operation.template.rstrip("/"))
            ids = {str(_id_of(one, item)) for one in items or ()}
            is_new = items is not None and may_create(operation, answer.status) and self._created[made][1] not in ids
            if answer.status == HTTPStatus.CREATED or is_new:
                self._new.add(made)
        elif operation.method in {"PUT", "PATCH"} and path not in self._created:
            before = self._read.pop(path, None)
            self._changed.setdefault(path, (operation.label, before))

    def _look(self, path: str, exchange: Exchange) -> None:
        if exchange.response.status in _GONE:
            self._created.pop(path, None)
        elif exchange.response.ok and "?" not in exchange.request.url:
            self._read[path] = exchange.response.body

    def created_path(self, operation: Operation, path: str, exchange: Exchange) -> str:
        """Return the path of the thing that a request created; empty if it created none, or one without a path."""
        answer = exchange.response
        location = answer.header("location") or ""
        if operation.method == "PUT":
            return path if answer.status == HTTPStatus.CREATED else ""
        if operation.method != "POST":
            return ""
        if location and answer.status == HTTPStatus.CREATED:
            target = joined(exchange.request.url, location)
            made = path_of(target) if is_same(target, exchange.request.url) else ""
            return made.removeprefix(urlsplit(self._base_url).path.rstrip("/"))
        item = self._items.get(operation.template.rstrip("/"))
        if item is None and answer.status != HTTPStatus.CREATED:
            return ""
        id_ = _id_of(read_json(answer.body).value if is_json(answer.media_type) else None, item)
        return "" if id_ is None else f"{path.rstrip('/')}/{id_}{'/' if path.endswith('/') else ''}"

    def created_in(self, collection: str) -> list[str]:
        """Return the paths of things that the run has created in a collection, the oldest first."""
        above = collection.rstrip("/")
        return [path for path in self._created if path in self._new and path.rstrip("/").rpartition("/")[0] == above]

    def make_room(self, api: RestInterface, collection: str) -> bool:
        """Delete the older half of what the run created in a collection that takes no more; return whether it did."""
        ours = self.created_in(collection)
        sent = [_send(api, "DELETE", path) for path in ours[: len(ours) // 2]]
        return any(exchange is not None and exchange.response.ok for exchange in sent)

    def tidy_up(self, api: RestInterface, longest_s: float) -> bool:
        """Delete what the run created, the newest first, and write back what it changed; return whether it wrote.

        Sends what may be called and moves nothing. What was answered 200 and may have been there is left.

        Args:
            api: the device's REST interface, whose exchanges are followed.
            longest_s: after this time it ends with the request that it has begun, s.
        """
        until, wrote, last = time.monotonic() + longest_s, False, dict(self._last)
        with suppress(NoAnswerError, NotPermittedError):
            for path in reversed([path for path in self._created if path in self._new]):
                if time.monotonic() < until and path in self._created:
                    _send(api, "DELETE", path)
            for path, (_, before) in self._changed.items():
                read = _send(api, "GET", path) if before is not None and time.monotonic() < until else None
                if read is not None and read.response.ok and read.response.body != before:
                    sent = (_send(api, method, path, before) for method in ("PUT", "PATCH"))
                    wrote |= any(exchange is not None and exchange.response.ok for exchange in sent)
                    _send(api, "GET", path)
        self._last = last
        return wrote

    def document(self) -> dict[str, Any]:
        """Return the things left behind, for result.json, with lines for readers; empty if there are none."""
        created: dict[str, list[str]] = defaultdict(list)
        for label, id_ in self._created.values():
            created[label].append(id_)
        deleted: dict[str, list[str]] = defaultdict(list)
        for path, label in self._deleted.items():
            deleted[label].append(unquote(path.rpartition("/")[2]))
        changed = {
            path: label
            for path, (label, before) in self._changed.items()
            if before is None or self._read.get(path) != before
        }
        last = [{"operation": label, "status": status} for label, status in reversed(self._last.items())]
        if not last:
            return {}
        said = {*self._of_own, *deleted, *(label for label, _ in self._changed.values())}
        lines = (
            ("created and not deleted", [_things(label, ids) for label, ids in created.items()]),
            ("changed", [f"{path[:_ID]} by {label.partition(' ')[0]}" for path, label in changed.items()]),
            ("deleted", [_things(label, ids) for label, ids in deleted.items()]),
            (
                "called last",
                [f"{item['operation']} with {item['status']}" for item in last if item["operation"] not in said],
            ),
        )
        return {
            "lines": [f"{what}: {few_of(found, _NAMED)}" for what, found in lines if found],
            "created": [{"operation": label, "ids": ids} for label, ids in created.items()],
            "changed": [{"operation": label, "path": path} for path, label in changed.items()],
            "deleted": [{"operation": label, "ids": ids} for label, ids in deleted.items()],
            "last": last,
        }


def _id_of(value: Any, item: Operation | None) -> str | int | None:
    """Return the identifier of a representation: as its item's path has it, or else by the member's name."""
    found = None if item is None else id_member(value, item)[1]
    members = value if isinstance(value, dict) else {}
    by_name = (members[name] for name in IDS if isinstance(members.get(name), str | int))
    return next(by_name, None) if found is None else found


def _send(api: RestInterface, method: str, path: str, was: bytes | None = None) -> Exchange | None:
    """Send a request, again with an If-Match if the device wants one; None if the description does not allow it.

    Args:
        api: the device's REST interface.
        method: the method of the request.
        path: below the base URL.
        was: what a read of the thing said; its members that the operation takes are the request's body.
    """
    operation = matching(api.run.contract, method, path)
    if operation is None or operation.motion or not allows(api, operation):
        return None
    headers: tuple[tuple[str, str], ...] = ()
    body = b""
    if was is not None:
        media_type = next(filter(is_json, operation.bodies), "")
        value = read_json(was).value
        if media_type and value is not None:
            taken = flat(operation.bodies[media_type].schema).get("properties", {})
            if taken and isinstance(value, dict):
                kept = {name for name, part in taken.items() if not flat(part).get("readOnly")}
                value = {name: one for name, one in value.items() if name in kept}
            body = json.dumps(value).encode()
        elif media_type := next(filter(keeps_octets, operation.bodies), ""):
            body = was
        else:
            return None
        headers = (("Content-Type", media_type),)
    sent = api.client.send(method, path, headers=headers, body=body)
    if sent.response.status in _WANTS_CONDITION and (read := _send(api, "GET", path)) is not None:
        tag = read.response.header("etag") or ""
        return api.client.send(method, path, headers=(*headers, ("If-Match", tag)), body=body)
    return sent


def _things(label: str, ids: list[str]) -> str:
    shown = ", ".join(text[:_ID] for text in ids[-_NAMED:])
    earlier = "… " if len(ids) > _NAMED else ""
    return f"{len(ids)} by {label} (id{'s' if len(ids) > 1 else ''} {earlier}{shown})"
