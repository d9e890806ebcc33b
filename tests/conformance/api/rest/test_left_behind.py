"""In which state a run leaves a device, by its exchanges; and what an operation without success needs."""

import json

import pytest

from conformance.api.rest.left_behind import LeftBehind
from conformance.api.rest.statuses import need_of
from conformance.documents.openapi import read_operations
from conformance.transport.exchange import Exchange, Request, Response

_BASE = "http://robot/api"
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "integer"}}
_SPEED = {"name": "speed", "in": "query", "required": True, "schema": {"type": "number"}}
_BODY = {
    "requestBody": {
        "content": {
            "application/json": {
                "schema": {"type": "object", "required": ["goal"], "properties": {"goal": {}, "note": {}}}
            }
        }
    }
}
_ANY = {"responses": {"default": {"description": ""}}}
_DOCUMENT = {
    "openapi": "3.1.0",
    "info": {"title": "t", "version": "1"},
    "paths": {
        "/jobs": dict.fromkeys(("get", "post", "delete"), _ANY),
        "/jobs/{id}": {method: {**_ANY, "parameters": [_ID]} for method in ("get", "put", "delete")},
        "/config": dict.fromkeys(("get", "put", "patch"), _ANY),
        "/start": {"post": _ANY},
        "/scan": {"put": {**_ANY, "requestBody": {"content": {"image/tiff": {}}}}},
        "/move": {"post": {**_ANY, **_BODY, "parameters": [_SPEED]}},
    },
}
_OPERATIONS = {one.label: one for one in read_operations(_DOCUMENT)}
_CREATED = {"id": 7}


def _left(*exchanges):
    """Return what these exchanges leave behind: label of the operation, path, status, JSON body, Location."""
    followed = LeftBehind(_OPERATIONS.values(), _BASE)
    for label, path, status, body, *location in exchanges:
        headers = (("Content-Type", "application/json"), *(("Location", one) for one in location))
        request = Request(label.split()[0], f"{_BASE}{path}")
        response = Response(status, headers, json.dumps(body).encode(), 1.0)
        followed.follow(_OPERATIONS[label], Exchange(request, response))
    return followed.document()


@pytest.mark.parametrize(
    ("status", "body", "location"),
    [
        (201, _CREATED, []),
        (200, _CREATED, []),
        (201, {"job_id": 7, "place": "dock"}, []),
        (201, {"job": {"jobId": 7}}, []),
        (201, None, ["/api/jobs/7"]),
        (201, None, ["http://robot/api/jobs/7"]),
        (201, None, ["jobs/7"]),
    ],
)
def test_what_was_created_stays_until_it_is_deleted(status, body, location):
    created = ("POST /jobs", "/jobs", status, body, *location)
    assert _left(created)["created"] == [{"operation": "POST /jobs", "ids": ["7"]}]
    for ending in (
        ("DELETE /jobs/{id}", "/jobs/7", 204, None),
        ("DELETE /jobs", "/jobs", 204, None),
        ("GET /jobs/{id}", "/jobs/7", 404, None),
    ):
        left = _left(created, ending)
        assert (left["created"], left["deleted"]) == ([], [])
        assert left["lines"] == []
    refused = ("DELETE /jobs/{id}", "/jobs/7", 409, None)
    assert _left(created, refused)["created"] == [{"operation": "POST /jobs", "ids": ["7"]}]


def test_what_was_there_before_and_is_deleted_is_told():
    left = _left(("DELETE /jobs/{id}", "/jobs/3", 204, None), ("DELETE /jobs/{id}", "/jobs/4", 204, None))
    assert left["lines"] == ["deleted: 2 by DELETE /jobs/{id} (ids 3, 4)"]


@pytest.mark.parametrize("method", ["PUT", "PATCH"])
def test_what_was_changed_is_told_unless_it_was_restored(method):
    before, change, after = (
        ("GET /config", "/config", 200, {"speed": 1}),
        (f"{method} /config", "/config", 200, None),
        ("GET /config", "/config", 200, {"speed": 2}),
    )
    told = [{"operation": f"{method} /config", "path": "/config"}]
    assert _left(change)["changed"] == told
    assert _left(before, change)["changed"] == told
    assert _left(before, change, after)["changed"] == told
    assert _left(before, change, after, change, before)["changed"] == []
    assert _left(change, after)["changed"] == told


def test_the_latest_success_comes_first_and_refusals_change_nothing():
    left = _left(
        ("POST /move", "/move?speed=1", 202, None),
        ("POST /start", "/start", 200, None),
        ("POST /move", "/move?speed=2", 200, None),
        ("POST /start", "/start", 409, None),
    )
    assert left["last"] == [{"operation": "POST /move", "status": 200}, {"operation": "POST /start", "status": 200}]
    assert left["lines"] == ["called last: POST /move with 200, POST /start with 200"]
    assert _left(("POST /start", "/start", 409, None), ("GET /jobs", "/jobs", 200, [])) == {}


@pytest.mark.parametrize(
    ("label", "status", "need", "values"),
    [
        ("GET /jobs/{id}", 404, "values that the device knows: id", ["id"]),
        ("POST /move", 404, "values that the device knows: speed, goal", ["speed", "goal"]),
        ("POST /move", 422, "values that the device knows: speed, goal", ["speed", "goal"]),
        ("POST /move", 409, "another state of the device", []),
        ("PUT /jobs/{id}", 409, "another state of the device", ["id"]),
        ("POST /start", 423, "a lock or lease that another client may hold", []),
        ("PUT /scan", 422, "a file of image/tiff that it takes, which the suite cannot make", []),
        ("POST /start", 403, "credentials that may do this", []),
        ("POST /start", 507, "room on the device", []),
        ("POST /start", 400, "", []),
        ("POST /start", 500, "", []),
        ("POST /start", 0, "", []),
    ],
)
def test_what_an_operation_needs_follows_from_its_status(label, status, need, values):
    assert need_of(_OPERATIONS[label], status) == (need, values)
