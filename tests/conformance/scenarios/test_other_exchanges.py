"""What is kept of the exchanges of checks that no scenario records."""

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.contract.described import write_described_pack
from conformance.contract.pack import Contract
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
    run = Run(contract=Contract.load(write_described_pack(tmp_path, _DESCRIPTION, _DESCRIPTION)))
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
        kept.answered(exchange)
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
    kept.answered(_exchange(418, **odd))
    assert kept.probes == []


def test_what_a_scenario_records_or_no_survey_saw_working_is_not_kept(api, kept):
    api.is_recorded = True
    kept.answered(_exchange(418))
    api.is_recorded = False
    api.working.clear()
    kept.answered(_exchange(418))
    assert kept.probes == []


@pytest.mark.parametrize(("kind", "number"), [(NoAnswer.CLOSED, 1), (NoAnswer.REFUSED, 0), (NoAnswer.TIMEOUT, 0)])
def test_a_closed_connection_is_kept(kept, kind, number):
    kept.unanswered(Unanswered(_exchange().request, "nothing came", kind))
    assert len(kept.probes) == number


def test_without_exchanges_there_is_nothing_to_judge_and_nothing_is_lost(api, kept):
    with pytest.raises(NoOccasionError, match="no other check"):
        others.play(api, kept)


def test_a_device_that_never_answered_2xx_is_not_judged(api, kept):
    api.working.clear()
    with pytest.raises(NotPossibleError, match="credentials"):
        others.play(api, kept)
