"""The rules on the responses of a described API."""

from types import SimpleNamespace

import pytest
from small_device import contract_of

from conformance.api.rest.variations import Kind
from conformance.rules.description.test_answers import status_declared
from conformance.scenarios.survey import Probe, Survey
from conformance.transport.exchange import Exchange, Request, Response

_DESCRIPTION = {
    "openapi": "3.1.0",
    "info": {"title": "Lamp", "version": "1"},
    "paths": {"/lamp": {"get": {"responses": {"200": {"description": "it"}}}}},
}


@pytest.mark.parametrize(
    ("status", "field", "expected"),
    [(304, "If-None-Match", []), (304, "Accept", [False]), (206, "Range", []), (206, "Accept", [False])],
)
def test_a_part_or_a_304_needs_no_declaration_only_where_it_was_asked_for(tmp_path, status, field, expected):
    """Judge statuses that HTTP has for conditional requests alone (RFC 9110 13, 14)."""
    run = SimpleNamespace(contract=contract_of(tmp_path, _DESCRIPTION))
    request = Request("GET", "http://127.0.0.1:1/lamp", ((field, "x"),), b"")
    exchange = Exchange(request, Response(status, (), b"", 1.0))
    trace = Survey((Probe("GET /lamp", Kind.USUAL, exchange=exchange),))
    assert [case.holds for case in status_declared.judge(trace, run)] == expected
