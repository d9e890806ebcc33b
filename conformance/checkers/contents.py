"""Contents as bytes: a range is part of the whole, a digest fits the content, a file reads as it was uploaded.

RFC 9110 14, RFC 9530. What differs counts only between two equal readings of the whole.
"""

from __future__ import annotations

import hashlib
import re
from base64 import b64decode
from collections.abc import Iterator
from http import HTTPStatus
from typing import Final, NamedTuple

from conformance.api.rest.statuses import refuses
from conformance.checkers.entity_tags import Fields, fields_of, label_of
from conformance.checkers.occasion import SETTLES_S, Occasion
from conformance.documents.files import MEDIA, keeps_octets
from conformance.documents.json_text import read_json
from conformance.documents.openapi import SAFE, is_json
from conformance.documents.parameters import plain_name
from conformance.transport.reach import joined
from conformance.verdict.evidence import Case

_PART: Final = re.compile(r"bytes (\d+)-(\d+)/(\d+|\*)", re.IGNORECASE)
# Digests as structured fields (RFC 9530 2, 3), and in the older `Digest` header (RFC 3230 4.3.2).
_DIGEST: Final = re.compile(r"(sha-256|sha-512)\s*=\s*:?([A-Za-z0-9+/]+=*):?(?=\s*(?:,|;|$))", re.IGNORECASE)
_HASHES: Final = {"sha-256": hashlib.sha256, "sha-512": hashlib.sha512}
# Normalised names of members that contain the digest of a file.
_MEMBERS: Final = {"sha256": hashlib.sha256, "sha512": hashlib.sha512}
_OCTETS, _TEXT = "application/octet-stream", "text/plain"
_MOST = 200  # contents that are remembered
_LARGEST = 1 << 20  # longest content that is remembered, bytes
_START = 4  # first bytes of a file, which show its media type
_WITHIN = slice(60, 76)  # bytes of an image behind its header: pixels
_RANGE = "http/range"
_DIGESTS = "description/digest"
_READ = "description/written-is-read"
_TAGS = "description/entity-tag"
_ASKED: Final = re.compile(r"bytes=(\d*)-(\d*)")
# Phrases in a description which say that a text is stored byte for byte; otherwise line ends may change.
_KEEPS: Final = re.compile(
    r"\b(?:octets?|bytes?)\b[^.]*\b(?:stored|sent|uploaded|received|written)\b|\bverbatim\b|\bbyte[ -](?:for|by)[ -]",
    re.IGNORECASE,
)


class _Key(NamedTuple):
    """Identifies one representation: its URL, and the header fields that select it."""

    url: str
    fields: Fields


