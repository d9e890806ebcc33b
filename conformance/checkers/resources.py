"""Compare the methods of one resource: HEAD with GET, and 405 for undeclared methods."""

import hashlib
from collections.abc import Iterator
from http import HTTPStatus
from typing import Final, NamedTuple

from conformance.api.rest.statuses import CRASHES
from conformance.checkers.occasion import METHODS, Occasion
from conformance.documents.json_shape import shape_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Resource, is_json, resource_at, resources_of
from conformance.transport.exchange import SAFE_METHODS
from conformance.verdict.evidence import Case

# Statuses that do not show whether a resource exists; CRASHES are findings of their own.
_NOT_NOW: Final = frozenset({401, 403, 429, 503}) | CRASHES
_NO_HEAD: Final = frozenset({404, 405, 501})  # statuses of a device that does not support HEAD
_NO_RESOURCE: Final = frozenset({400, 404, 410, 422})  # statuses for a resource that does not exist
_GONE: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.GONE})
# URLs that are remembered.
_MOST: Final = 4000


class _Shown(NamedTuple):
    """The parts of a response to GET that HEAD must repeat."""

    status: int
    tag: str
    media_type: str
    length: int
    content: bytes


class Resources:
    """Judges the methods of a resource by each other; the run's responses show which resources exist."""

    def __init__(self) -> None:
        self._got: dict[object, _Shown] = {}
        self._heads: dict[object, Occasion] = {}
        self._varies: set[str] = set()
        # Cases on HEAD that count once the device has shown that it supports HEAD.
        self._without_head: list[Case] = []
        self._has_head = self._tags_heads = False  # whether it does, also with entity tags
        # Paths of things that exist.
        self._there: set[str] = set()
        self._suspects: list[tuple[str, Occasion]] = []  # requests to them that were answered as if they did not
        # Whether the device refuses methods: OPTIONS, all others.
        self._refuses: set[bool] = set()
        self._waiting: dict[bool, list[Case]] = {True: [], False: []}  # cases that count if it does

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange, and of earlier ones that it decides."""
        if occasion.request.raw is not None:
            return
        method, status = occasion.request.method, occasion.response.status
        if method not in SAFE_METHODS and not HTTPStatus.BAD_REQUEST <= status < HTTPStatus.INTERNAL_SERVER_ERROR:
            self._got.clear()
            self._heads.clear()
        elif occasion.operation is not None and method in {"GET", "HEAD"}:
            yield from self._head(occasion)
        yield from self._method(occasion)

    def _head(self, occasion: Occasion) -> Iterator[Case]:
        """Judge a HEAD that stands between two equal responses to the same GET."""
        answer, fields = occasion.response, occasion.request.headers
        if any(name.lower().startswith(("if-", "range")) for name, _ in fields) or answer.content.coding:
            return
        key = occasion.request.url, fields
        if occasion.context.is_head:
            self._has_head |= answer.ok
            self._tags_heads |= answer.header("etag") is not None
            if key in self._got:
                self._heads[key] = occasion
            if self._has_head:
                yield from self._without_head
                self._without_head.clear()
            return
        content = hashlib.sha256(answer.body).digest()
        shown = _Shown(answer.status, _opaque(answer.header("etag")), answer.media_type, len(answer.body), content)
        head, before = self._heads.pop(key, None), self._got.get(key)
        if before is not None and before != shown:
            self._varies.add(occasion.request.url)
        if len(self._got) < _MOST:
            self._got[key] = shown
        if head is not None and before == shown and (answer.ok or answer.status in _GONE):
            yield from self._like_get(head, shown)

    def _like_get(self, head: Occasion, shown: _Shown) -> Iterator[Case]:
        id_, answer = "description/head", head.response
        label = head.operation.label if head.operation else ""
        if answer.status in _NOT_NOW:
            return
        same = answer.status == shown.status
        expected, found = f"status {shown.status} for HEAD, as for GET", f"status {answer.status}"
        case = head.case(id_, same, expected, found, cause=f"{label} status {shown.status in _GONE}")
        if not same:
            if self._has_head or answer.status not in _NO_HEAD:
                yield case
            else:
                self._without_head.append(case)
        if not same or shown.status in _GONE:
            return
        # A resource that changes by itself may have changed between two equal responses.
        is_steady = head.request.url not in self._varies
        tag = _opaque(answer.header("etag"))
        if is_steady and (tag or self._tags_heads):
            found = f"ETag: {answer.header('etag')}" if tag else "no ETag"
            yield head.case(id_, tag == shown.tag, f"ETag: {shown.tag}, as GET gets it", found, cause=f"{label} tag")
        if answer.media_type:
            expected = f"Content-Type: {shown.media_type}, as GET gets it"
            found = f"Content-Type: {answer.media_type}"
            yield head.case(id_, answer.media_type == shown.media_type, expected, found, cause=f"{label} type")
        length = answer.header("content-length")
        if length is not None and is_steady:
            expected = f"Content-Length: {shown.length}, as GET gets it, or no Content-Length"
            found = f"Content-Length: {length}"
            yield head.case("http/head-length", length == str(shown.length), expected, found, cause=f"{label} length")

    def _method(self, occasion: Occasion) -> Iterator[Case]:
        """Judge a method that the description does not declare for an existing path."""
        path = occasion.context.target.split("?", 1)[0]
        method = occasion.request.method
        status = occasion.response.status
        if occasion.operation is not None:
            yield from self._take_declared(occasion, path)
            return
        resource = resource_at(occasion.contract, path)
        if resource is None:
            return
        if not occasion.context.usual or method not in METHODS or _elsewhere(occasion, resource, path):
            return
        is_options = method == "OPTIONS"
        if status == HTTPStatus.METHOD_NOT_ALLOWED or (is_options and occasion.response.ok):
            yield _case(occasion, holds=True)
            yield from _declared_refusal(occasion, resource)
            self._refuses.add(is_options)
            yield from self._waiting[is_options]
            self._waiting[is_options].clear()
        elif status in _NO_RESOURCE and not self._there.isdisjoint(_places(path, resource)):
            self._suspects.append((path, occasion))

    def _take_declared(self, occasion: Occasion, path: str) -> Iterator[Case]:
        """Record whether a response shows that a path exists, and judge the cases that waited for that."""
        status = occasion.response.status
        if status in _GONE or (occasion.request.method == "DELETE" and occasion.response.ok):
            gone = [text for text in self._there if text == path or text.startswith(f"{path.rstrip('/')}/")]
            self._there.difference_update(gone)
            self._suspects = [pair for pair in self._suspects if not f"{pair[0]}/".startswith(f"{path.rstrip('/')}/")]
            return
        if not occasion.response.ok and status != HTTPStatus.CONFLICT:
            return
        if len(self._there) < _MOST:
            self._there.add(path)
        left = []
        for place, suspect in self._suspects:
            resource = resource_at(suspect.contract, place)
            if resource is None or path not in _places(place, resource):
                left.append((place, suspect))
                continue
            is_options, case = suspect.request.method == "OPTIONS", _case(suspect, holds=False)
            if is_options in self._refuses:
                yield case
            else:
                self._waiting[is_options].append(case)
        self._suspects = left


def _case(occasion: Occasion, *, holds: bool) -> Case:
    method, status = occasion.request.method, occasion.response.status
    expected = f"status 405 for {method}, because the thing is there, and other paths are answered so"
    if method == "OPTIONS":
        expected = "status 200 or 204 for OPTIONS, because the thing is there, and other paths are answered so"
    resource = resource_at(occasion.contract, occasion.context.target.split("?", 1)[0])
    cause = f"{resource.template if resource else ''} {method == 'OPTIONS'} {status}"
    return occasion.case("description/method-refused", holds, expected, f"status {status}", cause=cause)


def _declared_refusal(occasion: Occasion, resource: Resource) -> Iterator[Case]:
    """Judge the JSON of a 405 by the schemas that the path's operations declare for the status 405."""
    answer = occasion.response
    declared = [item.responses.get("405", {}).get(answer.media_type) for item in resource.operations.values()]
    schemas = [one for one in declared if one]
    if (
        answer.status != HTTPStatus.METHOD_NOT_ALLOWED
        or not schemas
        or not answer.body
        or not is_json(answer.media_type)
    ):
        return
    try:
        problems = [shape_of(schema).problem(read_json(answer.body).value) for schema in schemas]
    except ValueError:
        return  # another requirement says that the schema cannot be used
    fault = "" if "" in problems else f"a body in which {problems[0]}"
    expected = "JSON that is valid by the schema that the path declares for 405"
    yield occasion.case("description/method-refused", not fault, expected, fault, cause=f"{resource.template} body")


def _places(path: str, resource: Resource) -> set[str]:
    """Return the paths that show that a path exists: the path itself, and its thing's path if it ends in a name."""
    above, _, last = resource.template.rstrip("/").rpartition("/")
    return {path} if "{" in last or "{" not in above else {path, path.rstrip("/").rpartition("/")[0]}


def _elsewhere(occasion: Occasion, resource: Resource, path: str) -> bool:
    """Return whether a router may find the method at another template that the path fits as well."""
    return any(
        occasion.request.method in one.methods and one.pattern.fullmatch(path)
        for one in resources_of(occasion.contract)
        if one is not resource
    )


def _opaque(tag: str | None) -> str:
    return (tag or "").removeprefix("W/")
