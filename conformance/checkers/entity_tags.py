"""Entity tags, conditions and ranges: one tag names one content, and 304 and 206 need a condition (RFC 9110 13, 14)."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from http import HTTPStatus
from typing import Any, Final, NamedTuple

from conformance.api.rest.patches import same
from conformance.checkers.occasion import Occasion
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import plain_name
from conformance.transport.exchange import SAFE_METHODS, Response
from conformance.verdict.evidence import Case

# Sentences in a description that demand a condition.
_NEEDED: Final = re.compile(
    r"\b(?:requires?|must|needs?)\b[^.]*\b(?:if-match|etag)\b|\b(?:if-match|etag)\b[^.]*\b(?:required|mandatory|must|needed)\b"
    r"|\b(?:without|no|missing)\b[^.]*\bif-match\b",
    re.IGNORECASE,
)
_TAG: Final = re.compile(r'(?:W/)?"[^"]*"')
_OPAQUE: Final = re.compile(r'"[^"]*"')
_PART: Final = re.compile(r"bytes (?P<first>\d+)-(?P<last>\d+)/", re.IGNORECASE)
_LIST: Final = re.compile(rf"\s*{_TAG.pattern}(?:\s*,\s*{_TAG.pattern})*\s*")
_GONE: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.GONE})
_CONDITIONS: Final = frozenset(
    {"if-match", "if-none-match", "if-modified-since", "if-unmodified-since", "if-range", "range"}
)
_TAGS, _MATCH = "description/entity-tag", "description/if-match"
# Conditions beside If-Match for which a request may also be refused with 412 (RFC 9110 13.2.2).
_OTHERS: Final = frozenset({"if-none-match", "if-modified-since", "if-unmodified-since"})
_MOST = 4000  # entity tags that are remembered
_LARGEST = 65_536  # longest content that is remembered with its tag, bytes


#: Header fields of a request that choose a representation.
Fields = tuple[tuple[str, str], ...]
#: Phrases in a description which say that a write with another revision than the present one is refused.
GUARDED: Final = re.compile(
    r"\b(?:revision|version|etag)\b[^.]*\b(?:not|differ\w*|other|stale|older?|match\w*)\b[^.]*\b(?:409|412|conflict|refus\w+)",
    re.IGNORECASE,
)
#: Members with the revision of a thing.
REVISION: Final = re.compile(r"(?:revision|version|etag)$")


class _Condition(NamedTuple):
    """A request with If-Match that waits for the next read.

    Attributes:
        occasion: the request.
        tag: the current one before it.
        matches: whether it was the one in If-Match.
        before: the content before it.
    """

    occasion: Occasion
    tag: str
    matches: bool
    before: Response

    @property
    def is_refused(self) -> bool:
        """Whether the condition is why it was refused, although a strong tag may match."""
        return self.occasion.response.status == HTTPStatus.PRECONDITION_FAILED and not self.tag.startswith("W/")


class EntityTags:
    """Judges entity tags and conditions; the current tag is that of the last read, if nothing was written since."""

    def __init__(self) -> None:
        self._named: dict[object, Response] = {}
        self._now: dict[str, Response] = {}
        self._asked: dict[str, Fields] = {}
        self._wrote: dict[str, Occasion] = {}
        self._waiting: dict[str, _Condition] = {}
        # Whether the device has ever answered 304 and 412: until then, the cases in the lists here do not count.
        self._has_304 = self._has_412 = False
        # How often the device refused a current tag while the content stayed the same.
        self._refused = 0
        self._ignored: list[Case] = []
        self._performed: list[Case] = []
        # The response before the last conditional write that was accepted, and the body of that write, by URL.
        self._spent: dict[str, tuple[Response, bytes]] = {}
        # 304 responses for an outdated copy, with the then current tag: the next read decides.
        self._stale: dict[str, tuple[Occasion, str]] = {}

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange, and of earlier ones that it decides."""
        request, answer = occasion.request, occasion.response
        if request.raw is not None or answer.cut:
            return
        asked = dict[str, str]()
        for name, value in request.headers:
            if name.lower() in _CONDITIONS:
                # Several fields of one name are one list (RFC 9110 5.3).
                asked[name.lower()] = f"{asked[name.lower()]}, {value}" if name.lower() in asked else value
        if request.method not in SAFE_METHODS:
            yield from self._write(occasion, asked)
        elif request.method in {"GET", "HEAD"} and "range" not in asked:
            if "if-none-match" in asked:
                yield from self._judge_cached(occasion, asked)
            if request.method == "GET":
                yield from self._read(occasion)

    def _read(self, occasion: Occasion) -> Iterator[Case]:
        """Compare a response with the earlier content of the same tag, and with the content before the last write."""
        url, answer = occasion.request.url, occasion.response
        # Compressed content has an entity tag of its own.
        wrote = self._wrote.pop(url, None) if not answer.header("content-encoding") else None
        waiting = self._waiting.pop(url, None)
        if answer.status == HTTPStatus.OK and url in self._stale:
            stale, current = self._stale.pop(url)
            expected = f"status 200 for a client without {current}, which was current before and after"
            is_so = answer.header("etag") == current and fields_of(occasion) == fields_of(stale)
            if is_so:
                yield stale.case(_TAGS, False, expected, cause=f"{label_of(stale.operation)} stale")  # noqa: FBT003
        if waiting is not None:
            yield from _effect(waiting, answer)
            # A single difference may come from another client's write.
            is_lost = waiting.matches and waiting.is_refused and waiting.before.body == answer.body
            self._refused += is_lost
            if is_lost and self._refused > 1 and waiting.tag != answer.header("etag"):
                expected = f"another status than 412, because the content is still what {waiting.tag} named"
                label = label_of(waiting.occasion.operation)
                yield waiting.occasion.case(_MATCH, False, expected, cause=f"{label} current")  # noqa: FBT003
        tag = answer.header("etag") or ""
        if answer.status != HTTPStatus.OK or not _TAG.fullmatch(tag):
            return
        self._now[url], self._asked[url] = answer, fields_of(occasion)
        if tag.startswith("W/"):
            return
        key = (url, tag, answer.media_type, answer.header("content-encoding") or "", fields_of(occasion))
        if key in self._named:
            other = difference(self._named[key], answer)
            expected = f"another entity tag than {tag} for another content"
            yield occasion.case(_TAGS, not other, expected, other, cause=f"{label_of(occasion.operation)} one tag")
        elif len(self._named) < _MOST and len(answer.body) < _LARGEST:
            self._named[key] = answer
        is_coded = wrote is not None and bool(wrote.response.header("content-encoding"))
        then = wrote.response.header("etag") if wrote is not None and not is_coded else None
        if wrote is not None and then and not then.startswith("W/") and wrote.response.body == answer.body:
            expected, found = f"ETag: {tag}, which a read right after gets with the same content", f"ETag: {then}"
            yield wrote.case(_TAGS, then == tag, expected, found, cause=f"{label_of(wrote.operation)} after")

    def _judge_cached(self, occasion: Occasion, asked: dict[str, str]) -> Iterator[Case]:
        """Judge a read by a client that has a copy: if it is current, it gets 304."""
        answer, label = occasion.response, label_of(occasion.operation)
        tags = {item.removeprefix("W/") for item in _TAG.findall(asked["if-none-match"])}
        # `If-None-Match: *` matches any content; no client has a copy with that tag, so 200 is no finding.
        is_any = asked["if-none-match"].strip() == "*"
        expected = "status 304, because If-None-Match has the current entity tag"
        if answer.status == HTTPStatus.NOT_MODIFIED:
            self._has_304 = True
            now = self._now.get(occasion.request.url)
            known = now.header("etag") if now is not None else None
            expected = f"status 304 with ETag: {known}, as status 200 has one (RFC 9110 15.4.5)" if known else expected
            is_alike = self._asked.get(occasion.request.url) == fields_of(occasion)
            if known and is_alike and known.removeprefix("W/") not in tags and not is_any:
                self._stale[occasion.request.url] = occasion, known
            tag = answer.header("etag")
            lacks = "" if known is None or tag is not None else "ETag"
            if now is not None and is_alike and now.header("vary") and not answer.header("vary"):
                lacks, expected = "Vary", "status 304 with Vary, as status 200 has one (RFC 9110 15.4.5)"
            yield occasion.case(_TAGS, not lacks, expected, f"status 304 without {lacks}", cause=f"{label} 304 without")
            if tag is not None and tags:
                expected = "status 304 with an ETag that is in If-None-Match"
                is_named = tag.removeprefix("W/") in tags
                yield occasion.case(_TAGS, is_named, expected, f"ETag: {tag}", cause=f"{label} 304 other")
            yield from self._ignored
            self._ignored.clear()
        elif answer.status == HTTPStatus.OK and (answer.header("etag") or "").removeprefix("W/") in tags:
            case = occasion.case(
                _TAGS, False, expected, f"status 200 with ETag: {answer.header('etag')}", cause=f"{label} 304"  # noqa: FBT003
            )  # fmt: skip
            if occasion.operation is not None and "304" in occasion.operation.responses:
                yield case
            else:
                self._ignored.append(replace(case, doubt="the operation does not declare 304"))
            if self._has_304:
                yield from self._ignored
                self._ignored.clear()
        elif answer.status == HTTPStatus.PRECONDITION_FAILED and "if-match" not in asked:
            expected = "status 304 or 200 for a GET with If-None-Match"
            yield occasion.case(_TAGS, False, expected, cause=f"{label} 412")  # noqa: FBT003

    def _write(self, occasion: Occasion, asked: dict[str, str]) -> Iterator[Case]:
        """Judge a request that changes something, by its conditions and the tag that was current before."""
        url, answer, wanted = occasion.request.url, occasion.response, asked.get("if-match")
        now, is_refused = self._now.get(url), 400 <= answer.status < 500  # noqa: PLR2004 - RFC 9110 15.5
        self._wrote.pop(url, None)
        self._waiting.pop(url, None)
        if not is_refused:
            # A POST may change any resource.
            self._now.clear()
            self._wrote.clear()
            self._waiting.clear()
            self._stale.clear()
            self._spent = {one: spent for one, spent in self._spent.items() if one == url}
            if answer.ok and occasion.request.method in {"PUT", "PATCH"}:
                self._wrote[url] = occasion
        yield from self._at_once(occasion, now, wanted or "")
        if now is not None:
            yield from _judge_needed(occasion, asked)
        is_any = (wanted or "").strip() == "*"
        if wanted is None or now is None or not (is_any or _LIST.fullmatch(wanted)):
            return
        if not _OTHERS.isdisjoint(asked):
            return
        tag = now.header("etag") or ""
        named = _TAG.findall(wanted)
        # If-Match compares strongly, but a device with only weak tags may accept its own.
        weakly = tag.startswith("W/") and tag[2:] in {item.removeprefix("W/") for item in named}
        matches = tag in named or weakly or is_any
        if is_refused:
            if answer.status == HTTPStatus.PRECONDITION_FAILED and not matches:
                self._has_412 |= not tag.startswith("W/")
                yield occasion.case(_MATCH, True, _refusal(tag))  # noqa: FBT003
                yield from self._performed
                self._performed.clear()
            self._waiting[url] = _Condition(occasion, tag, matches, now)
        elif answer.ok and answer.status != HTTPStatus.ACCEPTED and not matches:
            label = label_of(occasion.operation)
            case = occasion.case(_MATCH, False, _refusal(tag), cause=f"{label} performed")  # noqa: FBT003
            # Without a conditional header, 412 may be about the device's state.
            if self._has_412 or _declares(occasion.operation, with_status=not tag.startswith("W/")):
                yield case
            else:
                self._performed.append(case)

    def _at_once(self, occasion: Occasion, now: Response | None, wanted: str) -> Iterator[Case]:
        """Judge a write by a tag that another one has used since it was read, as two clients do at the same moment.

        What the other one wrote already may be accepted (RFC 9110 13.1.1).
        """
        url, status = occasion.request.url, occasion.response.status
        spent = self._spent.pop(url, None) if now is None else (now, b"")
        before, other = spent if spent is not None else (None, b"")
        tag = (before.header("etag") if before is not None else None) or "W/"
        if before is None or tag.startswith("W/") or tag not in _TAG.findall(wanted) or other == occasion.request.body:
            return
        is_done = _has_changed(occasion, before)
        if now is None and (is_done or status == HTTPStatus.PRECONDITION_FAILED):
            found, label = f"status {status}, as the write before it by this tag", label_of(occasion.operation)
            expected = f"a refusal with 412, because another write has changed what {tag} named"
            case = occasion.case(_MATCH, not is_done, expected, found, cause=f"{label} at once")
            if not is_done or self._has_412 or _declares(occasion.operation, with_status=True):
                yield case
            else:
                self._performed.append(case)
        if is_done:
            self._spent[url] = before, occasion.request.body


