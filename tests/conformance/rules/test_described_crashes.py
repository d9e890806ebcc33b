"""A described device that crashes now and then: whichever request meets it, it is a finding."""

import itertools

import pytest
from toy_server import serving

from conformance.api.rest.habits import Habits
from conformance.api.rest.interface import RestInterface
from conformance.contract.described import write_described_pack
from conformance.contract.pack import Contract
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.observers import Observers
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
    contract = Contract.load(write_described_pack(tmp_path, _DOCUMENT, _DOCUMENT))
    with serving(lambda *_: (status if next(turns) % 3 == 0 else 200, {})) as url:
        run = Run(statement=Statement(endpoints=Endpoints(rest=url)), contract=contract)
        client = HttpClient(url, Connection())
        client.connection.listeners.append(Observers(run.judge, [Habits(RestInterface(run, client))]))
        for _ in range(9):
            client.send("GET", path)
        client.close()
    evidence = run.judge.evidence["robustness/no-server-error"]
    assert [finding.seen for finding in evidence.findings.values()] == [3] * found
