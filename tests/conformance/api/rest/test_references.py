"""What refers to something of the device is known by its name, and filled with what the device has named."""

import json

import pytest

from conformance.api.rest.references import collections_of, in_link, refers
from conformance.api.rest.values import Values
from conformance.documents.openapi import Operation, read_operations
from conformance.documents.parameters import Parameter
from conformance.transport.exchange import Exchange, Outgoing, Request, Response

_TEXT = {"type": "string"}
_COLLECTIONS = frozenset({"valve", "battery"})


@pytest.mark.parametrize(
    ("name", "schema", "expected"),
    [
        ("cursor", _TEXT, True),
        ("next_cursor", _TEXT, True),
        ("page_token", _TEXT, True),
        ("parent_id", _TEXT, True),
        ("jobId", {"type": "integer"}, True),
        ("valve", _TEXT, True),
        ("battery_name", _TEXT, True),
        ("valves", {"type": "array", "items": _TEXT}, True),
        ("x", {"type": "string", "format": "uuid"}, True),
        ("x", {"type": "string", "format": "int64"}, True),
        ("x", {"type": ["string", "null"], "format": "semver"}, True),
        ("x", {"type": "array", "items": {"type": "string", "format": "mac"}}, True),
        ("x", {"type": "string", "format": "decimal", "pattern": "^[0-9]*$"}, True),
        ("x", {"type": "integer", "format": "int64"}, False),
        ("x", {"type": "string", "format": "date"}, False),
        ("x", {"enum": ["1"], "type": "string", "format": "int64"}, False),
        ("name", _TEXT, False),
        ("valid", _TEXT, False),
        ("isValid", _TEXT, False),
        ("toolID", _TEXT, True),
        ("toolid", _TEXT, True),
        ("speed", {"type": "number"}, False),
        ("valve", {"enum": ["a", "b"]}, False),
        ("valve_id", {"type": "boolean"}, False),
    ],
)
def test_names_that_refer(name, schema, expected):
    assert refers(name, schema, _COLLECTIONS) is expected


def test_collections_are_those_whose_items_have_paths():
    templates = ("/arm/valves/{id}", "/batteries/{b}/cells/{c}", "/speed", "/batteries/{b}/steps/{n}")
    paths = {template: {"get": {"responses": {}}} for template in templates}
    place = {"name": "n", "in": "path", "required": True, "schema": {"type": "integer"}}
    paths["/batteries/{b}/steps/{n}"]["parameters"] = [place]
    assert collections_of(read_operations({"paths": paths})) == {"valve", "battery", "cell"}


def test_a_link_names_its_values():
    assert in_link("http://r/events?cursor=c%2D1&n=2") == [("cursor", "c-1"), ("n", "2")]
    assert in_link("is it x = 1?") == []


def _learned(values, template, body=None, **headers):
    fields = (("Content-Type", "application/json"), *headers.items())
    answer = Response(200, fields, json.dumps(body).encode(), 1.0)
    values.learn(Operation(f"GET {template}", "GET", template), Exchange(Request("GET", f"http://r{template}"), answer))


@pytest.mark.parametrize(
    ("name", "template", "expected"),
    [
        ("valve", "/openings", ["v-1"]),
        ("valve_id", "/openings", ["v-1"]),
        ("cursor", "/events", ["c-2"]),
        ("after", "/events", ["a-3"]),
        ("parent_id", "/frames", ["f-4"]),
        ("job_id", "/openings", ["j-5"]),
        ("other_id", "/openings", []),
    ],
)
def test_what_the_device_named_is_found_by_name_collection_and_link(name, template, expected):
    values = Values({}, _COLLECTIONS)
    _learned(values, "/valves", [{"id": "v-1"}])
    _learned(values, "/events", {"next": "/events?cursor=c-2"}, Link='</events?after=a-3>; rel="next"')
    _learned(values, "/frames", None, Location="/frames/f-4")
    _learned(values, "/state", {"last": {"jobId": "j-5"}})
    operation = Operation("x", "POST", template)
    assert values.references(operation, name, _TEXT)[:1] == expected
    schema = {"type": "object", "properties": {name: _TEXT}}
    assert values.fill({name: "roaas"}, schema, operation) == {name: (expected or ["roaas"])[0]}


def test_a_request_invents_what_the_device_neither_named_nor_accepted():
    values = Values({"valve": ["given"]}, _COLLECTIONS)
    _learned(values, "/valves", [{"id": "v-1"}])
    operation = Operation("x", "GET", "/openings", (Parameter("valve", "query", required=True, schema=_TEXT),))

    def request(text):
        return Outgoing.of("GET", f"/openings?valve={text}", "", b"")

    assert [values.invents(operation, request(text)) for text in ("v-1", "given", "roaas")] == [False, False, True]
    values.remember(operation, request("roaas"))
    assert not values.invents(operation, request("roaas"))
