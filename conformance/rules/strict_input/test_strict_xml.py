"""Robots that accept XML bodies must reject invalid ones."""

from functools import partial

import pytest

from conformance.api.rest.applicable import applicable_operations
from conformance.api.rest.calls import XML, example_call, root_name
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.refusals import judge_refusal
from conformance.api.rest.statuses import is_taken
from conformance.api.rest.xml_mutations import xml_mutations
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("input"), pytest.mark.needs("rest")]
_ID = "strict-input/xml-body"
_EACH = 80


@pytest.mark.requirement(
    _ID, "http/no-server-error", "http/problem-detail", "http/problem-value", "rest-formats/problem-xml"
)
def test_xml_mutations_are_refused(api: RestInterface, judge: Judge) -> None:
    """Send each named mutation of a valid XML body."""
    taken = 0
    operations = applicable_operations(api, [_ID], lambda item: XML in item.bodies, "takes XML")
    for operation in operations:
        api.device.halt(api)
        call = example_call(api, operation, XML)
        exchange = call.send(api)
        if not is_taken(exchange):
            judge.note(_ID, f"not tried on {operation.id}: a valid request for it as XML got {exchange.came}")
            continue
        taken += 1
        schema = operation.bodies[XML].schema
        made = xml_mutations(call.value, schema, root_name(schema) or "value")
        drawn = api.run.effort.draw(made, _EACH, f"{api.run.seed}/{operation.id}")
        for item in api.run.effort.alternatives(drawn, 3):
            wrong = call.carrying(item.made)
            named = (item.field, item.shown) if item.kind == "lexical" else ("", "")
            if not judge_refusal(
                api, partial(wrong.send, api), _ID, item.what, field=named[0], shown=named[1], json=False
            ):
                api.device.halt(api)
        for item in [mutation for mutation in made if mutation.kind == "lexical"][:1]:
            # The checkers judge the format of the refusal.
            call.carrying(item.made).send(api, ("Accept", XML))
    api.device.halt(api)
    if not taken and "rest-formats" not in api.run.claims:
        judge.unclaimed(_ID, "the robot takes no XML")
