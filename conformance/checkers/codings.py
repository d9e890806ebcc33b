"""Content codings (RFC 9110 8.4, 12.5.3): gzip data is whole, has the content as it is without, and is allowed."""

from __future__ import annotations

import re
import zlib
from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from typing import Final

from conformance.checkers.entity_tags import Fields, difference, label_of
from conformance.checkers.occasion import Occasion
from conformance.transport.exchange import SAFE_METHODS, Exchange, Response
from conformance.verdict.evidence import Case

_CODING, _ALLOWED = "http/content-coding", "http/accept-encoding"
_GZIP: Final = frozenset({"gzip", "x-gzip"})
# zlib's argument for gzip data with its checksum; octets of unpacked content that are read.
_GZIP_BITS, _LARGEST = 31, 1 << 25
# Resources that are remembered; equal readings without a coding that show that a resource stands still.
_MOST, _STEADY = 200, 3
# An element of Accept-Encoding (RFC 9110 12.4.2, 12.5.3).
_ELEMENT: Final = re.compile(r"\s*([!#$%&'*+.^_`|~\w-]+)\s*(?:;\s*[qQ]=([01](?:\.\d{0,3})?)\s*)?", re.ASCII)
# Contents that a cache keeps for nobody, for one client alone, or asks for anew each time.
_NOT_SHARED: Final = re.compile(r"no-store|no-cache|private", re.IGNORECASE)


class NotWholeError(ValueError):
    """Raised for content that is not what its coding says; the message is a noun phrase."""


def coding_of(response: Response) -> str:
    """Return the value of Content-Encoding in lower case; empty without a coding."""
    coding = (response.header("content-encoding") or "").strip().lower()
    return "" if coding == "identity" else coding


def uncoded(exchange: Exchange) -> Exchange | None:
    """Return an exchange with its content unpacked; None if it has a coding that is not gzip, or is too large.

    Raises:
        NotWholeError: its content is no whole gzip data.
    """
    answer, coding = exchange.response, coding_of(exchange.response)
    if not coding or exchange.request.method == "HEAD" or not answer.body:
        return exchange
    if coding not in _GZIP or answer.cut or answer.status == HTTPStatus.PARTIAL_CONTENT:
        return None
    left, found = answer.body, bytearray()
    while left:  # several members are one content (RFC 1952 2.2)
        unpacker = zlib.decompressobj(_GZIP_BITS)
        try:
            found += unpacker.decompress(left, _LARGEST - len(found) + 1)
        except zlib.error as error:
            what = f"{len(left)} bytes after the end of the gzip data" if found else f"no gzip data ({error})"
            raise NotWholeError(what) from error
        if len(found) > _LARGEST:
            return None
        if not unpacker.eof:
            raise NotWholeError(f"{len(answer.body)} bytes of gzip data that end before their checksum")
        left = unpacker.unused_data
    return replace(exchange, response=replace(answer, body=bytes(found)))


@dataclass
class _Resource:
    """What was read without a coding: the last response, how many there were, and coded ones that wait for more."""

    last: Response | None = None
    count: int = 0
    varies: bool = False
    coded: list[tuple[Occasion, Response]] = field(default_factory=list)

    def bare(self, answer: Response) -> Iterator[Case]:
        """Note a response without a coding; judge the coded ones before it if nothing has ever changed."""
        self.varies |= self.last is not None and bool(difference(self.last, answer))
        self.last, self.count = answer, self.count + 1
        if self.count < _STEADY:
            return
        for occasion, plain in () if self.varies else self.coded:
            other, cause = difference(answer, plain), f"{label_of(occasion.operation)} content"
            yield occasion.case(_CODING, not other, "the content that is read without a coding", other, cause=cause)
        self.coded.clear()


