"""Plain reads, and many of them: the observers judge each, so that one failure in fifty is noticed."""

import math

import pytest

from conformance.api.rest.applicable import reads
from conformance.api.rest.interface import RestInterface
from conformance.verdict.effort import Effort

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
# Reads of each resource at standard effort; and reads in all, at any effort, with a robot that is not slow.
_EACH = 60
_IN_ALL = 56


@pytest.mark.requirement(
    "http/declared-status",
    "http/declared-body",
    "http/content-type",
    "http/date",
    "http/date-format",
    "http/etag-format",
    "http/field-once",
    "http/framing",
    "http/json-finite",
    "http/json-encoding",
    "http/json-unique-names",
)
def test_each_resource_is_read_over_and_over(api: RestInterface, effort: Effort) -> None:
    """Send each GET operation in turn; the observers judge every response.

    The turns take a prime number of requests more than there are operations, so that a robot which fails with every
    n-th answer does not always fail with the same one.
    """
    calls = reads(api)
    rounds = effort.cases(_EACH)
    if calls and not api.run.effort.slow:
        rounds = max(rounds, math.ceil(_IN_ALL / len(calls)))
    for turn in range(rounds):
        for call in calls[turn % len(calls) :] + calls[: turn % len(calls)]:
            call.send(api, *((("Accept", "application/json"),) if turn % 2 else ()))
