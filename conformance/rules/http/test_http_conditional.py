"""Requests as caches and downloads make them: conditions that a robot cannot deny, and parts (RFC 9110 13, 14)."""

import re

import pytest

from conformance.api.rest.applicable import answered
from conformance.api.rest.interface import RestInterface
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("reading"), pytest.mark.needs("rest")]
_PRECONDITIONS = "http/preconditions"
_RANGE = "http/range"
# No answer has this entity tag, and all that a robot says of itself is newer than HTTP.
_NO_TAG = '"roaas-nothing-has-this-tag"'
_LONG_AGO = "Sat, 29 Oct 1994 19:43:31 GMT"
_PART = re.compile(r"bytes (?P<first>\d+)-(?P<last>\d+)/", re.IGNORECASE)
_NOT_MODIFIED = 304
_PARTIAL = 206
# Reads at standard effort.
_STANDARD = 10


@pytest.mark.requirement(_PRECONDITIONS)
def test_what_a_cache_asks(api: RestInterface, judge: Judge) -> None:
    """Whoever has nothing of what there is now is told all of it, and not that nothing has changed."""
    for call in api.run.effort.draw(answered(api), _STANDARD, f"{api.run.seed}/preconditions"):
        exchange = call.send(api, ("If-None-Match", _NO_TAG))
        judge.check(
            _PRECONDITIONS,
            exchange.response.status != _NOT_MODIFIED,
            exchange,
            "no 304 for an entity tag that the robot never gave",
        )
        # Where a robot says when something was changed, by whatever clock, that may have been longer ago.
        if exchange.response.header("last-modified") is None:
            exchange = call.send(api, ("If-Modified-Since", _LONG_AGO))
            judge.check(
                _PRECONDITIONS,
                exchange.response.status != _NOT_MODIFIED,
                exchange,
                "no 304 where the robot has no date of modification",
            )


@pytest.mark.requirement(_RANGE)
def test_a_part(api: RestInterface, judge: Judge) -> None:
    """Whoever asks for a part gets all, or is told which part that is."""
    for call in api.run.effort.draw(answered(api), _STANDARD, f"{api.run.seed}/range")[:_STANDARD]:
        exchange = call.send(api, ("Range", "bytes=0-3"))
        answer = exchange.response
        # A server may send less than was asked for, or more, and then says so (RFC 9110 15.3.7).
        part = _PART.match(answer.header("content-range") or "")
        told = part is not None and len(answer.body) == int(part["last"]) - int(part["first"]) + 1
        several = answer.media_type == "multipart/byteranges"
        judge.check(
            _RANGE,
            answer.status != _PARTIAL or told or several,
            exchange,
            "206 with a Content-Range that says which octets these are, or another status",
            found=f"206 with {len(answer.body)} octets and Content-Range: {answer.header('content-range')}",
        )
