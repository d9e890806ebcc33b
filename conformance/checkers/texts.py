"""Texts beyond ASCII: a read after the write returns them, and not their bytes in another encoding."""

import re
import unicodedata
from collections.abc import Iterator
from http import HTTPStatus
from typing import Any, Final, NamedTuple
from urllib.parse import urlsplit

from conformance.api.rest.listing import items_of
from conformance.api.rest.things import parts_of
from conformance.checkers.occasion import Occasion
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import is_json
from conformance.documents.representation import flat
from conformance.transport.exchange import SAFE_METHODS, Request
from conformance.transport.reach import joined
from conformance.verdict.evidence import Case

# URLs that are remembered.
_MOST: Final = 1000
# Shorter texts are compared with later reads only.
_LONG: Final = 100
# The replacement for a character that could not be decoded (Unicode 5.22).
_LOST: Final = "\ufffd"
_SPACE, _SEPARATOR = re.compile(r"\s+"), re.compile(r"[\W_]+")


class _Write(NamedTuple):
    """A write whose texts a read must show: its label and request, its non-ASCII texts, the state and earlier texts.

    A thing without a place of its own has its ``id`` in the list in which it was created.
    """

    label: str
    request: Request
    texts: dict[str, str]
    before: dict[str, Any]
    earlier: frozenset[str]
    id: Any = None


class Texts:
    """Judges the first read after a write. A read with the old text is not judged, because a device may store later."""

    def __init__(self) -> None:
        self._shown: dict[str, dict[str, Any]] = {}
        self._written: dict[str, _Write] = {}
        # Texts that earlier writes gave, which a device that stores later may still show, by URL.
        self._earlier: dict[str, frozenset[str]] = {}

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        request, answer = occasion.request, occasion.response
        url = request.url
        if request.raw is not None or not answer.ok:
            return
        if request.method == "GET" and answer.status == HTTPStatus.OK:
            value = _members(answer.body, answer.media_type)
            write = self._written.pop(url, None)
            if write is not None and write.id is not None:
                items = items_of(read_json(answer.body).value) or [] if is_json(answer.media_type) else []
                value = next((item for item in items if isinstance(item, dict) and item.get("id") == write.id), {})
            if write is not None and len(self._shown) < _MOST:
                yield from self._read(occasion, write, value)
            self._shown[url] = value
        elif request.method not in SAFE_METHODS:
            sent = _members(request.body, request.media_type)
            texts = {name: one for name, one in sent.items() if isinstance(one, str) and not one.isascii()}
            at, id_ = url, None
            if request.method == "POST" and answer.status == HTTPStatus.CREATED:
                location, made = answer.header("location"), _members(answer.body, answer.media_type)
                id_ = None if location else made.get("id")
                at = joined(url, location) if location else url if id_ is not None else ""
            elif request.method == "POST":
                at = ""
            self._written.clear()
            if texts and at and answer.status != HTTPStatus.ACCEPTED:
                before = self._shown.get(at, {}) if id_ is None else {}
                label = occasion.operation.label if occasion.operation else ""
                self._written[at] = _Write(label, request, texts, before, self._earlier.get(at, frozenset()), id_)
            if at and len(self._earlier) < _MOST:
                given = [one for one in sent.values() if isinstance(one, str)][:_MOST]
                self._earlier[at] = frozenset(given) | self._earlier.get(at, frozenset())

    def _read(self, occasion: Occasion, write: _Write, value: dict[str, Any]) -> Iterator[Case]:
        for name, text in write.texts.items():
            seen = value.get(name)
            if not isinstance(seen, str) or seen == write.before.get(name) or seen in write.earlier:
                continue
            expected = f"{name} {clip(text)}, as {write.request.method} {urlsplit(write.request.url).path} wrote it"
            # A device may add something to a text, or make a slug of it; a list may show only its beginning.
            slug = _SEPARATOR.sub("-", _ascii(text)).strip("-")
            same = _plain(text) in _plain(seen) or _plain(seen).replace("_", "-") in {_ascii(text), slug}
            same |= write.id is not None and _plain(text).startswith(_plain(seen.rstrip(". \u2026")))
            cause = f"{write.label} {name} value"  # as in writes.py, which judges the same value
            # Servers that cannot store a character beyond the BMP cut the text there.
            is_begin = seen and text.startswith(seen) and text[len(seen) :].strip()[:1] < "\U00010000"
            doubt, found = "it may keep only the beginning of a text" if is_begin else "", f"{name} {clip(seen)}"
            yield occasion.case("description/written-is-read", same, expected, found, cause=cause, doubt=doubt)


def whole(occasion: Occasion) -> Iterator[Case]:
    """Judge whether the response to a write shows texts with all their characters, if its schema allows the length."""
    answer, operation = occasion.response, occasion.operation
    is_told = answer.status in {HTTPStatus.OK, HTTPStatus.CREATED} and is_json(answer.media_type)
    if operation is None or occasion.request.method in SAFE_METHODS or not is_told or not occasion.is_valid:
        return
    sent, parts = _members(occasion.request.body, occasion.request.media_type), parts_of(operation.shape)
    told = occasion.members(sent)
    for name, value in sent.items():
        now, most = told.get(name), flat(parts.get(name) or {}).get("maxLength", 0)
        if isinstance(value, str) and isinstance(now, str):
            is_cut = _LONG < len(value) <= most and len(now) < len(value) and value.startswith(now.rstrip(".… "))
            is_lost = _LOST in now and _LOST not in value
            expected, found = f"{len(value)} characters as {name}, as sent", f"the first {len(now)} of them" * is_cut
            found = found or "U+FFFD in place of some of them" * is_lost
            cause = f"{operation.label} {name} characters"
            yield occasion.case("description/written-is-read", not found, expected, found, cause=cause)


def _members(body: bytes, media_type: str) -> dict[str, Any]:
    value = read_json(body).value if body and is_json(media_type) else None
    return dict(_within(value)) if isinstance(value, dict) else {}


def _within(value: dict[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the members of an object and of the objects in it, by their paths."""
    for name, one in value.items():
        yield f"{above}{name}", one
        if isinstance(one, dict):
            yield from _within(one, f"{above}{name}.")


def _plain(text: str) -> str:
    """Return a text for comparison: in one normal form, without case and white space."""
    return _SPACE.sub(" ", unicodedata.normalize("NFKC", text)).strip().casefold()


def _ascii(text: str) -> str:
    """Return a text as a device keeps it that accepts only ASCII letters."""
    return _plain(unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode())
