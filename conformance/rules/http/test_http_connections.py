"""One connection and many requests on it, one after another."""

from contextlib import closing

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import reads
from conformance.api.rest.interface import RestInterface
from conformance.transport.client import HttpClient
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
# More than servers used to allow on one connection before they close it.
_MANY = 120
# So many requests that were dropped are the robot's habit, and not the end of an idle connection.
_DROPS = 3


@pytest.mark.requirement("http/many-requests")
def test_many_requests_on_one_connection(api: RestInterface, rest: HttpClient, judge: Judge, effort: Effort) -> None:
    """Send many requests on one connection: each gets the status that it gets on a connection of its own.

    The robot may close a connection at any time (RFC 9112 9.5), and the client then sends the request again on a new
    one. A robot that does so again and again on a busy connection drops requests.
    """
    judge.at_risk = ("http/many-requests",)
    calls = [call for call in reads(api) if not call.operation.optional]
    resent = rest.connection.resent
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
            dropped = rest.connection.resent - resent
            expect(judge, "http/many-requests", exchange).that(
                dropped < _DROPS,
                f"a response to each of {turn + 1} requests that follow each other at once",
                f"a connection that the server closed {dropped} times without a response to a request on it",
                cause="dropped",
            )
            if dropped >= _DROPS:
                return
