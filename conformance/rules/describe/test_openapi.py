"""/openapi.json: served, valid, complete, and true (contract, describe)."""

from functools import lru_cache
from typing import Any

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.calls import example_call
from conformance.api.rest.description import Described, KeptExchanges, contradiction, described_by_openapi, differences
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.presence import judge_there
from conformance.documents.description_faults import openapi_fault
from conformance.documents.json_text import read_json
from conformance.documents.openapi import operations_of
from conformance.rules.told_once import without_numbers
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
_PATH = "/openapi.json"
_BEHAVIOUR = "describe/openapi-behaviour"


def _document(rest: HttpClient) -> tuple[Any, Exchange, str]:
    """Return the description served by the robot, the exchange that fetched it, and what is wrong with it."""
    exchange = rest.send("GET", _PATH, headers=[("Accept", "application/json")])
    answer = exchange.response
    if answer.status != 200:
        return None, exchange, exchange.came
    if "json" not in answer.media_type:
        return None, exchange, "another media type than JSON"
    value, fault = _read(answer.body)
    return value, exchange, fault


@lru_cache(maxsize=2)
def _read(body: bytes) -> tuple[Any, str]:
    """Parse a description and return it with its faults; cached, as three checks read the same one."""
    text = read_json(body)
    return text.value, text.problem or openapi_fault(text.value)


@pytest.mark.requirement("describe/openapi")
def test_openapi_is_served(rest: HttpClient, judge: Judge) -> None:
    """GET the description: the robot must serve it as JSON that is valid by the OpenAPI schema of its version."""
    _, exchange, fault = _document(rest)
    expect(judge, "describe/openapi", exchange).that(not fault, "status 200 with a valid OpenAPI 3 description", fault)


@pytest.mark.requirement("describe/openapi-operations")
def test_openapi_has_the_operations(api: RestInterface, rest: HttpClient, judge: Judge) -> None:
    """Compare the description's paths, methods and parameters with the contract's; it may have more."""
    document, exchange, fault = _document(rest)
    found = [] if document is None else described_by_openapi(document, rest.base_url)
    missing = [fault] if document is None else differences(operations_of(api.run.contract), found)
    expected = "a description with the paths, methods and parameters of the contract"
    expect(judge, "describe/openapi-operations", exchange).that(not missing, expected, "; ".join(missing[:3]))


@pytest.mark.phase("last")
@pytest.mark.requirement("describe/openapi-answers")
def test_what_is_described_is_true(api: RestInterface, rest: HttpClient, kept_exchanges: KeptExchanges | None) -> None:
    """Compare requests that the robot accepted in this run, and its responses, with its own description."""
    document, _, _ = _document(rest)
    found = [] if document is None else described_by_openapi(document, rest.base_url)
    theirs = {item.address: item for item in found}
    for kept in kept_exchanges.kept.values() if kept_exchanges else ():
        for context, exchange in kept:
            operation = context.operation
            described = theirs.get(Described(operation, operation.template).address) if operation else None
            if operation is None or described is None:
                continue
            wrong = contradiction(api, described, context, exchange)
            expected = f"what {_PATH} says of {operation.label}"
            cause = f"{operation.label} {without_numbers(wrong)}"
            expect(api.run.judge, "describe/openapi-answers", exchange).that(not wrong, expected, wrong, cause=cause)


@pytest.mark.requirement(_BEHAVIOUR)
def test_what_is_described_is_there(api: RestInterface, rest: HttpClient) -> None:
    """Send a request for each operation of the description and of the contract: it does not get 404 or 405."""
    for operation in operations_of(api.run.contract):
        if not operation.optional:
            judge_there(api, _BEHAVIOUR, example_call(api, operation))
    document, _, _ = _document(rest)
    found = [] if document is None else described_by_openapi(document, rest.base_url)
    # A robot may serve the contract's own description, although it lacks an optional extension in it.
    known = {Described(item, item.template).address for item in operations_of(api.run.contract)}
    for item in found:
        if item.address not in known and item.path == item.operation.template:
            judge_there(api, _BEHAVIOUR, example_call(api, item.operation), known=False)
