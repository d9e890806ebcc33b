"""Authentication: a robot that asks for a token says so where it is missing (RFC 9110 11.6.1)."""

from http import HTTPStatus

import pytest

from conformance.api.rest.applicable import reads
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import judge_status
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("reading"), pytest.mark.needs("rest")]
_REFUSED = frozenset({HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN, HTTPStatus.BAD_REQUEST, HTTPStatus.NOT_FOUND})


@pytest.mark.requirement("http/authentication", "http/authentication-asked")
def test_requests_without_a_token(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """A read without the token, or with another one, is refused with 401; or answered, being for all to see."""
    asked = bool(api.client.connection.token)
    if not asked:
        for id_ in ("http/authentication", "http/authentication-asked"):
            judge.unclaimed(id_, "the robot is asked without a token, and asks for none")
    for call in reads(api):
        usual = call.send(api).response.status
        exchanges = [rest.send("GET", call.path, authorized=False)]
        if asked:
            exchanges.append(rest.send("GET", call.path, headers=[("Authorization", "Bearer roaas-not-this-one")]))
        for exchange in exchanges:
            _judge(judge, exchange, usual)


def _judge(judge: Judge, exchange: Exchange, usual: int) -> None:
    status = exchange.response.status
    if status == HTTPStatus.UNAUTHORIZED:
        challenge = exchange.response.header("www-authenticate")
        judge.check(
            "http/authentication", bool(challenge), exchange, "WWW-Authenticate with 401", found="no WWW-Authenticate"
        )
    if status in _REFUSED and status != usual:
        judge_status(
            judge,
            "http/authentication-asked",
            status == HTTPStatus.UNAUTHORIZED,
            exchange,
            "401 where the token is missing or wrong",
        )
