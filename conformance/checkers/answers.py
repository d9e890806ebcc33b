"""Responses to writes: they show what was sent, if the next read does, and not one value whatever is sent."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import quote

from conformance.api.rest.patches import same
from conformance.api.rest.references import collections_of
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import collection_of, differences, id_member, is_devices, is_shared, parts_of
from conformance.checkers.occasion import Occasion
from conformance.contract.pack import Contract
from conformance.documents.json_schema import kinds_of
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.representation import flat
from conformance.verdict.evidence import Case

# Phrases in a description which say that a response shows what was there before the request.
_EARLIER: Final = re.compile(r"\b(?:previous(?:ly)?|former(?:ly)?|old|before|prior)\b", re.IGNORECASE)
# Bodies with which a response must have shown another value; one may be chance.
_SEEN: Final = 2
# How many different numbers must be answered by the same one.
_NUMBERS: Final = 3
_READ: Final = "description/written-is-read"
# Writes that are remembered until a read shows what they did.
_MOST: Final = 200


class Answers:
    """Judges the response to each PUT, PATCH and creating POST by the next read of what was written."""

    def __init__(self, contract: Contract) -> None:
        operations = operations_of(contract) if contract.openapi_path else ()
        reads = [one for one in operations if one.method == "GET" and collection_of(one.template)]
        self._items = {collection_of(one.template): one for one in reads}
        self._collections = collections_of(operations)
        # The last write, until a read has shown what it did, by path.
        self._unread: dict[str, Occasion] = {}
        # Writes whose response shows another value than the next read, by operation and member.
        self._untrue: dict[tuple[str, str], set[bytes]] = defaultdict(set)
        self._late: set[tuple[str, str]] = set()  # members that the device changes after its response
        # Numbers that were sent, and those that the responses show, by operation and member.
        self._numbers: dict[tuple[str, str], tuple[set[float], set[float]]] = defaultdict(lambda: (set(), set()))

    def forget(self) -> None:
        """Forget all writes: something else may have changed what they wrote."""
        self._unread.clear()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, method, status = occasion.operation, occasion.request.method, occasion.response.status
        path = occasion.context.target.partition("?")[0].rstrip("/")
        if method == "GET" and operation is not None:
            write = self._unread.pop(path, None)
            if write is not None and write.response.received_s <= occasion.sent_s and occasion.response.ok:
                yield from self._judge(occasion, operation, write)
        elif method not in SAFE and not refuses(status, operation):
            at = self._written(occasion, operation, path) if operation is not None else ""
            if not at or len(self._unread) >= _MOST:
                self._unread.clear()
            self._unread |= {at: occasion} if at else {}
            if at and operation is not None and occasion.response.ok:
                yield from self._judge_numbers(occasion, operation)

    def _written(self, occasion: Occasion, operation: Operation, path: str) -> str:
        """Return the path of the thing that a request has written; empty if it wrote no JSON object to one."""
        body, kind = read_json(occasion.request.body).value, occasion.request.media_type
        if not (isinstance(body, dict) and body and kind in [*operation.bodies][:1] and occasion.is_valid):
            return ""
        item = self._items.get(operation.template.rstrip("/"))
        if operation.method != "POST" or item is None or not is_json(occasion.response.media_type):
            return path if operation.method in {"PUT", "PATCH"} else ""
        id_ = id_member(read_json(occasion.response.body).value, item)[1]
        return "" if id_ is None else f"{path}/{quote(str(id_), safe='')}"

    def _judge_numbers(self, occasion: Occasion, operation: Operation) -> Iterator[Case]:
        """Judge whether a number is shown as it was sent; a device may limit it or round it, and say so by that."""
        sent: dict[str, Any] = read_json(occasion.request.body).value
        told = occasion.members(sent)
        parts = parts_of(next(iter(operation.bodies.values())).schema)
        for name in (name for name in sent if name in parts and not is_devices(name, parts[name], self._collections)):
            if not (_is_number(sent[name]) and _is_number(told.get(name))):
                continue
            asked, shown = self._numbers[operation.label, name]
            asked.add(sent[name])
            shown.add(told[name])
            (only, *others), expected = shown, f"{sent[name]} as {name}, as it was sent"
            is_stuck = not others and min(asked) < only < max(asked) and len(asked) >= _NUMBERS
            if is_stuck or sent[name] == told[name]:
                found = f"{told[name]}, whatever was sent from {min(asked)} to {max(asked)}"
                cause = f"{operation.label} {name} stuck"
                doubt = "" if "integer" in kinds_of(parts[name]) else "it may be what the device measures"
                yield occasion.case(_READ, not is_stuck, expected, found, cause=cause, doubt=doubt)

    def _judge(self, occasion: Occasion, item: Operation, write: Occasion) -> Iterator[Case]:
        """Judge whether the response to a write shows what was sent, as the next read does."""
        operation, answer = write.operation, write.response
        if operation is None or not is_json(answer.media_type) or _EARLIER.search(operation.text):
            return
        own, shape = parts_of(operation.shape), parts_of(item.shape)
        sent: dict[str, Any] = read_json(write.request.body).value
        schema = operation.bodies[write.request.media_type].schema
        told, now = write.members(shape), occasion.members(shape)
        is_later = answer.status == HTTPStatus.ACCEPTED
        for name in own.keys() & shape.keys() & sent.keys() & told.keys() & now.keys():
            seen, key = {name: now[name]}, (operation.label, name)
            if flat(own[name]) != flat(shape[name]) or is_shared(name):
                continue
            if wrong := next(differences({name: sent[name]}, seen, schema, item.shape, self._collections), ""):
                self._late.add(key)
                # A thing that is created after the response is judged like one that is created before it.
                is_told = is_later and same(told[name], now[name])
                self._untrue[key] |= {write.request.body} if is_told else set()
                if is_told and len(self._untrue[key]) >= _SEEN:
                    expected = f"{clip(sent[name])} as {name}, as it was sent"
                    yield write.case(_READ, False, expected, wrong, cause=f"{operation.label} {name}")  # noqa: FBT003
            if key in self._late:
                continue
            other = next(differences(seen, told, schema, item.shape, self._collections), "")
            self._untrue[key] |= {write.request.body} if other else set()
            if not other or len(self._untrue[key]) >= _SEEN:
                expected = f"{clip(now[name])} as {name}, as it was sent and as the next GET shows it"
                cause = f"{operation.label} told"
                doubt = "the response may show the state before the request" if is_later else ""
                yield write.case(_READ, not other, expected, other, cause=cause, doubt=doubt)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