def _judge_needed(occasion: Occasion, asked: dict[str, str]) -> Iterator[Case]:
    """Judge an unconditional request that needs If-Match, or If-None-Match: * (RFC 9110 13.1.2, RFC 6585 3)."""
    operation, answer = occasion.operation, occasion.response
    is_done = answer.ok and answer.status != HTTPStatus.ACCEPTED
    if operation is None or occasion.request.method not in {"PUT", "PATCH", "DELETE"}:
        return
    names = {item.name.lower() for item in operation.parameter("header")}
    if asked.get("if-none-match", "").strip() == "*" and "if-none-match" in names:
        if is_done or answer.status == HTTPStatus.PRECONDITION_FAILED:
            expected = "a refusal with 412, because If-None-Match: * asks that nothing is there"
            yield occasion.case(_MATCH, not is_done, expected, cause=f"{operation.label} none")
        return
    is_decided = is_done or answer.status == HTTPStatus.PRECONDITION_REQUIRED
    is_asked_for = "if-match" in names and "428" in operation.responses
    if asked.keys().isdisjoint({"if-match", *_OTHERS}) and is_asked_for and is_decided:
        expected = "a refusal with 428, which the operation declares as well as If-Match"
        is_required = any(item.required for item in operation.parameter("header") if item.name.lower() == "if-match")
        doubt = "" if is_required or _NEEDED.search(operation.text) else "428 may be about some requests only"
        yield occasion.case(_MATCH, not is_done, expected, cause=f"{operation.label} header If-Match", doubt=doubt)


