"""Authentication: a robot that asks for a token says so where it is missing (RFC 9110 11.6.1)."""

import pytest

from conformance.rest.applicable import reads
from conformance.rest.interface import RestInterface
from conformance.rest.statuses import judge_status
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("reading"), pytest.mark.needs("rest")]


@pytest.mark.requirement("http/authentication")
def test_requests_without_a_token(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """With a token in the run, every resource asks for it; without one, none does."""
    asked = bool(api.client.connection.token)
    for call in reads(api):
        exchanges = [rest.send("GET", call.path, authorized=False)]
        if asked:
            exchanges.append(rest.send("GET", call.path, headers=[("Authorization", "Bearer roaas-not-this-one")]))
        for exchange in exchanges:
            _judge(judge, exchange, asked=asked)


def _judge(judge: Judge, exchange: Exchange, *, asked: bool) -> None:
    status = exchange.response.status
    challenge = exchange.response.header("www-authenticate")
    if status == 401:
        judge.check(
            "http/authentication", bool(challenge), exchange, "WWW-Authenticate with 401", found="no WWW-Authenticate"
        )
    else:
        judge_status(judge, "http/authentication", not asked, exchange, "401 where the token is missing or wrong")
