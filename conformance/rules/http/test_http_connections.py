"""One connection and many requests on it, one after another."""

from contextlib import closing

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import reads
from conformance.api.rest.interface import RestInterface
from conformance.transport.client import HttpClient
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("silence"), pytest.mark.needs("rest")]
# More than servers used to allow on one connection before they close it.
_MANY = 120


@pytest.mark.requirement("http/many-requests")
def test_many_requests_on_one_connection(api: RestInterface, rest: HttpClient, judge: Judge, effort: Effort) -> None:
    """Send many requests on one connection: each gets the status that it gets on a connection of its own.

    The client opens a new connection where the robot has closed one: it may close one at any time (RFC 9112 9.5), but
    not drop the requests on it again and again.
    """
    judge.at_risk = ("http/many-requests",)
    calls = [call for call in reads(api) if not call.operation.optional]
    usual = {call.path: call.send(api, fresh=True).response.status for call in calls}
    with closing(HttpClient(rest.base_url, rest.connection)) as client:
        for turn in range(effort.cases(_MANY) if effort.slow else _MANY):
            path = calls[turn % len(calls)].path
            exchange = client.send("GET", path)
            status = exchange.response.status
            if status != usual[path]:
                # The robot's state may have changed (a resource is gone, the load is high): that is no fault here.
                usual[path] = client.send("GET", path, fresh=True).response.status
            when = f"it is request {turn + 1} on one connection"
            expect(judge, "http/many-requests", exchange).status(usual[path], when=when)
