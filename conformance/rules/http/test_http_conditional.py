"""Conditional requests and range requests, as caches and download clients send them; checkers judge the responses."""

import pytest

from conformance.api.rest.applicable import answered
from conformance.api.rest.interface import RestInterface

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
_PRECONDITIONS = "http/preconditions"
_RANGE = "http/range"
# No response has this entity tag, and every response is newer than HTTP.
_NO_TAG = '"roaas-nothing-has-this-tag"'
_LONG_AGO = "Sat, 29 Oct 1994 19:43:31 GMT"
# Reads at standard effort.
_STANDARD = 10


@pytest.mark.requirement(_PRECONDITIONS)
def test_what_a_cache_asks(api: RestInterface) -> None:
    """Send conditions of a client without a current copy."""
    for call in api.run.effort.draw(answered(api, _PRECONDITIONS), _STANDARD, f"{api.run.seed}/preconditions"):
        exchange = call.send(api, ("If-None-Match", _NO_TAG))
        if exchange.response.header("last-modified") is None:
            call.send(api, ("If-Modified-Since", _LONG_AGO))


@pytest.mark.requirement(_RANGE)
def test_a_part(api: RestInterface) -> None:
    """Send a range request to each resource."""
    for call in api.run.effort.draw(answered(api, _RANGE), _STANDARD, f"{api.run.seed}/range")[:_STANDARD]:
        call.send(api, ("Range", "bytes=0-3"))
