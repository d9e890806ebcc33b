"""Authentication: a robot that requires a token responds so if it is missing (RFC 9110 11.6.1)."""

from contextlib import closing
from dataclasses import replace
from http import HTTPStatus

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import applicable_operations, reads
from conformance.api.rest.calls import Call, example_call
from conformance.api.rest.effects import differs_from, reader_of, takes_effect
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.stranger import Stranger
from conformance.documents.openapi import operations_of
from conformance.documents.security import is_http_authentication
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.needs("rest")]
_WRITES = "http/authentication-writes"
_REFUSED = frozenset({HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN, HTTPStatus.BAD_REQUEST, HTTPStatus.NOT_FOUND})


# Wrong credentials come last: a device may shut out who sends several.
@pytest.mark.phase("last")
@pytest.mark.requirement("http/authentication", "http/authentication-asked")
def test_requests_without_a_token(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Judge the refusal of reads without the token, or with another one; a checker judges the fields of each 401."""
    connection = api.client.connection
    has_token = bool(connection.credentials)
    if not has_token:
        for id_ in ("http/authentication", "http/authentication-asked"):
            judge.note_unclaimed(id_, "the run has no token, and the robot requires none")
    for call in reads(api):
        usual = call.send(api).response.status
        asking = _asking(api, call)
        _judge(judge, rest.send("GET", call.path, authorized=False), usual, asking)
        if has_token:
            with closing(Stranger(api)) as unknown:
                exchange = unknown.send("GET", call.path)
            if exchange is not None:
                _judge(judge, exchange, usual, asking)


@pytest.mark.phase("input")
@pytest.mark.requirement(_WRITES)
def test_writes_without_credentials(api: RestInterface, judge: Judge) -> None:
    """Send each operation that acts without credentials and with wrong ones: status 401, and no effect."""
    connection = api.client.connection
    if not connection.credentials:
        judge.note_unclaimed(_WRITES, "the run has no credentials")
        return
    stranger = replace(connection, token=None, credentials=connection.credentials.wrong, is_patient=False)
    with closing(HttpClient(api.client.base_url, stranger)) as unknown:
        for operation in applicable_operations(api, [_WRITES], lambda item: not item.safe, "acts"):
            _judge_write(api, judge, unknown, example_call(api, operation))
    api.device.bring_to_rest(api)


def _judge_write(api: RestInterface, judge: Judge, unknown: HttpClient, call: Call) -> None:
    """Send one request without and with wrong credentials, and look whether it takes effect."""
    api.device.bring_to_rest(api)
    cancelled = call.operation.method == "DELETE"
    if cancelled:
        _put_there(api, call)
    before = _get_status(api, call)
    was_so = differs_from(api, call) == ""
    fields = [("Content-Type", call.media_type)] if call.media_type else []
    for what, client, authorized in (("missing", api.client, False), ("wrong", unknown, True)):
        exchange = client.send(
            call.operation.method, call.path, headers=fields, body=call.body, authorized=authorized, fresh=True
        )
        expect(judge, _WRITES, exchange).status(401, when=f"the credentials are {what}", cause=f"{call.operation.id}")
    gone = cancelled and before == HTTPStatus.OK and _get_status(api, call) == HTTPStatus.NOT_FOUND
    acted = gone or (not cancelled and not was_so and takes_effect(api, call))
    expect(judge, _WRITES, exchange).that(
        not acted,
        "no effect of a request without valid credentials",
        "its effect on the resource",
        cause=f"{call.operation.id} effect",
    )


def _put_there(api: RestInterface, call: Call) -> None:
    """Put something where a DELETE would remove it, with credentials."""
    for operation in operations_of(api.run.contract):
        if operation.method == "PUT" and operation.template == call.operation.template:
            example_call(api, operation).send(api)


def _get_status(api: RestInterface, call: Call) -> int:
    """Return the status of GET for the resource of a request; 0 where it has none."""
    reader = reader_of(api, call)
    return reader.send(api).response.status if reader is not None else 0


def _asking(api: RestInterface, call: Call) -> frozenset[int]:
    """Return the statuses that should have been 401 for HTTP's own credentials (RFC 9110 11.4).

    Unless its contract demands 401, a device may hide a resource (404, RFC 9110 15.5.4), may refuse as it declares, and
    refuses other credentials than those of HTTP, such as an API key, by whatever status fits.
    """
    contract = api.run.contract
    if contract.demands(_WRITES):
        return _REFUSED
    if not is_http_authentication(contract.openapi, call.operation):
        return frozenset()
    declared = {status for status in _REFUSED if str(status) in call.operation.responses}
    return _REFUSED - declared - {HTTPStatus.NOT_FOUND}


def _judge(judge: Judge, exchange: Exchange, usual: int, asking: frozenset[int]) -> None:
    status = exchange.response.status
    if (status == HTTPStatus.UNAUTHORIZED or status in asking) and status != usual:
        expect(judge, "http/authentication-asked", exchange).status(401, when="the token is missing or wrong")
