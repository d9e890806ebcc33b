"""What a run sent to the operations of a described API."""

import pytest
from small_device import contract_of

from conformance.api.call_rules import CallRules
from conformance.api.rest.operation_log import OperationLog, branches_in, branches_of
from conformance.transport.exchange import Exchange, NoAnswer, Request, Response, Unanswered
from conformance.verdict.finding import Finding, Showing

OK = {"200": {"content": {"application/json": {"schema": {"properties": {"x": {}, "y": {}}}}}}}
API = {
    "openapi": "3.1.0",
    "info": {"title": "Arm", "version": "2"},
    "paths": {
        "/joints/{name}": {
            "get": {
                "parameters": [
                    {"name": "name", "in": "path", "required": True, "schema": {"type": "string"}},
                    {"name": "unit", "in": "query", "schema": {"type": "string"}},
                ],
                "responses": OK,
            },
            "delete": {"responses": {"204": {"description": "Gone."}}},
        },
        "/state": {"get": {"responses": OK}},
    },
}
BASE = "http://robot/api"


def exchange(target, status=200, body=b"{}", method="GET"):
    headers = (("Content-Type", "application/json"),)
    return Exchange(Request(method, f"{BASE}{target}"), Response(status, headers, body, 3.0))


def finding(number, attempt, *operations):
    return Finding(
        "http/x", "", "", "", "", attempt, operations={one: Showing(one) for one in operations}, number=number
    )


def test_the_matrix_counts_what_was_sent_and_seen(tmp_path):
    log = OperationLog(contract_of(tmp_path, API), BASE)
    log.on_response(exchange("/joints/a?unit=rad", body=b'{"x": 1}'))
    log.on_response(exchange("/joints/b", status=404))
    log.by_hand(exchange("/joints/b", status=304))
    log.on_response(exchange("/elsewhere"))
    log.on_no_response(Unanswered(Request("GET", f"{BASE}/joints/c"), "closed", NoAnswer.CLOSED))
    head, brew = exchange("/joints/b", method="HEAD"), exchange("/joints/b", method="BREW")
    findings = [
        finding(1, exchange("/joints/b"), "GET /joints/{name}", "GET /state"),
        finding(2, head, *log.labels_of(head.request)),
        finding(3, brew, *log.labels_of(brew.request)),
        finding(4, None),
    ]
    document = log.document(CallRules(), findings)
    joints, delete, state = document["operations"]
    assert (joints["requests"], joints["unanswered"]) == (4, 1)
    assert joints["statuses"] == {"200": 1, "304": 1, "404": 1}
    assert (joints["seen_declared"], joints["need_no_declaration"]) == (["200"], ["304"])
    assert [one["findings"] for one in (joints, delete, state)] == [[1, 2, 3], [3], [1]]
    assert [one["called"] for one in (joints, delete, state)] == [True, False, True]
    assert document["coverage"] == {"operations": [1, 3], "parameters": [2, 2], "statuses": [1, 3], "branches": [1, 4]}
    assert (document["title"], document["version"]) == ("Arm", "2")


def test_a_head_counts_where_it_is_declared(tmp_path):
    paths = {"/a": {"get": {"responses": OK}, "head": {"responses": OK}}, "/b": {"get": {"responses": OK}}}
    log = OperationLog(contract_of(tmp_path, API | {"paths": paths}), BASE)
    for path in paths:
        log.on_response(exchange(path, method="HEAD"))
    rows = log.document(CallRules(), ())["operations"]
    assert {row["operation"]: row["requests"] for row in rows} == {"GET /a": 0, "HEAD /a": 1, "GET /b": 0}


POSE = {"type": "object", "properties": {"x": {"type": "number"}, "frame": {"type": "string"}}}


def test_what_a_map_would_have_sent_says_so(tmp_path):
    log = OperationLog(contract_of(tmp_path, API), BASE)
    rows = log.document(CallRules(), (), mapped=["DELETE /joints/{name}"])["operations"]
    assert rows[1]["reason"] == "the map in the statement names it, and this run did not come to it"
    assert log.document(CallRules(), ())["operations"][1]["reason"].startswith("it may change something")


@pytest.mark.parametrize(
    ("schema", "value", "shown", "hidden"),
    [
        ({}, {"a": 1}, set(), set()),
        (POSE, {"x": 1}, {".x"}, {".frame"}),
        ({"type": "array", "items": POSE}, [{"x": 1}, {"frame": "map"}], {"[].x", "[].frame"}, set()),
        ({"anyOf": [POSE, {"type": "null"}]}, None, {"|anyOf 1"}, {"|anyOf 0", "|anyOf 0.x", "|anyOf 0.frame"}),
        ({"allOf": [POSE]}, {"frame": "map"}, {".frame"}, {".x"}),
        ({"properties": {"pose": POSE}}, {"pose": {"x": 1}}, {".pose", ".pose.x"}, {".pose.frame"}),
        (POSE, [1, 2], set(), {".x", ".frame"}),
        ({"oneOf": [{"pattern": "("}]}, "a", set(), {"|oneOf 0"}),
    ],
)
def test_a_value_shows_some_of_a_schemas_branches(schema, value, shown, hidden):
    assert set(branches_in(schema, value)) == shown
    assert set(branches_of(schema)) == shown | hidden


def test_operations_that_nothing_answered_are_told(tmp_path):
    log = OperationLog(contract_of(tmp_path, API), BASE)
    log.on_no_response(Unanswered(Request("GET", f"{BASE}/state"), "hung", NoAnswer.CLOSED))
    assert log.nothing_shown(CallRules()) == "no operation was answered in time"
    log.on_response(exchange("/state", status=404))
    assert "[values]" in log.nothing_shown(CallRules())
    log.on_response(exchange("/state"))
    assert log.nothing_shown(CallRules()) == ""
