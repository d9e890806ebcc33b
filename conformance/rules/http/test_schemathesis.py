"""Schemathesis over the contract's OpenAPI: requests on both sides of each constraint, and random ones.

The suite judges each request by its bytes: valid ones must get a declared status, invalid ones 4xx.
"""

from contextlib import suppress

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import allows
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.motion_guard import MotionGuard
from conformance.api.rest.refusals import judge_refusal
from conformance.api.rest.validity import INVALID, VALID, validity
from conformance.documents.openapi import operations_of
from conformance.transport.exchange import Outgoing
from conformance.verdict.evidence import Judge
from conformance.verdict.explorer import Explorer

pytestmark = pytest.mark.needs("rest")
_IDS = ("http/declared-status", "http/declared-body", "http/no-server-error")
_STRICT = tuple(
    f"strict-input/{name}"
    for name in (
        "json-malformed",
        "json-missing",
        "json-unknown",
        "json-type",
        "json-non-finite",
        "json-root",
        "json-encoding",
        "json-empty",
        "json-bounds",
        "path-parameter",
        "query-parameter",
        "query-missing",
        "xml-body",
        "status-malformed",
        "status-invalid",
    )
)
# At standard effort, of each operation: cases of the coverage phase, and of each kind of fuzzing.
_COVERAGE = 110
_FUZZED = 14
_POSITIVE_REFUSALS = frozenset({405, 406, 408, 411, 413, 414, 415, 431})


@pytest.mark.phase("describe")
@pytest.mark.requirement(*_IDS, "strict-input/query-parameter", "strict-input/query-missing")
def test_reading_operations(api: RestInterface, judge: Judge, explore: Explorer) -> None:
    """Send generated requests for operations that move nothing; not at quick effort."""
    _send_generated(api, judge, explore, moving=False)


@pytest.mark.phase("input")
@pytest.mark.requirement(*_IDS, *_STRICT)
def test_moving_operations(api: RestInterface, judge: Judge, explore: Explorer) -> None:
    """Send generated requests for operations that may move the robot, most of them invalid; not at quick effort."""
    api.device.halt(api)
    _send_generated(api, judge, explore, moving=True)


def _send_generated(api: RestInterface, judge: Judge, explore: Explorer, *, moving: bool) -> None:
    effort = api.run.effort
    if effort.name == "quick":
        return
    from conformance.api.rest.generated import NOT_GENERATED, as_request, targets  # noqa: PLC0415 - takes half a second

    guard = MotionGuard(api)

    def send(case: object) -> None:
        item = as_request(case)
        if item is not None:
            _judge_generated(api, judge, guard, item)

    labels = {item.label for item in operations_of(api.run.contract) if item.motion == moving and allows(api, item)}
    for target in (one for one in targets(api.run.contract, undeclared=True) if one.label in labels):
        coverage = effort.draw_passing(target.covering(), _COVERAGE, f"{api.run.seed}/coverage {target.label}")
        for case in effort.subsample(coverage, 1):
            send(case)
        for negative in (True, False) if target.has_input and not effort.slow else ():
            with suppress(*NOT_GENERATED):
                explore(target.strategy(negative=negative), send, cases=_FUZZED)
        if moving:
            api.device.halt(api)


def _judge_generated(api: RestInterface, judge: Judge, guard: MotionGuard, item: Outgoing) -> None:
    """Send a generated request if it is harmless; a valid one must get a declared status, an invalid one 4xx."""
    fit = guard.admit(item)
    if fit is None:
        return
    said = validity(api.run.contract, fit.method, fit.target, fit.media_type, fit.body)
    if said.verdict == INVALID:
        body = said.requirement.startswith("json")
        judge_refusal(api, lambda: api.send(fit), f"strict-input/{said.requirement}", said.why, json=body)
        return
    exchange = api.send(fit)
    answer = exchange.response
    guard.count(fit, accepted=answer.ok)
    if said.verdict == VALID and said.operation is not None:
        expect(judge, "http/declared-status", exchange).that(
            answer.status not in _POSITIVE_REFUSALS,
            f"no refusal of a valid request for {said.operation.id}",
            cause=f"{said.operation.id} {answer.status}",
        )
