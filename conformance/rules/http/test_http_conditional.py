"""Conditional requests and range requests, as caches and download clients send them (RFC 9110 13, 14)."""

import re

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import answered
from conformance.api.rest.interface import RestInterface
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
_PRECONDITIONS = "http/preconditions"
_RANGE = "http/range"
# No response has this entity tag, and every response is newer than HTTP.
_NO_TAG = '"roaas-nothing-has-this-tag"'
_LONG_AGO = "Sat, 29 Oct 1994 19:43:31 GMT"
_PART = re.compile(r"bytes (?P<first>\d+)-(?P<last>\d+)/", re.IGNORECASE)
_NOT_MODIFIED = 304
_PARTIAL = 206
# Reads at standard effort.
_STANDARD = 10


@pytest.mark.requirement(_PRECONDITIONS)
def test_what_a_cache_asks(api: RestInterface, judge: Judge) -> None:
    """Send conditions of a client without a current copy: the response must be 200 with content, not 304."""
    for call in api.run.effort.draw(answered(api, _PRECONDITIONS), _STANDARD, f"{api.run.seed}/preconditions"):
        exchange = call.send(api, ("If-None-Match", _NO_TAG))
        expected = "another status than 304 when the robot never sent the entity tag"
        expect(judge, _PRECONDITIONS, exchange).that(exchange.response.status != _NOT_MODIFIED, expected)
        # Where a robot says when something was changed, by whatever clock, that may have been longer ago.
        if exchange.response.header("last-modified") is None:
            exchange = call.send(api, ("If-Modified-Since", _LONG_AGO))
            expected = "another status than 304 when the resource has no Last-Modified"
            expect(judge, _PRECONDITIONS, exchange).that(exchange.response.status != _NOT_MODIFIED, expected)


@pytest.mark.requirement(_RANGE)
def test_a_part(api: RestInterface, judge: Judge) -> None:
    """Send a range request to each resource: the response is the whole, or 206 with its Content-Range."""
    for call in api.run.effort.draw(answered(api, _RANGE), _STANDARD, f"{api.run.seed}/range")[:_STANDARD]:
        exchange = call.send(api, ("Range", "bytes=0-3"))
        answer = exchange.response
        # A server may send less than was asked for, or more, and then says so (RFC 9110 15.3.7).
        part = _PART.match(answer.header("content-range") or "")
        fits = part is not None and len(answer.body) == int(part["last"]) - int(part["first"]) + 1
        several = answer.media_type == "multipart/byteranges"
        expect(judge, _RANGE, exchange).that(
            answer.status != _PARTIAL or fits or several,
            "another status than 206, or the header field Content-Range that fits the content",
            f"status 206 with {len(answer.body)} bytes and Content-Range: {answer.header('content-range')}",
        )
