"""The estimate is within a factor of 1.5 of what runs of devices of 1, 20 and 188 operations took.

The figures were measured on an idle machine with devices whose every other operation has one integer parameter.
"""

import json
import random

import pytest

from conformance.documents.openapi import operations_of
from conformance.scenarios.estimate import Estimate, estimate, timed_often
from conformance.scenarios.pauses import PAUSES_S
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import empty_statement
from conformance.target.describing import described_contract
from conformance.transport.client import Connection
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

_COUNT = {"name": "count", "in": "query", "schema": {"type": "integer", "minimum": 1, "maximum": 10}}
_RESPONSES = {"200": {"description": "ok", "content": {"application/json": {"schema": {"type": "object"}}}}}


@pytest.fixture(scope="module")
def described(tmp_path_factory):
    def described(count, effort, usual_ms, *claims):
        paths = {
            f"/r{number}": {"get": {"parameters": [_COUNT] if number % 2 else [], "responses": _RESPONSES}}
            for number in range(count)
        }
        folder = tmp_path_factory.mktemp("described")
        source = folder / "device.json"
        source.write_text(
            json.dumps({"openapi": "3.0.3", "info": {"title": "d", "version": "1"}, "paths": paths}), encoding="utf-8"
        )
        contract, *_ = described_contract(str(source), (), "http://127.0.0.1:9", Endpoints(), Connection(), folder)
        run = Run(
            statement=empty_statement(contract),
            contract=contract,
            claims=claims or tuple(contract.classes),
            effort=Effort(effort).slowed_to(usual_ms),
        )
        return estimate(run, operations_of(contract))

    return described


@pytest.mark.parametrize(
    ("count", "effort", "usual_ms", "requests", "seconds"),
    [
        (1, "quick", 30, 352, 12.0),
        (1, "quick", 200, 164, 25.5),
        (1, "standard", 30, 803, 17.8),
        (1, "standard", 200, 186, 29.7),
        (20, "quick", 30, 916, 27.6),
        (20, "quick", 200, 654, 120.8),
        (20, "standard", 30, 2659, 80.9),
        (20, "standard", 200, 1107, 217.0),
        (188, "quick", 0.5, 4558, 3.8),
        (188, "quick", 30, 4558, 140.4),
        (188, "quick", 200, 3437, 671.1),
        (188, "standard", 0.5, 14167, 40.0),
    ],
)
def test_what_was_measured_was_estimated(described, count, effort, usual_ms, requests, seconds):
    found = described(count, effort, usual_ms)
    seconds += sum(PAUSES_S[effort])  # the runs that were measured had no pauses
    assert requests / 1.5 < found.requests < requests * 1.5
    assert seconds / 1.5 < found.seconds(usual_ms) < seconds * 1.5


def test_a_class_alone_takes_fewer_requests(described):
    whole = described(20, "quick", 1).requests
    assert described(20, "quick", 1, "http").requests < whole
    assert described(20, "quick", 1, "description").requests < whole


def test_the_sentence_has_two_digits_and_a_unit():
    assert Estimate(14155).text(200.0) == (
        "This run sends about 14,000 requests and takes about 47 minutes (the device answers in 200.0 ms)."
    )
    assert "about 350 requests and takes about 11 s" in Estimate(349).text(30.0)
    assert Estimate(349).text().endswith("depends on the device's response time.")


def _took(ms):
    return Exchange(Request("GET", "http://robot/state"), Response(200, (), b"{}", ms))


def test_response_times_that_vary_by_themselves_have_not_grown():
    for seed in range(300):
        drawn = random.Random(seed)  # noqa: S311 - no secret
        timed = timed_often("GET /state", _took(1.0), lambda drawn=drawn: _took(drawn.uniform(0.0, 150.0)))
        assert not timed.has_grown


def test_response_times_that_have_grown_are_seen():
    timed = timed_often("GET /state", _took(10.0), iter([_took(80.0)] * 30).__next__)
    assert timed.has_grown
    assert len(timed_often("GET /state", _took(10.0), iter([_took(11.0)] * 30).__next__).times) == 5
