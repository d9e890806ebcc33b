"""A device whose own deadline is that of the run tells so by a response; one that hangs tells nothing."""

import threading
from contextlib import closing

import pytest
from small_device import contract_of
from toy_server import serving

from conformance.api.rest.inputs import usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Kind, Variation
from conformance.documents.openapi import operations_of
from conformance.rules.robustness.test_robustness import no_hang
from conformance.scenarios.survey import Surveyor
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.run import Run

_DEADLINE_S = 4.0
_DESCRIPTION = {
    "openapi": "3.1.0",
    "info": {"title": "Mission", "version": "1"},
    "paths": {"/mission": {"get": {"responses": {"408": {"description": "not in time"}}}}},
}


@pytest.mark.parametrize(("waits_s", "hangs"), [(1.02 * _DEADLINE_S, False), (60.0, True)])
def test_a_response_just_after_the_deadline_is_no_hang(tmp_path, waits_s, hangs):
    over = threading.Event()

    def answer(*_):
        over.wait(waits_s)
        return 408, {}

    contract = contract_of(tmp_path, _DESCRIPTION)
    with serving(answer) as url, closing(HttpClient(url, Connection(timeout_s=_DEADLINE_S))) as client:
        run = Run(statement=Statement(endpoints=Endpoints(rest=url)), contract=contract)
        surveyor = Surveyor(RestInterface(run, client, alive=lambda: True), Values({}, ()))
        (operation,) = operations_of(contract)
        surveyor.send(operation, Variation(Kind.USUAL, "", "", usual_inputs(operation, surveyor.values)[0]))
        over.set()
    assert [case.holds for case in no_hang.judge(surveyor.trace)] == [not hangs]
