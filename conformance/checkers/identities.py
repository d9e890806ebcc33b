"""Identity of things in a collection: each path returns its own thing (RFC 9110 9.3.1), and unique members differ."""

from __future__ import annotations

import json
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final
from urllib.parse import parse_qsl, unquote, urlsplit

from conformance.api.rest.listing import items_of
from conformance.api.rest.statuses import refuses
from conformance.api.rest.things import collection_of, identifier_of, may_create
from conformance.checkers.occasion import Occasion
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import SAFE, Operation, is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.transport.reach import joined
from conformance.verdict.evidence import Case

# Normalised names of members that identify one thing.
_IDS: Final = frozenset({"id", "uuid", "guid"})
# Identifiers of a run that are remembered.
_REMEMBERED: Final = 50_000
# Statuses that refuse a creation because a value is in use.
_TAKEN: Final = frozenset({HTTPStatus.BAD_REQUEST, HTTPStatus.CONFLICT, HTTPStatus.UNPROCESSABLE_ENTITY})
_FEW: Final = 8  # bodies that are kept for each path
# Phrases in the description of a 409, before and after the name of a member that must be unique among all things.
_SAME: Final = r"\b(?:duplicate|same|existing|taken|(?:with|has) (?:this|that|such an?|its))"
_HAS: Final = r"\b(?:taken|occupied|in use|(?:already )?exists?|already used|not unique|must be unique)\b"
# How often a value is taken again before that counts; once, the earlier thing may have ended by itself.
_TWICE: Final = 2
_OCTETS: Final = 16_384  # longest body that is kept, bytes


class Identities:
    """Judges each GET of an item by the identifiers that the run has seen.

    An item may have other names, and a path may have a name of its own such as ``current``. So only a path counts that
    has led to its own item before; or one whose identifier the list has, if it leads to another item of the list.
    """

    def __init__(self) -> None:
        # Identifiers in its list, by collection.
        self._listed: dict[str, set[str]] = defaultdict(set)
        self._own: dict[str, set[str]] = defaultdict(set)  # identifiers under which their own item was read
        # Values that a response has shown as they were asked for, by operation and parameter.
        self._shown: dict[tuple[str, str], set[str]] = defaultdict(set)
        self._items: dict[str, Operation] | None = None
        self._count = 0

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, answer = occasion.operation, occasion.response
        method = occasion.request.method
        if self._items is None:
            found = [one for one in operations_of(occasion.contract) if one.method == "GET"]
            self._items = {collection_of(one.template): one for one in found if collection_of(one.template)}
        if operation is None or not answer.ok or method in SAFE - {"GET"}:
            return
        path = occasion.context.target.partition("?")[0].rstrip("/")
        above, _, last = path.rpartition("/")
        id_ = unquote(last).casefold()
        if method != "GET":
            # The thing may have been renamed.
            self._own[above].discard(id_)
        if method != "GET" or answer.cut or not is_json(answer.media_type):
            return
        yield from self._parameters(occasion, operation)
        item = self._items.get(operation.template.rstrip("/"))
        if item is not None:
            items = items_of(read_json(answer.body).value) or []
            ids = {identifier_of(one, item) for one in items if isinstance(one, dict)} - {""}
            self._count += len(ids)
            if self._count < _REMEMBERED:
                self._listed[path] |= ids
        if collection_of(operation.template):
            yield from self._item(occasion, operation, above, id_)
            yield from self._located(occasion, operation, above, id_)

    def _parameters(self, occasion: Occasion, operation: Operation) -> Iterator[Case]:
        """Judge whether a response shows the parameters that were asked for, if it has shown both values before."""
        pairs, value = dict(parse_qsl(urlsplit(occasion.request.url).query)), read_json(occasion.response.body).value
        names = [one.name for one in operation.parameter("query") if one.required and one.name in pairs]
        for name in names if isinstance(value, dict) else ():
            sent, told, shown = pairs[name], str(value.get(name)), self._shown[operation.label, name]
            if sent == told and len(shown) < _REMEMBERED:
                shown.add(sent)
            if {sent, told} <= shown:
                expected, cause = f"{name} {sent}, which was asked for", f"{operation.label} {name}"
                yield occasion.case("description/own-identifier", sent == told, expected, f"{name} {told}", cause=cause)

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

    def _located(self, occasion: Occasion, operation: Operation, above: str, id_: str) -> Iterator[Case]:
        """Judge whether Content-Location names no other item; it may name a format of this one (RFC 9110 8.7)."""
        url, value = occasion.request.url, occasion.response.header("content-location") or ""
        near, _, last = urlsplit(joined(url, value)).path.rstrip("/").rpartition("/")
        other, known = unquote(last).casefold(), {id_} | self._own[above] | self._listed[above]
        is_item = identifier_of(read_json(occasion.response.body).value, operation) == id_
        if value and f"{near}/".endswith(f"{above}/") and is_item and other in known:
            expected, cause = f"Content-Location of the item {id_}, if any", f"{operation.label} Content-Location"
            found = f"Content-Location: {value}"
            doubt = "the name may lead to the same item"
            yield occasion.case("description/own-identifier", other == id_, expected, found, cause=cause, doubt=doubt)


