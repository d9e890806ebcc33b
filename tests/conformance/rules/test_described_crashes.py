"""A device that crashes or shows its insides now and then: whichever request meets it, it is a finding."""

import itertools
import json

import pytest
from small_device import contract_of
from toy_server import serving

from conformance.checkers.rest import RestCheckers
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import CheckerListener, Judge
from conformance.verdict.run import Run

_DOCUMENT = {
    "openapi": "3.1.0",
    "info": {"title": "Door", "version": "1"},
    "paths": {"/door": {"get": {"responses": {"200": {"description": "done"}}}}},
}


@pytest.mark.parametrize(
    ("status", "path", "found"),
    [(500, "/door", 1), (502, "/door?a=1", 1), (504, "/door", 1), (503, "/door", 0), (200, "/door", 0), (500, "/x", 0)],
)
def test_a_crash_that_any_check_meets_is_one_finding(tmp_path, status, path, found):
    turns = itertools.count(1)
    contract = contract_of(tmp_path, _DOCUMENT)
    with serving(lambda *_: (status if next(turns) % 3 == 0 else 200, {})) as url:
        run = Run(statement=Statement(endpoints=Endpoints(rest=url)), contract=contract)
        client = HttpClient(url, Connection())
        client.connection.listeners.append(CheckerListener(run.judge, [RestCheckers(contract, url)]))
        for _ in range(9):
            client.send("GET", path)
        client.close()
    evidence = run.judge.evidence["robustness/no-server-error"]
    assert [finding.seen for finding in evidence.findings.values()] == [3] * found


@pytest.mark.parametrize(
    ("details", "found"), [(["no key 1", "no key 2"], 1), (["no key", "no value"], 2), (["no key", "no key"], 1)]
)
def test_crashes_that_differ_in_more_than_a_number_are_findings_of_their_own(tmp_path, details, found):
    judge = _judged(tmp_path, [(500, {"detail": detail}) for detail in details])
    assert len(judge.evidence["robustness/no-server-error"].findings) == found


@pytest.mark.parametrize(
    ("status", "body", "found"),
    [
        (404, {"detail": "/usr/lib/python3/robot.py"}, 1),
        (500, "Traceback (most recent call last)", 1),
        (200, "/usr/lib/python3/robot.py", 0),
        (404, {"detail": "no door"}, 0),
    ],
)
def test_an_error_that_shows_insides_is_a_finding(tmp_path, status, body, found):
    assert len(_judged(tmp_path, [(status, body)]).evidence["robustness/no-internals"].findings) == found


def _judged(folder, answers):
    """Return a judge of responses to GET /door."""
    contract = contract_of(folder, _DOCUMENT)
    judge, checkers = Judge(contract.ledger), RestCheckers(contract, "http://door")
    for status, body in answers:
        response = Response(status, (("Content-Type", "application/json"),), json.dumps(body).encode(), 1.0)
        for case in checkers(Exchange(Request("GET", "http://door/door"), response)):
            judge.record(case)
    return judge