def _has_changed(occasion: Occasion, before: Response) -> bool:
    """Return whether the response to a write contains a sent value that was another one before."""
    sent, old, new = (
        read_json(octets).value for octets in (occasion.request.body, before.body, occasion.response.body)
    )
    if not occasion.response.ok or not all(isinstance(item, dict) for item in (sent, old, new)):
        return False
    return any(name in old and old[name] != value == new.get(name) for name, value in sent.items())


def fields_of(occasion: Occasion) -> Fields:
    """Return the header fields of a request without its conditions, which choose a representation."""
    return tuple(pair for pair in occasion.request.headers if pair[0].lower() not in _CONDITIONS)


def _effect(waiting: _Condition, after: Response) -> Iterator[Case]:
    """Judge a refused request by the next read."""
    occasion, label = waiting.occasion, label_of(waiting.occasion.operation)
    status = occasion.response.status
    if waiting.matches:
        # A weak tag never matches in If-Match (RFC 9110 13.1.1).
        is_sure = after.header("etag") == waiting.tag and not waiting.tag.startswith("W/")
        if is_sure and status == HTTPStatus.PRECONDITION_FAILED:
            expected = f"another status than 412, because {waiting.tag} was current before and after"
            yield occasion.case(_MATCH, False, expected, cause=f"{label} current")  # noqa: FBT003
        return
    acted = ""
    if occasion.request.method == "DELETE":
        acted = "nothing there any more" if after.status in _GONE else ""
    elif after.ok:
        sent, old, new = (
            read_json(octets).value for octets in (occasion.request.body, waiting.before.body, after.body)
        )
        if all(isinstance(item, dict) for item in (sent, old, new)):
            changed = [name for name, value in sent.items() if name in old and old[name] != value]
            if changed and all(new.get(name) == sent[name] for name in changed):
                acted = f"{changed[0]} as it was sent, {clip(sent[changed[0]])}"
    expected = f"no effect of a request that was refused with status {status}"
    yield occasion.case(_MATCH, not acted, expected, acted, cause=f"{label} effect")


