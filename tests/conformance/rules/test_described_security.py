"""What requires credentials by the description: what is sent, and how the responses are judged."""

from contextlib import closing

import pytest
from small_device import contract_of
from toy_messages import exchange
from toy_server import Handler, server_of, serving

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
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

    contract = contract_of(tmp_path, _DOCUMENT)
    with serving(answer) as url:
        statement = Statement(endpoints=Endpoints(rest=url), calls=Calls(allow=allow))
        run = Run(statement=statement, contract=contract)
        client = HttpClient(url, Connection(token="roaas"))  # noqa: S106 - no secret
        trace = anonymous_requests.play(RestInterface(run, client), Values())
        client.close()
    near = [
        "Bearer $ROAAS_TOKEN-roaas-not-this-one", *(f"Bearer $ROAAS_TOKEN_{how}" for how in ("SHORTENED", "ALTERED")),
        "Bearer $ROAAS_TOKEN_RECASED", "Bearer $ROAAS_TOKEN_EMPTIED", "Token $ROAAS_TOKEN",
    ]  # fmt: skip
    expected, headers = [], [None]
    for number, method in enumerate(methods):
        own = near[number :: len(methods)]  # each kind at least once, and several kinds for each of few operations
        # After wrong credentials come right ones, so that the device does not count the wrong ones.
        expected += [method, *["HEAD"] * (method == "GET"), *[method, "GET"] * (1 + len(own))]
        headers += [None, "Bearer roaas-not-this-one", *own]
    assert seen == [*((one, "/closed") for one in expected), ("GET", "/roaas-is-not-there")]
    assert [dict(one.request.headers).get("Authorization") for one in trace] == headers


_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "integer"}}
_BAYS = {
    **_DOCUMENT,
    "paths": {
        "/bays": {"post": {"responses": {"201": {"description": "made"}}}},
        "/bays/{id}": {"parameters": [_ID], "get": _ANSWERS, "delete": _ANSWERS},
        "/bays/{id}/light": {"parameters": [_ID], "post": _ANSWERS},
    },
}


class _Bays(Handler):
    """Looks whether there is a bay, and only then at the credentials; not for those in ``server.open``."""

    def answer(self):
        path, bays = self.path, self.server.bays
        known, authorized = self.headers.get("Authorization") == "Bearer roaas", True
        id_ = int(path.split("/")[2]) if path.count("/") > 1 else 0
        if not known and (self.command, path.count("/")) not in self.server.open:
            authorized = False
        if self.command == "POST" and not id_ and authorized:
            bays.append(len(bays) + 1)
            return self.send(self.server.created, b'{"id": %d}' % bays[-1])
        if id_ and id_ not in bays:
            return self.send(404, b"{}")
        if self.command == "DELETE" and authorized:
            bays[id_ - 1] = 0
        return self.send(200 if authorized else 401, b"{}")


@pytest.mark.parametrize("created", [201, 202])
@pytest.mark.parametrize("unguarded", [(), ("DELETE", 2), ("POST", 3)])
def test_a_thing_that_is_there_shows_whether_credentials_are_needed(tmp_path, unguarded, created):
    contract = contract_of(tmp_path, _BAYS)
    with server_of(_Bays, bays=[], open={unguarded}, created=created) as server:
        statement = Statement(endpoints=Endpoints(rest=server.url), calls=Calls(allow=("*",)))
        run = Run(statement=statement, contract=contract)
        with closing(HttpClient(server.url, Connection(token="roaas"))) as client:  # noqa: S106 - no secret
            trace = anonymous_requests.play(RestInterface(run, client), Values({}, frozenset({"bay"})))
    served = {one.request.method for one in trace if one.response.ok}
    assert served == set(unguarded[:1])
    # What was created for it is deleted, or was by whoever needs no credentials.
    assert set(server.bays) == {0}


@pytest.mark.parametrize(("status", "holds"), [(401, True), (403, True), (404, True), (200, False), (204, False)])
def test_a_request_without_valid_credentials_must_be_refused(status, holds):
    (case,) = security.outcomes((exchange(status),), {}.__getitem__)
    assert case.holds is holds
