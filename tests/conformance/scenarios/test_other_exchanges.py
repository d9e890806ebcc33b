"""What is kept of the exchanges of checks that no scenario records."""

import pytest
from aiohttp import web
from driven_device import driven
from small_device import REFUSED, answers, contract_of, described, error, reading

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.operation_log import OperationLog
from conformance.scenarios.other_exchanges import OtherExchanges, others
from conformance.scenarios.scenario import NoOccasionError, NotPossibleError
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, NoAnswer, Request, Response, Unanswered
from conformance.verdict.run import Run

_LEVEL = {"name": "level", "in": "query", "required": True, "schema": {"type": "integer", "minimum": 0}}
_KEY = {"name": "X-Key", "in": "header", "required": True, "schema": {"type": "string"}}
_OK = {"200": {"description": "it"}}
_DESCRIPTION = {
    "openapi": "3.1.0",
    "info": {"title": "Lamp", "version": "1"},
    "paths": {
        "/lamp": {"get": {"parameters": [_LEVEL], "responses": _OK}},
        "/key": {"get": {"parameters": [_KEY], "responses": _OK}},
    },
}


@pytest.fixture
def api(tmp_path):
    run = Run(contract=contract_of(tmp_path, _DESCRIPTION))
    api = RestInterface(run, HttpClient("http://h", Connection()))
    api.working.update(dict.fromkeys(("GET /lamp", "GET /key")))
    return api


@pytest.fixture
def kept(api):
    return OtherExchanges(api)


def _exchange(status=200, body=b"1", target="/lamp?level=1", fields=()):
    request = Request("GET", f"http://h{target}", (("Host", "h"), *fields))
    return Exchange(request, Response(status, (("Content-Type", "application/json"),), body, 1.0))


def test_different_responses_to_valid_requests_are_kept_once(api, kept):
    for exchange in (_exchange(), _exchange(), _exchange(418), _exchange(body=b"null"), _exchange(418)):
        kept.on_response(exchange)
    assert [(one.operation, one.status) for one in others.play(api, kept).probes] == [
        ("GET /lamp", s) for s in (200, 418, 200)
    ]


@pytest.mark.parametrize(
    "odd",
    [
        {"target": "/lamp"},
        {"target": "/lamp?level=-1"},
        {"target": "/elsewhere"},
        {"target": "/key"},
        {"fields": (("Accept", "image/png"),)},
        {"fields": (("Range", "bytes=0-0"),)},
        {"fields": (("Transfer-Encoding", "chunked"),)},
    ],
)
def test_a_request_that_may_be_refused_is_not_kept(kept, odd):
    kept.on_response(_exchange(418, **odd))
    assert kept.probes == []


def test_what_a_scenario_records_or_no_survey_saw_working_is_not_kept(api, kept):
    api.is_recorded = True
    kept.on_response(_exchange(418))
    api.is_recorded = False
    api.working.clear()
    kept.on_response(_exchange(418))
    assert kept.probes == []


@pytest.mark.parametrize(("kind", "number"), [(NoAnswer.CLOSED, 1), (NoAnswer.REFUSED, 0), (NoAnswer.TIMEOUT, 0)])
def test_a_closed_connection_is_kept(kept, kind, number):
    kept.on_no_response(Unanswered(_exchange().request, "nothing came", kind))
    assert len(kept.probes) == number


def test_without_exchanges_there_is_nothing_to_judge_and_nothing_is_lost(api, kept):
    with pytest.raises(NoOccasionError, match="no other check"):
        others.play(api, kept)


def test_a_device_that_never_answered_2xx_is_not_judged(api, kept):
    api.working.clear()
    with pytest.raises(NotPossibleError, match="credentials"):
        others.play(api, kept)


_STATE = {"type": "string", "enum": ["idle", "busy", "off"]}
_TUBE = {"type": "object", "properties": {"id": {"type": "integer"}, "state": _STATE}}
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "integer"}}


class _Tubes:
    """A device with tubes, which loses the second one, and whose busy ones DELETE leaves there, if it is broken."""

    def __init__(self, *, broken):
        self.there, self.broken, self.made, self.sent = {}, broken, 0, []

    def served(self):
        created, gone = {"201": answers(_TUBE)}, {"204": {"description": "gone"}, "4XX": REFUSED}
        item = {**reading(_TUBE, parameters=[_ID]), "delete": {"parameters": [_ID], "responses": gone}}
        document = described({"/tubes": {"post": {"responses": created}}, "/tubes/{id}": item})
        routes = {"/tubes": {"POST": self.post}, "/tubes/{id}": {"GET": self.get, "DELETE": self.delete}}
        return document, routes

    async def post(self, _):
        self.made += 1
        tube = {"id": self.made, "state": _STATE["enum"][self.made % 3]}
        if not (self.broken and self.made == 2):
            self.there[self.made] = tube
        return web.json_response(tube, status=201, headers={"Location": f"/tubes/{self.made}"})

    def _of(self, request):
        self.sent.append(f"{request.method} {request.path}")
        return self.there.get(int(request.match_info["id"]))

    async def get(self, request):
        tube = self._of(request)
        return web.json_response(tube) if tube else error(404, "no such tube")

    async def delete(self, request):
        tube = self._of(request)
        if not (self.broken and tube["state"] == "busy"):
            del self.there[tube["id"]]
        return web.Response(status=204)


@pytest.mark.parametrize("broken", [False, True])
def test_what_is_missing_or_there_again_is_read_once_more_after_a_wait(tmp_path, broken):
    tubes = _Tubes(broken=broken)
    document, routes = tubes.served()
    with driven(document, routes, tmp_path) as (api, _, _):
        api.client.connection.listeners.append(kept := OtherExchanges(api))
        api.working.update(dict.fromkeys(("POST /tubes", "GET /tubes/{id}")))
        for _ in range(7):
            api.client.send("POST", "/tubes")
        others.play(api, kept)
    deleted = [int(one.rpartition("/")[2]) for one in tubes.sent if one.startswith("DELETE")]
    assert {number % 3 for number in deleted} == {0, 1, 2}, "a thing in each state"
    assert len(deleted) == 3
    again = {one for one in tubes.sent if one.startswith("GET") and tubes.sent.count(one) > 2}
    busy = {f"GET /tubes/{number}" for number in deleted if number % 3 == 1}
    assert again == (busy if broken else set())
    assert tubes.sent.count("GET /tubes/2") == (2 if broken or 2 in deleted else 1)


def test_what_a_run_created_is_deleted_at_its_end_the_newest_first(tmp_path):
    tubes = _Tubes(broken=False)
    document, routes = tubes.served()
    with driven(document, routes, tmp_path) as (api, _, _):
        log = OperationLog(api.run.contract, api.client.base_url)
        api.client.connection.listeners.append(log)
        for _ in range(3):
            api.client.send("POST", "/tubes")
        assert not log.tidy_up(api, 10), "nothing was changed"
    assert tubes.sent == ["DELETE /tubes/3", "DELETE /tubes/2", "DELETE /tubes/1"]
    assert tubes.there == {}