def _refusal(tag: str) -> str:
    return f"a refusal with 412, because If-Match does not name the current entity tag {tag}"


def _declares(operation: Operation | None, *, with_status: bool) -> bool:
    """Return whether the description has If-Match for an operation, or 412 if that is enough."""
    if operation is None:
        return False
    named = (item.name.lower() for item in operation.parameter("header"))
    return (with_status and "412" in operation.responses) or "if-match" in named


def difference(one: Response, other: Response) -> str:
    """Return how two contents differ, as a noun phrase; empty if they are equal."""
    if one.body == other.body:
        return ""
    if not (is_json(one.media_type) and is_json(other.media_type)):
        return f"{len(one.body)} bytes, and others before" if one.media_type == other.media_type else ""
    old, new = read_json(one.body).value, read_json(other.body).value
    if old == new:
        return ""
    if isinstance(old, dict) and isinstance(new, dict):
        name = next(name for name in (*old, *new) if old.get(name, old) != new.get(name, new))
        return f"{name} {_member_text(new, name)}, and {_member_text(old, name)} before"
    return "another content than before"


def _member_text(value: dict[str, Any], name: str) -> str:
    return clip(value[name]) if name in value else "missing"


def label_of(operation: Operation | None) -> str:
    """Return the label of an operation; empty without one."""
    return operation.label if operation else ""