class Contents:
    """Judges parts, digests and files."""

    def __init__(self) -> None:
        self._whole: dict[_Key, bytes] = {}
        # Partial responses that wait for the next read of the whole resource.
        self._parts: dict[_Key, list[Occasion]] = {}
        # Files as clients uploaded them, until another request changes something.
        self._sent: dict[str, Occasion] = {}
        # Hashes of the contents that were uploaded or read, by file.
        self._known: dict[str, set[int]] = {}
        self._differs: dict[str, set[bytes]] = {}  # files that were once read with other contents

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange, and of earlier ones that it decides."""
        request, answer = occasion.request, occasion.response
        if request.raw is not None or answer.cut or answer.header("content-encoding") is not None:
            return
        if request.method != "HEAD":
            yield from _digests(occasion)
        if request.method not in SAFE:
            yield from self._keep_write(occasion)
        elif request.method == "GET":
            yield from self._read(occasion)

    def _keep_write(self, occasion: Occasion) -> Iterator[Case]:
        request, answer = occasion.request, occasion.response
        if refuses(answer.status, occasion.operation):
            return
        self._whole.clear()
        self._parts.clear()
        is_file = keeps_octets(request.media_type) or request.media_type == _TEXT
        is_file = is_file and 0 < len(request.body) <= _LARGEST
        is_new = request.method == "POST" and answer.status == HTTPStatus.CREATED
        at = request.url if request.method == "PUT" else joined(request.url, answer.header("location") or "")
        # A file that is uploaded elsewhere does not change those before.
        if not (is_file and (request.method == "PUT" or is_new)) or len(self._sent) >= _MOST:
            self._sent.clear()
        if is_file and answer.ok and answer.status != HTTPStatus.ACCEPTED:
            if at != request.url or request.method == "PUT":
                self._sent[at] = occasion
            yield from _member(occasion)

    def _read(self, occasion: Occasion) -> Iterator[Case]:
        request, answer = occasion.request, occasion.response
        key = _Key(request.url, fields_of(occasion))
        names = {name.lower() for name, _ in request.headers}
        if answer.status == HTTPStatus.PARTIAL_CONTENT and "range" in names:
            if "if-range" in names:
                value = next(value for name, value in request.headers if name.lower() == "if-range")
                yield from self._judge_if_range(occasion, value)
            if len(self._parts) < _MOST:
                self._parts.setdefault(key, []).append(occasion)
        if answer.status != HTTPStatus.OK or "range" in names:
            return
        before, parts = self._whole.get(key), self._parts.pop(key, [])
        if before == answer.body:
            for part in parts:
                yield from _part(part, before)
        if len(self._whole) < _MOST and len(answer.body) <= _LARGEST:
            self._whole[key] = answer.body
        sent = self._sent.pop(request.url, None)
        is_earlier = sent is not None and hash(answer.body) in self._known.get(request.url, ())
        if is_earlier or answer.media_type == (sent.request.media_type if sent is not None else _OCTETS):
            yield from self._file(occasion, sent)
        elif sent is not None and sent.request.body == answer.body:
            yield from _judge_label(occasion, sent)

    def _file(self, occasion: Occasion, sent: Occasion | None) -> Iterator[Case]:
        """Judge a read by the file that was sent just before; the file before that may stay for a moment."""
        body, known = occasion.response.body, self._known.setdefault(occasion.request.url, set())
        if sent is not None:
            octets, label = sent.request.body, label_of(occasion.operation)
            is_kept = octets == body or _may_be(body, occasion, sent)
            is_old = not is_kept and hash(body) in known
            is_new = sent.request.method == "POST"
            differs = self._differs.setdefault(label if is_new else occasion.request.url.partition("?")[0], set())
            differs |= set() if is_kept else {octets}
            if is_old and occasion.sent_s - sent.response.received_s < SETTLES_S:
                self._sent[occasion.request.url] = sent
            # A single difference may come from another client's upload.
            elif is_kept or len(differs) > 1:
                expected = f"the {len(octets)} octets that {label_of(sent.operation)} has sent"
                found, cause = f"{len(body)} octets, which differ", f"{label} octets"
                yield occasion.case(_READ, is_kept, expected, found, cause=cause)
        known |= {hash(body)} | ({hash(sent.request.body)} if sent is not None else set())
        if len(self._known) > _MOST:
            del self._known[next(iter(self._known))]

    @staticmethod
    def _judge_if_range(occasion: Occasion, value: str) -> Iterator[Case]:
        """Judge a part for a client whose If-Range names another content (RFC 9110 13.1.5)."""
        tag = occasion.response.header("etag") or ""
        # A weak entity tag is not valid in If-Range.
        if value.startswith('"') and tag.startswith(('"', "W/")) and value != tag:
            expected = f"status 200 with the whole, because If-Range does not have {tag}"
            yield occasion.case(_TAGS, False, expected, cause=f"{label_of(occasion.operation)} If-Range")  # noqa: FBT003


def _judge_label(occasion: Occasion, sent: Occasion) -> Iterator[Case]:
    """Judge a file that is read as it was sent, but under another of the media types that both operations have."""
    kind, other = sent.request.media_type, occasion.response.media_type
    if occasion.operation is None or sent.operation is None or not keeps_octets(other):
        return
    if {kind, other} <= set(occasion.operation.formats) & sent.operation.bodies.keys():
        expected = f"Content-Type: {kind}, as {label_of(sent.operation)} has sent these octets"
        found, cause = f"Content-Type: {other}", f"{label_of(occasion.operation)} media type"
        yield occasion.case(_READ, False, expected, found, cause=cause)  # noqa: FBT003


def _may_be(body: bytes, read: Occasion, sent: Occasion) -> bool:
    """Return whether a device may make this content of a file, because no description says that it keeps each octet.

    It may end the lines of a text as it likes, and write an image, a sound or a film anew (RFC 9110 9.3.4): that begins
    as such files do, is not only the first part of what was sent, and has nothing of its pixels and samples as they
    were.
    """
    if any(_KEEPS.search(occasion.operation.text) for occasion in (read, sent) if occasion.operation is not None):
        return False
    octets, kind = sent.request.body, sent.request.media_type
    if kind == _TEXT:
        return octets.split() == body.split()
    is_of_kind = body.startswith(octets[:_START]) and not octets.startswith(body)
    return kind.partition("/")[0] in MEDIA and is_of_kind and octets[_WITHIN] not in body


def _part(occasion: Occasion, whole: bytes) -> Iterator[Case]:
    """Judge one part by the whole that was read before and after it."""
    answer = occasion.response
    found = _PART.fullmatch((answer.header("content-range") or "").strip())
    if found is None or answer.media_type == "multipart/byteranges":
        return
    first, last = int(found[1]), int(found[2])
    wrong = ""
    if found[3] not in {"*", str(len(whole))}:
        wrong = f"Content-Range: {found[0]}, and the whole has {len(whole)} octets"
    elif answer.body != whole[first : last + 1]:
        wrong = f"{len(answer.body)} octets that are not those of Content-Range: {found[0]}"
    asked = [value.strip() for name, value in occasion.request.headers if name.lower() == "range"]
    if len(asked) == 1 and (bounds := _ASKED.fullmatch(asked[0])) and any(bounds.groups()):
        # The server may send a part of the requested range, or more, but nothing entirely outside of it.
        length = int(bounds[2] or 0)
        start, end = (int(bounds[1]), length if bounds[2] else last) if bounds[1] else (len(whole) - length, len(whole))
        if not wrong and (last < start or first > end):
            wrong = f"Content-Range: {found[0]}, which has nothing of Range: {asked[0]}"
    expected = f"octets {first} to {last} of the {len(whole)}, as a GET of the whole before and after shows them"
    yield occasion.case(_RANGE, not wrong, expected, wrong, cause=f"{label_of(occasion.operation)} octets")


def _digests(occasion: Occasion) -> Iterator[Case]:
    """Judge the digests of a content, and those of the whole representation."""
    answer = occasion.response
    is_whole = occasion.request.method == "GET" and answer.status == HTTPStatus.OK
    for name in ("Content-Digest", "Repr-Digest", "Digest") if is_whole else ("Content-Digest",):
        for algorithm, text in _DIGEST.findall(answer.header(name) or ""):
            said, own = _decode(text), _HASHES[algorithm.lower()](answer.octets).digest()
            expected = f"the digest of the content in {name}"
            found, cause = f"{algorithm} of something else", f"{label_of(occasion.operation)} {name}"
            yield occasion.case(_DIGESTS, said == own, expected, found, cause=cause)


def _member(occasion: Occasion) -> Iterator[Case]:
    """Judge a member with the file's digest in the response to an upload."""
    answer = occasion.response
    value = read_json(answer.body).value if is_json(answer.media_type) else None
    for name, text in value.items() if isinstance(value, dict) else ():
        make = _MEMBERS.get(plain_name(name))
        if make is not None and isinstance(text, str) and re.fullmatch(r"[0-9a-fA-F]+", text):
            own = make(occasion.request.body).hexdigest()
            if len(own) == len(text):
                expected, cause = f"{own} as {name}, the digest of what was sent", label_of(occasion.operation)
                yield occasion.case(
                    _DIGESTS, own == text.lower(), expected, f"{text} as {name}", cause=f"{cause} {name}"
                )


def _decode(text: str) -> bytes | None:
    try:
        return b64decode(text, validate=True)
    except ValueError:
        return None
