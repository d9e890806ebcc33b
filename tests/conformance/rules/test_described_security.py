"""What requires credentials by the description: what is sent, and how the responses are judged."""

import pytest
from toy_messages import exchange
from toy_server import serving

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.contract.described import write_described_pack
from conformance.contract.pack import Contract
from conformance.rules.description.test_answers import security
from conformance.scenarios.anonymous import anonymous_requests
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Calls, Statement
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.run import Run

_ANSWERS = {"responses": {"200": {"description": "done"}}}
_DOCUMENT = {
    "openapi": "3.1.0",
    "info": {"title": "Gate", "version": "1"},
    "components": {"securitySchemes": {"key": {"type": "http", "scheme": "bearer"}}},
    "security": [{"key": []}],
    "paths": {
        "/closed": {"get": _ANSWERS, "post": _ANSWERS},
        "/open": {"get": {**_ANSWERS, "security": []}},
        "/either": {"get": {**_ANSWERS, "security": [{"key": []}, {}]}},
    },
}


@pytest.mark.parametrize(("allow", "methods"), [((), ["GET"]), (("/closed",), ["GET", "POST"])])
def test_what_requires_credentials_is_sent_without_them_and_with_wrong_ones(tmp_path, allow, methods):
    seen = []

    def answer(method, path, _content):
        seen.append((method, path))
        return 401, None

    contract = Contract.load(write_described_pack(tmp_path, _DOCUMENT, _DOCUMENT))
    with serving(answer) as url:
        statement = Statement(endpoints=Endpoints(rest=url), calls=Calls(allow=allow))
        run = Run(statement=statement, contract=contract)
        client = HttpClient(url, Connection(token="roaas"))  # noqa: S106 - no secret
        trace = anonymous_requests.play(RestInterface(run, client), Values())
        client.close()
    # After wrong credentials come right ones, so that the device does not count the wrong ones.
    assert seen == [(one, "/closed") for method in methods for one in (method, method, "GET")]
    sent = [dict(one.request.headers).get("Authorization") for one in trace]
    assert sent[::2] == [None] * len(methods)
    assert "$ROAAS_TOKEN" not in sent


@pytest.mark.parametrize(("status", "holds"), [(401, True), (403, True), (404, True), (200, False), (204, False)])
def test_a_request_without_valid_credentials_must_be_refused(status, holds):
    (case,) = security.outcomes((exchange(status),), {}.__getitem__)
    assert case.holds is holds