class Conditional:
    """Judges responses to conditions, by the entity tags and dates that the run has seen."""

    def __init__(self) -> None:
        # Entity tags that the device sent, by URL.
        self._tags: dict[str, set[str]] = {}
        self._dated: set[str] = set()  # whether it sent Last-Modified

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        url, answer = occasion.request.url, occasion.response
        # The headers of a 304 may repeat what the client sent.
        if answer.status != HTTPStatus.NOT_MODIFIED:
            self._tags.setdefault(url, set()).update(_OPAQUE.findall(answer.header("etag") or ""))
            if answer.header("last-modified") is not None:
                self._dated.add(url)
        asked = {name.lower(): value for name, value in occasion.request.headers}
        yield from self._not_modified(occasion, asked)
        if "range" in asked or answer.status == HTTPStatus.PARTIAL_CONTENT:
            yield _range(occasion, asked)

    def _not_modified(self, occasion: Occasion, asked: dict[str, str]) -> Iterator[Case]:
        id_, is_unchanged = "http/preconditions", occasion.response.status == HTTPStatus.NOT_MODIFIED
        tags = _OPAQUE.findall(asked.get("if-none-match", ""))
        if tags and asked["if-none-match"].strip() != "*":
            expected = "another status than 304 when the robot never sent the entity tag"
            has_sent = not self._tags.get(occasion.request.url, set()).isdisjoint(tags)
            yield occasion.case(id_, has_sent or not is_unchanged, expected)
        elif "if-modified-since" in asked and "if-none-match" not in asked:
            # If the device sends Last-Modified, the resource may not have changed since, by whichever clock.
            expected = "another status than 304 when the resource has no Last-Modified"
            yield occasion.case(id_, not is_unchanged or occasion.request.url in self._dated, expected)
        elif is_unchanged and "if-none-match" not in asked:
            yield occasion.case(id_, False, "another status than 304 for a request without a condition")  # noqa: FBT003


def _range(occasion: Occasion, asked: dict[str, str]) -> Case:
    """Judge a request for a part: the response is the whole, or 206 with its Content-Range."""
    answer = occasion.response
    # A server may send a smaller or larger range than requested, and then says so (RFC 9110 15.3.7).
    part = _PART.match(answer.header("content-range") or "")
    fits = part is not None and len(answer.body) == int(part["last"]) - int(part["first"]) + 1
    fits |= occasion.context.is_head or answer.media_type == "multipart/byteranges"
    return occasion.case(
        "http/range",
        answer.status != HTTPStatus.PARTIAL_CONTENT or ("range" in asked and fits),
        "another status than 206, or a part that was asked for, and the header field Content-Range that fits it",
        f"status 206 with {len(answer.body)} bytes and Content-Range: {answer.header('content-range')}",
    )


def judge_revision(
    read: Occasion, write: Occasion, sent: Mapping[str, Any], before: Mapping[str, Any]
) -> Iterator[Case]:
    """Judge whether a write with another revision than the present one is refused, if the description says so."""
    operation = write.operation
    for name in sent.keys() & before.keys() if operation is not None and GUARDED.search(operation.text) else ():
        if operation is not None and REVISION.search(plain_name(name)):
            expected = f"a refusal, as {name} was {clip(before[name])}, and not {clip(sent[name])}"
            found, cause = f"status {write.response.status}", f"{operation.label} {name} stale"
            yield read.case("description/states", same(sent[name], before[name]), expected, found, cause=cause)
