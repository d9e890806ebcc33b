"""Formats that the client excludes (RFC 9110 12.4.2, 12.5.1, 15.5.7), and conditions; checkers judge the latter."""

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import reads, working_reads
from conformance.api.rest.formats import quality
from conformance.api.rest.interface import RestInterface
from conformance.transport.exchange import Outgoing
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
# Formats that no robot offers.
_NOTHING = ("image/png", "application/vnd.roaas-nobody-has-this", "audio/*;q=0.5, video/*")


@pytest.mark.requirement("http/not-acceptable")
def test_no_acceptable_format(api: RestInterface, judge: Judge) -> None:
    """Send Accept with only formats that the robot does not offer."""
    cases = [(call, accept) for call in working_reads(api, "http/not-acceptable") for accept in _NOTHING]
    for call, accept in api.run.effort.draw(cases, 120, f"{api.run.seed}/not acceptable"):
        exchange = call.send(api, ("Accept", accept))
        expect(judge, "http/not-acceptable", exchange).status(406, when=f"Accept is {accept}")


@pytest.mark.requirement("http/q-zero")
def test_quality_zero(api: RestInterface, judge: Judge) -> None:
    """Exclude formats by q=0: the robot must send another format, or 406."""
    for call in api.run.effort.subsample(working_reads(api, "http/q-zero"), 2):
        first = call.operation.formats[0] if call.operation.formats else "application/json"
        others = [name for name in call.operation.formats if name != first]
        refused = [f"{first};q=0", f"{first};q=0.000, */*", f"{first} ; q=0"]
        refused += [f"{name};q=0, {first};q=0, */*;q=0.5" for name in others[:1]]
        refused += [*(f"{name};q=0" for name in others), "*/*;q=0"]
        for accept in api.run.effort.draw(refused, 20, f"{api.run.seed}/{call.operation.id}"):
            exchange = call.send(api, ("Accept", accept))
            answer = exchange.response
            sent = answer.media_type if answer.ok else ""
            expected = f"another format or status 406 when Accept is {accept}"
            expect(judge, "http/q-zero", exchange).that(not sent or quality(sent, accept) > 0, expected, cause=sent)


@pytest.mark.requirement("http/accept-parameters")
def test_charset_in_accept(api: RestInterface, judge: Judge) -> None:
    """Send a charset parameter in Accept, as many clients do."""
    cases = [(call, media_type) for call in working_reads(api) for media_type in call.operation.formats]
    for call, media_type in api.run.effort.draw(cases, 20, f"{api.run.seed}/accept charset"):
        if call.send(api, ("Accept", media_type)).response.media_type != media_type:
            continue
        exchange = call.send(api, ("Accept", f"{media_type}; charset=utf-8"))
        taken = exchange.response.ok and exchange.response.media_type == media_type
        expected = f"status 200 with {media_type} when Accept is {media_type}; charset=utf-8"
        expect(judge, "http/accept-parameters", exchange).that(taken, expected)


# Accept-Encoding as clients send it, and as they exclude codings; after every other one the content is read without.
_CODINGS = ("gzip, br", "deflate", "identity;q=0, gzip", "gzip;q=0", "*;q=0, identity", "identity", "br", "*")
_CHOICE = 24  # resources that are read once, to compare their sizes
_LARGE = 4  # the largest of them are tested, and the smallest


@pytest.mark.requirement("http/content-coding", "http/accept-encoding")
def test_content_codings(api: RestInterface) -> None:
    """Read large contents and a small one with and without codings; checkers judge these responses, like all others."""
    found = [call for call in reads(api, _CHOICE) if call.operation.label not in api.slow]
    ranked = sorted(found, key=lambda call: len(call.send(api).response.body), reverse=True)
    for call in api.run.effort.subsample([*ranked[:_LARGE], *ranked[_LARGE:][-1:]], 2):
        for number, coding in enumerate(_CODINGS):
            if number % 2 == 0:
                call.send(api)
            call.send(api, ("Accept-Encoding", coding))
        call.send(api)
    api.send(Outgoing("GET", f"{api.path.rstrip('/')}/roaas-is-not-there", (("Accept-Encoding", "gzip"),)))


_PRECONDITIONS = "http/preconditions"
_RANGE = "http/range"
# An entity tag that no response has; a date before every response.
_NO_TAG = '"roaas-nothing-has-this-tag"'
_LONG_AGO = "Sat, 29 Oct 1994 19:43:31 GMT"
# Reads at standard effort.
_STANDARD = 10


@pytest.mark.requirement(_PRECONDITIONS, "http/entity-tag")
def test_what_a_cache_asks(api: RestInterface) -> None:
    """Send conditions of a client without a current copy."""
    for call in api.run.effort.draw(working_reads(api, _PRECONDITIONS), _STANDARD, f"{api.run.seed}/preconditions"):
        exchange = call.send(api, ("If-None-Match", _NO_TAG))
        if exchange.response.header("last-modified") is None:
            call.send(api, ("If-Modified-Since", _LONG_AGO))


@pytest.mark.requirement(_RANGE)
def test_a_part(api: RestInterface) -> None:
    """Send a range request to each resource."""
    for call in api.run.effort.draw(working_reads(api, _RANGE), _STANDARD, f"{api.run.seed}/range")[:_STANDARD]:
        call.send(api, ("Range", "bytes=0-3"))