class Uniques:
    """Judges whether two things have the same value of a member that has to be new in each creation.

    That a member has to be new shows from a creation that was refused, and accepted with another value of it alone.
    """

    def __init__(self) -> None:
        # Values of created things, by collection.
        self._made: dict[str, set[tuple[str, str]]] = defaultdict(set)
        self._refused: dict[str, list[dict[str, Any]]] = defaultdict(list)  # refused bodies
        self._unique: dict[str, set[str]] = defaultdict(set)  # members whose values are unique
        # Members that had the same value in two created things, by collection.
        self._shared: dict[str, set[str]] = defaultdict(set)
        # The last bodies of created things, by collection.
        self._bodies: dict[str, list[dict[str, Any]]] = defaultdict(list)
        # Unique texts of existing things, by collection.
        self._held: dict[str, set[str]] = defaultdict(set)
        self._again = Counter[str]()  # how often another thing got such a text
        # Members as they were read since the last change, by collection and identifier.
        self._read: dict[str, dict[str, dict[str, Any]]] = defaultdict(dict)

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        operation, answer, method = occasion.operation, occasion.response, occasion.request.method
        if operation is None or occasion.request.raw is not None:
            return
        if method in {"PUT", "PATCH", "DELETE"} and answer.ok:
            # The refused creations may have been refused because the device was full.
            self._refused.clear()
        path = occasion.context.target.partition("?")[0].rstrip("/")
        above, _, last = path.rpartition("/")
        if method == "POST" and is_json(occasion.request.media_type):
            self._keep_created(occasion, path)
            yield from self._judge_taken(occasion, operation, path)
        elif method not in SAFE and not refuses(answer.status, operation):
            self._held.clear()
        if method == "POST":
            return
        if method in {"PUT", "PATCH", "DELETE"} and answer.ok:
            self._read[above].clear()
        elif method == "GET" and answer.ok and is_json(answer.media_type) and self._bodies.get(path):
            yield from self._judge_list(occasion, operation, self._bodies[path])
        elif method == "GET" and answer.ok and self._unique[above] and occasion.context.plain:
            now = {name: one for name, one in occasion.members(self._unique[above]).items() if _is_plain(one)}
            yield from self._judge_read(occasion, operation, above, last, now)
            self._read[above][last] = now

    def _keep_created(self, occasion: Occasion, path: str) -> None:
        body = read_json(occasion.request.body).value if len(occasion.request.body) < _OCTETS else None
        if not isinstance(body, dict):
            return
        refused, made = self._refused[path], self._made[path]
        if occasion.response.status == HTTPStatus.CREATED:
            self._bodies[path] = [*self._bodies[path], body][-_FEW:]
            for one in refused:
                other = [name for name in {*body, *one} if body.get(name) != one.get(name)]
                is_taken = len(other) == 1 and (other[0], str(one.get(other[0]))) in made
                if is_taken and other[0] not in self._shared[path]:
                    self._unique[path].add(plain_name(other[0]))
            self._shared[path] |= {name for name, one in body.items() if (name, str(one)) in made}
            made |= {(name, str(one)) for name, one in body.items() if _is_plain(one) and len(made) < _REMEMBERED}
        elif occasion.response.status in _TAKEN and occasion.is_valid:
            self._refused[path] = [*refused, body][-_FEW:]

    def _judge_taken(self, occasion: Occasion, operation: Operation, path: str) -> Iterator[Case]:
        """Judge whether a creation is refused by 409, if its members are taken by which the description says so."""
        body, status = read_json(occasion.request.body).value, occasion.response.status
        names = [name for name in body if _is_said(name, operation.conflict)] if isinstance(body, dict) else []
        is_made = occasion.response.ok and (status == HTTPStatus.CREATED or may_create(operation, status))
        if not (is_made and operation.conflict):
            self._held.clear() if not refuses(status, operation) else None
            return
        key, held = json.dumps({name: body[name] for name in names}, sort_keys=True), self._held[path]
        if names and occasion.is_valid and len(held) < _REMEMBERED:
            self._again[operation.label] += key in held
            if key not in held or self._again[operation.label] >= _TWICE:
                expected = f"a refusal with 409, as there is one with {clip(key)} ({operation.conflict})"
                cause = f"{operation.label} taken"
                yield occasion.case("description/states", key not in held, expected, f"status {status}", cause=cause)
            held.add(key)

    @staticmethod
    def _judge_list(occasion: Occasion, operation: Operation, bodies: list[dict[str, Any]]) -> Iterator[Case]:
        """Judge whether two created things that a list contains have different identifiers."""
        own = dict[str, dict[str, Any]]()
        for item in items_of(read_json(occasion.response.body).value) or []:
            names = [name for name in item if plain_name(name) in _IDS] if isinstance(item, dict) else []
            body = next((one for one in bodies if names and one and one.items() <= item.items()), None)
            if body is None or names[0] in body:
                continue
            id_ = clip(item[names[0]])
            holds, expected = own.setdefault(id_, body) == body, f"another {names[0]} for each created thing"
            found, cause = f"{names[0]} {id_} of two things that were created", f"{operation.label} two"
            yield occasion.case("description/created-is-there", holds, expected, found, cause=cause)

    def _judge_read(
        self, occasion: Occasion, operation: Operation, above: str, last: str, now: dict[str, Any]
    ) -> Iterator[Case]:
        for name, value in now.items():
            if plain_name(name) in self._unique[above]:
                twice = next(
                    (key for key, one in self._read[above].items() if key != last and one.get(name) == value), ""
                )
                expected = f"another {name} than {above}/{twice} has, because creations with a taken one are refused"
                found, cause = f"{name} {clip(value)}, as {above}/{twice} has", f"{operation.label} {name} twice"
                doubt = "those creations may have been refused for another reason"
                yield occasion.case("description/own-identifier", not twice, expected, found, cause=cause, doubt=doubt)


def _is_said(name: str, text: str) -> bool:
    """Return whether the description of a 409 says that another thing has this member's value already."""
    word = rf"\b{re.escape(name)}\b"
    return bool(re.search(rf"{_SAME} {word}|{word}[^.;,]*{_HAS}", text, re.IGNORECASE))


def _is_plain(value: Any) -> bool:
    return isinstance(value, str | int) and not isinstance(value, bool) and value != ""
