"""Problem documents: an error response names the field or parameter that is wrong (RFC 9457 3.1.4)."""

from functools import partial

import pytest

from conformance.api.rest.applicable import reads, usable_operations
from conformance.api.rest.calls import JSON, example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.json_mutations import mutations
from conformance.api.rest.refusals import judge_refusal
from conformance.documents.json_schema import is_numeric
from conformance.documents.openapi import operations_of
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
_IDS = (
    "http/problem-detail",
    "http/problem-value",
    "http/problem-type",
    "http/problem-status",
    "http/no-traceback",
    "http/no-server-error",
)
_TEXT = "roaas-no-number"


@pytest.mark.phase("reading")
@pytest.mark.requirement(*_IDS, "rest-formats/problem-xml", "strict-input/query-parameter")
def test_problem_of_a_query(api: RestInterface, judge: Judge) -> None:
    """Send text for a number in a query: the problem names the parameter and the text."""
    tried = 0
    for call in reads(api):
        for item in call.operation.parameter("query"):
            if not is_numeric(item.schema):
                continue
            tried += 1
            wrong = call.having(item.name, _TEXT)
            judge_refusal(
                api,
                partial(wrong.send, api),
                "strict-input/query-parameter",
                f"text at {item.name}",
                field=item.name,
                shown=_TEXT,
                json=False,
            )
            wrong.send(api, ("Accept", "application/xml"))
    if not tried and not any(JSON in operation.bodies for operation in operations_of(api.run.contract)):
        for id_ in _IDS[:2]:
            judge.unclaimed(id_, "the contract has no input in which a field could be wrong")


@pytest.mark.phase("input")
@pytest.mark.requirement(*_IDS, "rest-formats/problem-xml", "strict-input/json-missing", "strict-input/json-type")
def test_problem_of_a_body(api: RestInterface) -> None:
    """Send bodies with a field that is missing or of another type: the problem names it."""
    api.device.halt(api)
    for operation in usable_operations(api, lambda item: JSON in item.bodies):
        call = example_call(api, operation)
        made = [
            item
            for item in mutations(call.value, operation.bodies[JSON].schema)
            if item.kind in {"missing", "type"} and (item.shown or "missing" in item.what)
        ]
        for item in api.run.effort.alternatives(made[:: max(1, len(made) // 6)], 2):
            judge_refusal(
                api,
                partial(call.carrying(item.made).send, api),
                f"strict-input/json-{item.kind}",
                item.what,
                field=item.field,
                shown=item.shown,
                malformed=item.malformed,
            )
        for item in made[:1]:
            # The observers judge the format of the refusal.
            call.carrying(item.made).send(api, ("Accept", "application/xml"))
    api.device.halt(api)
