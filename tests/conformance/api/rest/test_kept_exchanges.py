"""What a robot's own description says is compared with the requests that it accepted and with its responses."""

import copy
import json

import pytest

from conformance.api.rest.description import KeptExchanges, contradiction, described_by_openapi
from conformance.api.rest.interface import RestInterface
from conformance.contract.pack import Contract
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.run import Run

CONTRACT = Contract.load()
BASE = "http://robot:7003"
VELOCITY = "/robot/velocity/"
STILL = {part: {"x": 0.0, "y": 0.0, "z": 0.0} for part in ("linear", "angular")}


@pytest.fixture
def api():
    run = Run(statement=Statement(endpoints=Endpoints(rest=BASE)), contract=CONTRACT)
    return RestInterface(run, HttpClient(BASE, Connection()))


def _exchange(method="PUT", path=VELOCITY, sent=STILL, status=200, received=STILL):
    body = b"" if sent is None else json.dumps(sent).encode()
    request = Request(method, BASE + path, (("Host", "robot"), ("Content-Type", "application/json")), body)
    return Exchange(
        request, Response(status, (("Content-Type", "application/json"),), json.dumps(received).encode(), 1.0)
    )


def _found(api, change, *exchanges):
    """Return what a changed description of the contract contradicts."""
    document = copy.deepcopy(CONTRACT.openapi)
    change(document["components"]["schemas"], document["paths"])
    theirs = {item.address: item for item in described_by_openapi(document, BASE)}
    listener = KeptExchanges(api)
    for one in exchanges:
        listener.on_response(one)
    return [
        found
        for kept in listener.kept.values()
        for context, exchange in kept
        if (
            found := contradiction(api, theirs[context.operation.method, context.operation.template], context, exchange)
        )
    ]


def _as_it_is(_schemas, _paths):
    pass


def _no_reverse(schemas, _paths):
    schemas["Vector3Input"]["properties"]["x"]["minimum"] = 0.1


def _another_name(schemas, _paths):
    schemas["Twist"]["required"] = ["linear", "angular", "speed"]


def _required(_schemas, paths):
    paths["/robot/navigation/service/plan"]["get"]["parameters"][2]["required"] = True


PLAN = _exchange("GET", "/robot/navigation/service/plan?x=1&y=1", None, received={})


@pytest.mark.parametrize(
    ("change", "exchange", "found"),
    [
        (_as_it_is, _exchange(), ""),
        (_no_reverse, _exchange(), "forbids"),
        (_another_name, _exchange("GET", sent=None), "speed is missing"),
        (_required, PLAN, "no parameter yaw"),
        # What the contract forbids as well, or the robot refuses, says nothing of the description.
        (_no_reverse, _exchange(sent={}, status=204), ""),
        (_another_name, _exchange("GET", sent=None, status=503), ""),
    ],
)
def test_a_description_is_held_against_what_was_seen(api, change, exchange, found):
    told = _found(api, change, exchange)
    assert found in "".join(told)
    assert bool(told) is bool(found)


def test_of_many_exchanges_the_longest_request_is_kept(api):
    many = [_exchange(sent={**STILL, "n": "a" * length}) for length in range(1, 40)]
    listener = KeptExchanges(api)
    for one in [*many, _exchange("GET", "/robot/unknown/", None), _exchange("HEAD", sent=None)]:
        listener.on_response(one)
    ((label, kept),) = listener.kept.items()
    assert label == f"PUT {VELOCITY}"
    assert kept[-1][1] is many[-1]
    assert len(kept) < len(many) / 2
