"""Authentication: a robot that requires a token says so where the token is missing (RFC 9110 11.6.1)."""

from http import HTTPStatus

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import reads
from conformance.api.rest.interface import RestInterface
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("reading"), pytest.mark.needs("rest")]
_REFUSED = frozenset({HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN, HTTPStatus.BAD_REQUEST, HTTPStatus.NOT_FOUND})


@pytest.mark.requirement("http/authentication", "http/authentication-asked")
def test_requests_without_a_token(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Judge the refusal of reads without the token, or with another one; a read that is open to everybody passes."""
    has_token = bool(api.client.connection.token)
    if not has_token:
        for id_ in ("http/authentication", "http/authentication-asked"):
            judge.unclaimed(id_, "the run has no token, and the robot requires none")
    for call in reads(api):
        usual = call.send(api).response.status
        _judge(judge, rest.send("GET", call.path, authorized=False), usual)
        if has_token:
            wrong = [("Authorization", "Bearer roaas-not-this-one")]
            _judge(judge, rest.send("GET", call.path, headers=wrong), usual)


def _judge(judge: Judge, exchange: Exchange, usual: int) -> None:
    status = exchange.response.status
    if status == HTTPStatus.UNAUTHORIZED:
        expect(judge, "http/authentication", exchange).header("WWW-Authenticate")
    if status in _REFUSED and status != usual:
        expect(judge, "http/authentication-asked", exchange).status(401, when="the token is missing or wrong")
