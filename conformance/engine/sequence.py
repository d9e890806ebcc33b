"""The requests that led to a finding, as result.json keeps them for ``roaas replay``."""

from __future__ import annotations

import base64
import re
import zlib
from typing import TYPE_CHECKING, Any

from conformance.transport.exchange import Listener, Request

if TYPE_CHECKING:
    from collections.abc import Sequence

    from conformance.transport.exchange import Exchange, Unanswered
    from conformance.verdict.evidence import Judge, Sent

# Octets of one request in a result, compressed; and as they are sent: twice the contract's limit and a half.
_MOST = 64 * 1024
_MOST_SENT = 25 * 1024 * 1024

# What a request is made of on the wire (RFC 9110 5.6.2, 5.5; RFC 9112 3.2): no place for another request in it.
_TOKEN = re.compile(r"[!#$%&'*+.^_`|~0-9A-Za-z-]+")
_TARGET = re.compile(r"https?://[\x21-\x7e]+")
_VALUE = re.compile(r"[^\x00\r\n]*")


class Recorder(Listener):
    """Tells the judge what is sent, before any observer judges it."""

    def __init__(self, judge: Judge) -> None:
        self._judge = judge

    def answered(self, exchange: Exchange) -> None:
        """Take a request that was answered."""
        self._judge.sent(exchange.request)

    def unanswered(self, request: Unanswered) -> None:
        """Take one that was not."""
        self._judge.sent(request.request)


def written(sequence: Sequence[Sent]) -> list[dict[str, Any]]:
    """A sequence as JSON; ``at_s`` counts from its first request."""
    return [
        {
            "at_s": round(sent.at_s - sequence[0].at_s, 3),
            "method": sent.request.method,
            "url": sent.request.url,
            "headers": [list(pair) for pair in sent.request.headers],
            "body": _packed(sent.request.body),
            "raw": None if sent.request.raw is None else _packed(sent.request.raw),
        }
        for sent in sequence
    ]


def read_request(item: dict[str, Any]) -> Request | None:
    """A request of a written sequence; None where it was too large to be kept.

    Raises:
        ValueError, KeyError, TypeError: it is not one.
    """
    body, raw = _unpacked(item["body"]), None if item["raw"] is None else _unpacked(item["raw"])
    if body is None or (item["raw"] is not None and raw is None):
        return None
    headers = tuple((str(name), str(value)) for name, value in item["headers"])
    method, url = str(item["method"]), str(item["url"])
    parts = [(_TARGET, url)]
    if raw is None:
        parts += [
            (_TOKEN, method),
            *((_TOKEN, name) for name, _ in headers),
            *((_VALUE, value) for _, value in headers),
        ]
    for pattern, text in parts:
        if not pattern.fullmatch(text):
            raise ValueError(f"{text[:80]!r} is no part of a request")
    return Request(method, url, headers, body, raw)


def _packed(octets: bytes) -> str | None:
    """Octets in base64, compressed (RFC 1950); None where that is still too much."""
    packed = zlib.compress(octets) if octets else b""
    return base64.b64encode(packed).decode() if len(packed) <= _MOST and len(octets) <= _MOST_SENT else None


def _unpacked(text: str | None) -> bytes | None:
    """Octets as they were; a result may be anybody's, and no more than a run writes is ever unpacked."""
    if not text:
        return None if text is None else b""
    packed = base64.b64decode(text)
    opened = zlib.decompressobj()
    try:
        octets = opened.decompress(packed, _MOST_SENT + 1) if len(packed) <= _MOST else b""
    except zlib.error as error:
        raise ValueError(str(error)) from error
    if not opened.eof:
        raise ValueError(f"a request that is cut short, or has more than {_MOST_SENT:,} octets")
    return octets