class Codings:
    """Judges the codings of responses."""

    def __init__(self) -> None:
        self._resources = dict[tuple[str, Fields], _Resource]()

    def __call__(self, occasion: Occasion) -> Generator[Case, None, Exchange | None]:
        """Yield the cases of one exchange, and of earlier ones that it decides.

        Returns:
            The exchange with its content unpacked; None if it cannot be.
        """
        sent, fault = occasion.exchange, ""
        try:
            unpacked = uncoded(sent)
        except NotWholeError as error:
            unpacked, fault = None, str(error)
        if fault or (unpacked is not None and unpacked is not sent):
            expected = "whole gzip data, as Content-Encoding says, with its checksum and nothing after it"
            yield occasion.case(_CODING, not fault, expected, fault, cause=f"{label_of(occasion.operation)} gzip")
        request, names = occasion.request, {name.lower() for name, _ in occasion.request.headers}
        if request.method not in SAFE_METHODS:
            self._resources.clear()
        elif request.method == "GET" and request.raw is None and "range" not in names and not sent.response.cut:
            yield from _allowed(occasion)
            if sent.response.status == HTTPStatus.OK:
                yield from self._read(occasion, unpacked)
        return unpacked

    def _read(self, occasion: Occasion, unpacked: Exchange | None) -> Iterator[Case]:
        request, answer = occasion.request, occasion.response
        others = tuple(pair for pair in request.headers if pair[0].lower() != "accept-encoding")
        if len(self._resources) >= _MOST:
            self._resources.clear()
        known = self._resources.setdefault((request.url, others), _Resource())
        if not coding_of(answer):
            yield from known.bare(answer)
        elif known.last is not None:
            yield from _beside(occasion, known.last)
            if unpacked is not None:
                known.coded.append((occasion, unpacked.response))


def _allowed(occasion: Occasion) -> Iterator[Case]:
    """Judge a response by Accept-Encoding; without it, any coding may be sent."""
    asked = ", ".join(value for name, value in occasion.request.headers if name.lower() == "accept-encoding")
    coding, weights = coding_of(occasion.response), _weights(asked)
    if asked and weights is not None:
        expected = f"no coding but one that Accept-Encoding: {asked} allows"
        holds = not coding or all(_is_allowed(one.strip(), weights) for one in coding.split(","))
        cause = f"{label_of(occasion.operation)} allowed"
        yield occasion.case(_ALLOWED, holds, expected, f"Content-Encoding: {coding}", cause=cause)


def _beside(occasion: Occasion, bare: Response) -> Iterator[Case]:
    """Judge the header fields of a coded response beside those of one without a coding."""
    answer, label = occasion.response, label_of(occasion.operation)
    tag, vary = answer.header("etag") or "", answer.header("vary") or ""
    if tag.startswith('"') and bare.header("etag"):
        expected = f"another strong entity tag than {tag}, which the content without a coding has"
        is_other = tag != bare.header("etag")
        yield occasion.case(_ALLOWED, is_other, expected, f"ETag: {tag}", cause=f"{label} tag")
    if not _NOT_SHARED.search(answer.header("cache-control") or ""):
        named = {one.strip().lower() for one in vary.split(",")}
        expected, found = "Vary with Accept-Encoding", f"Vary: {vary}" if vary else "no header field Vary"
        yield occasion.case(_ALLOWED, bool(named & {"accept-encoding", "*"}), expected, found, cause=f"{label} Vary")


def _weights(text: str) -> dict[str, float] | None:
    """Return the weights in an Accept-Encoding by coding in lower case; None if it is malformed."""
    found = [_ELEMENT.fullmatch(one) for one in text.split(",") if one.strip()]
    if any(one is None for one in found):
        return None
    return {one[1].lower(): float(one[2] or 1) for one in found if one is not None}


def _is_allowed(coding: str, weights: dict[str, float]) -> bool:
    same = _GZIP if coding in _GZIP else {coding}
    given = [weight for name, weight in weights.items() if name in same]
    return max(given, default=weights.get("*", 0.0)) > 0
