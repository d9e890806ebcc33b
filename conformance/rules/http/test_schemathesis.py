"""Schemathesis over the contract's OpenAPI: examples, coverage, fuzzing and walks along its links.

The suite judges each request by its bytes: valid ones must get a declared status, invalid ones 4xx.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import allowed
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.motion_guard import MotionGuard
from conformance.api.rest.refusals import judge_refusal
from conformance.api.rest.validity import INVALID, VALID, validity
from conformance.documents.openapi import operations_of
from conformance.transport.client import HttpClient
from conformance.transport.exchange import Outgoing
from conformance.verdict.evidence import Judge
from conformance.verdict.explorer import Explorer

if TYPE_CHECKING:
    # Importing it takes 0.1 s, in which the robot could drive already.
    from conformance.api.rest.generated import Target

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


def _targets(api: RestInterface, *, moving: bool) -> list[Target]:
    if api.run.effort.name == "quick":
        return []
    from conformance.api.rest.generated import targets  # noqa: PLC0415 - takes half a second

    labels = {item.label for item in operations_of(api.run.contract) if item.motion == moving and allowed(api, item)}
    return [target for target in targets(api.run.contract) if target.label in labels]


@pytest.mark.phase("describe")
@pytest.mark.requirement(*_IDS, "strict-input/query-parameter", "strict-input/query-missing")
def test_reading_operations(api: RestInterface, judge: Judge, explore: Explorer) -> None:
    """Send generated requests for operations that move nothing; not at quick effort."""
    guard = MotionGuard(api)
    for target in _targets(api, moving=False):
        _run(api, judge, explore, guard, target)


@pytest.mark.phase("input")
@pytest.mark.requirement(*_IDS, *_STRICT)
def test_moving_operations(api: RestInterface, judge: Judge, explore: Explorer) -> None:
    """Send generated requests for operations that may move the robot, most of them invalid; not at quick effort."""
    guard = MotionGuard(api)
    api.device.halt(api)
    for target in _targets(api, moving=True):
        _run(api, judge, explore, guard, target)
        api.device.halt(api)


def _run(api: RestInterface, judge: Judge, explore: Explorer, guard: MotionGuard, target: Target) -> None:
    coverage = api.run.effort.draw_passing(target.coverage(), _COVERAGE, f"{api.run.seed}/coverage {target.label}")
    for item in api.run.effort.subsample([*target.examples(), *coverage], 1):
        _judge_generated(api, judge, guard, item)

    def fuzz(item: Outgoing | None) -> None:
        if item is not None:
            _judge_generated(api, judge, guard, item)

    if api.run.effort.slow or not target.has_input:
        return
    from conformance.api.rest.generated import NOT_GENERATED  # noqa: PLC0415 - as above

    for negative in (True, False):
        try:
            explore(target.fuzzing(negative=negative), fuzz, cases=_FUZZED)
        except NOT_GENERATED:
            continue


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
            f"a status by which {said.operation.id} does not refuse the form of a valid request",
            cause=f"{said.operation.id} {answer.status}",
        )


@pytest.mark.phase("input")
@pytest.mark.requirement("http/declared-status")
def test_walk_along_the_links(api: RestInterface, rest: HttpClient, judge: Judge, explore: Explorer) -> None:
    """Walk from operation to operation along the contract's links, a few times; not at quick effort."""
    if api.run.effort.name == "quick":
        return  # the observers judge http/declared-status on every other request
    from conformance.api.rest.generated import as_request, as_thesis, state_machine  # noqa: PLC0415 - as above

    machine: Any = state_machine(api.run.contract.openapi)
    if machine is None:
        judge.note("http/declared-status", "the contract has no links to walk along")
        return
    guard = MotionGuard(api)

    class Walk(machine):  # type: ignore[misc] # made at run time
        def call(self, case: Any, **_: Any) -> Any:
            one = as_request(case)
            fit = guard.admit(one) if one is not None else None
            if fit is None:
                exchange = rest.send("GET", api.path)
            else:
                exchange = api.send(fit)
                guard.count(fit, accepted=exchange.response.ok)
            return as_thesis(exchange)

        def validate_response(self, *_: Any, **__: Any) -> None:
            """Do nothing: the observers have judged the response."""

    api.device.halt(api)
    explore.machine(Walk, cases=4, steps=5)
    api.device.halt(api)
