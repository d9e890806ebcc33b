"""Content codings (RFC 9110 8.4, 12.5.3): gzip data is complete, equals the plain content, and was allowed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Final

from conformance.checkers.entity_tags import Fields, difference, label_of
from conformance.checkers.occasion import Occasion
from conformance.transport.exchange import SAFE_METHODS, Response
from conformance.verdict.evidence import Case

_CODING, _ALLOWED = "http/content-coding", "http/accept-encoding"
_GZIP: Final = frozenset({"gzip", "x-gzip"})
_MOST = 200  # resources that are remembered
_STEADY = 3  # equal uncompressed responses which show that a resource does not change
# An element of Accept-Encoding (RFC 9110 12.4.2, 12.5.3).
_ELEMENT: Final = re.compile(r"\s*([!#$%&'*+.^_`|~\w-]+)\s*(?:;\s*[qQ]=([01](?:\.\d{0,3})?)\s*)?", re.ASCII)
# Responses that a cache may not store or share, or must revalidate each time.
_NOT_SHARED: Final = re.compile(r"no-store|no-cache|private", re.IGNORECASE)


@dataclass
class _Resource:
    """Responses for one resource: the last plain one, their number, and compressed ones that wait to be compared."""

    last: Response | None = None
    count: int = 0
    varies: bool = False
    coded: list[Occasion] = field(default_factory=list)

    def bare(self, answer: Response) -> Iterator[Case]:
        """Note a response without a coding; judge the coded ones before it if nothing has ever changed."""
        self.varies |= self.last is not None and bool(difference(self.last, answer))
        self.last, self.count = answer, self.count + 1
        if self.count < _STEADY:
            return
        for occasion in () if self.varies else self.coded:
            other, cause = difference(answer, occasion.response), f"{label_of(occasion.operation)} content"
            yield occasion.case(_CODING, not other, "the content that is read without a coding", other, cause=cause)
        self.coded.clear()


class Codings:
    """Judges the codings of responses."""

    def __init__(self) -> None:
        self._resources = dict[tuple[str, Fields], _Resource]()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange, and of earlier ones that it decides."""
        sent, content = occasion.exchange, occasion.response.content
        if content.fault or (content.coding and content.is_plain and content.octets):
            expected = "whole gzip data, as Content-Encoding says, with its checksum and nothing after it"
            cause = f"{label_of(occasion.operation)} gzip"
            yield occasion.case(_CODING, not content.fault, expected, content.fault, cause=cause)
        request, names = occasion.request, {name.lower() for name, _ in occasion.request.headers}
        if request.method not in SAFE_METHODS:
            self._resources.clear()
        elif request.method == "GET" and request.raw is None and "range" not in names and not sent.response.cut:
            yield from _judge_allowed(occasion)
            if sent.response.status == HTTPStatus.OK:
                yield from self._read(occasion)

    def _read(self, occasion: Occasion) -> Iterator[Case]:
        request, answer = occasion.request, occasion.response
        others = tuple(pair for pair in request.headers if pair[0].lower() != "accept-encoding")
        if len(self._resources) >= _MOST:
            self._resources.clear()
        known = self._resources.setdefault((request.url, others), _Resource())
        if not answer.content.coding:
            yield from known.bare(answer)
        elif known.last is not None:
            yield from _beside(occasion, known.last)
            if answer.content.is_plain:
                known.coded.append(occasion)


def _judge_allowed(occasion: Occasion) -> Iterator[Case]:
    """Judge a response's coding by Accept-Encoding; without that header, any coding is allowed."""
    asked = ", ".join(value for name, value in occasion.request.headers if name.lower() == "accept-encoding")
    coding, weights = occasion.response.content.coding, _weights(asked)
    if asked and weights is not None:
        expected = f"no coding but one that Accept-Encoding: {asked} allows"
        holds = not coding or all(_is_allowed(text.strip(), weights) for text in coding.split(","))
        cause = f"{label_of(occasion.operation)} allowed"
        yield occasion.case(_ALLOWED, holds, expected, f"Content-Encoding: {coding}", cause=cause)


def _beside(occasion: Occasion, bare: Response) -> Iterator[Case]:
    """Compare the headers of a coded response with those of an uncoded one."""
    answer, label = occasion.response, label_of(occasion.operation)
    tag, vary = answer.header("etag") or "", answer.header("vary") or ""
    if tag.startswith('"') and bare.header("etag"):
        expected = f"another strong entity tag than {tag}, which the content without a coding has"
        is_other = tag != bare.header("etag")
        yield occasion.case(_ALLOWED, is_other, expected, f"ETag: {tag}", cause=f"{label} tag")
    if not _NOT_SHARED.search(answer.header("cache-control") or ""):
        named = {text.strip().lower() for text in vary.split(",")}
        expected, found = "Vary with Accept-Encoding", f"Vary: {vary}" if vary else "no header field Vary"
        yield occasion.case(_ALLOWED, bool(named & {"accept-encoding", "*"}), expected, found, cause=f"{label} Vary")


def _weights(text: str) -> dict[str, float] | None:
    """Return the weights in an Accept-Encoding by coding in lower case; None if it is malformed."""
    found = [_ELEMENT.fullmatch(one) for one in text.split(",") if one.strip()]
    if any(match is None for match in found):
        return None
    return {match[1].lower(): float(match[2] or 1) for match in found if match is not None}


def _is_allowed(coding: str, weights: dict[str, float]) -> bool:
    same = _GZIP if coding in _GZIP else {coding}
    given = [weight for name, weight in weights.items() if name in same]
    return max(given, default=weights.get("*", 0.0)) > 0
