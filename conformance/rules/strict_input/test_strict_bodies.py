"""The robot must reject invalid JSON and XML bodies: valid ones broken in one way, confirmed on the bytes."""

from functools import partial

import pytest

from conformance.api.expectation import expect
from conformance.api.mutations import Mutation
from conformance.api.rest.applicable import applicable_operations
from conformance.api.rest.body_mutations import KINDS, mutations, xml_mutations
from conformance.api.rest.calls import JSON, XML, Call, example_call, root_name
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.refusals import judge_refusal
from conformance.api.rest.statuses import is_taken
from conformance.documents.openapi import Operation
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("input"), pytest.mark.needs("rest")]
_IDS = tuple(f"strict-input/json-{kind}" for kind in KINDS)
_STATUSES = ("strict-input/status-malformed", "strict-input/status-invalid")
# Requirements whose cases may crash a robot: each case is sent on a connection of its own.
_HOSTILE = ("strict-input/json-depth", "strict-input/json-huge-number")
# Cases of one requirement and operation at standard effort; more of them repeat each other.
_EACH = 50


@pytest.mark.requirement(
    *_IDS, *_STATUSES, "http/problem-detail", "http/problem-value", "http/no-server-error", "rest-formats/problem-xml"
)
def test_mutations_are_refused(api: RestInterface, judge: Judge, effort: Effort) -> None:
    """Send each named mutation of a valid body, and a valid one after them."""
    possible: set[str] = set()
    for operation in applicable_operations(api, (*_IDS, *_STATUSES), lambda item: JSON in item.bodies, "takes JSON"):
        api.device.halt(api)
        call = example_call(api, operation)
        by_kind = _by_kind(call, operation)
        possible |= {kind for kind, made in by_kind.items() if made}
        first = call.send(api)
        if not is_taken(first):
            for id_ in (*_IDS, *_STATUSES):
                judge.note(id_, f"not tried on {operation.id}: a valid request for it got {first.came}")
            continue
        for kind, made in by_kind.items():
            drawn = effort.draw(made, _count(effort, kind), f"{api.run.seed}/{operation.id} {kind}")
            for item in effort.alternatives(drawn, 1):
                _try(api, judge, call, item)
        for item in by_kind["type"][:1]:
            # The checkers judge the format of the refusal.
            call.carrying(item.made).send(api, ("Accept", XML))
        api.device.halt(api)
        when = f"a valid {operation.id} follows invalid ones"
        expect(judge, "http/no-server-error", call.send(api)).accepts(when)
    api.device.halt(api)
    for kind in KINDS if possible else ():
        if kind not in possible:
            judge.note_unclaimed(f"strict-input/json-{kind}", "no body of the contract can be wrong in this way")


def _count(effort: Effort, kind: str) -> int:
    """Return the number of cases at standard effort; fewer for deeply nested bodies, which cost a robot much more."""
    if kind == "depth":
        return 6 if effort.name != "quick" else 1
    return _EACH


def _by_kind(call: Call, operation: Operation) -> dict[str, list[Mutation[bytes]]]:
    made = mutations(call.value, operation.bodies[JSON].schema)
    return {kind: [item for item in made if item.kind == kind] for kind in KINDS}


def _try(api: RestInterface, judge: Judge, call: Call, item: Mutation[bytes]) -> None:
    requirement = f"strict-input/json-{item.kind}"
    judge.at_risk = (requirement,)
    refused = judge_refusal(
        api,
        partial(call.carrying(item.made).send, api, fresh=requirement in _HOSTILE),
        requirement,
        item.what,
        field=item.field,
        shown=item.shown,
        malformed=item.malformed,
    )
    if not refused:
        api.device.halt(api)


_XML_BODY = "strict-input/xml-body"
_EACH_XML = 80


@pytest.mark.requirement(
    _XML_BODY, "http/no-server-error", "http/problem-detail", "http/problem-value", "rest-formats/problem-xml"
)
def test_xml_mutations_are_refused(api: RestInterface, judge: Judge) -> None:
    """Send each named mutation of a valid XML body."""
    taken = 0
    operations = applicable_operations(api, [_XML_BODY], lambda item: XML in item.bodies, "takes XML")
    for operation in operations:
        api.device.halt(api)
        call = example_call(api, operation, XML)
        exchange = call.send(api)
        if not is_taken(exchange):
            judge.note(_XML_BODY, f"not tried on {operation.id}: a valid request for it as XML got {exchange.came}")
            continue
        taken += 1
        schema = operation.bodies[XML].schema
        made = xml_mutations(call.value, schema, root_name(schema) or "root")
        drawn = api.run.effort.draw(made, _EACH_XML, f"{api.run.seed}/{operation.id}")
        for item in api.run.effort.alternatives(drawn, 3):
            wrong = call.carrying(item.made)
            named = (item.field, item.shown) if item.kind == "lexical" else ("", "")
            if not judge_refusal(
                api, partial(wrong.send, api), _XML_BODY, item.what, field=named[0], shown=named[1], json=False
            ):
                api.device.halt(api)
        for item in [mutation for mutation in made if mutation.kind == "lexical"][:1]:
            # The checkers judge the format of the refusal.
            call.carrying(item.made).send(api, ("Accept", XML))
    api.device.halt(api)
    if not taken and "rest-formats" not in api.run.claims:
        judge.note_unclaimed(_XML_BODY, "the robot takes no XML")
