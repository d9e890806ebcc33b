"""The survey's values fit their schemas, and what one response named is used in the next request."""

import json
import re
import time

import pytest

from conformance.api.rest.samples import fits, sample
from conformance.api.rest.values import Values
from conformance.documents.json_schema import modern
from conformance.documents.openapi import Operation
from conformance.documents.parameters import Parameter
from conformance.transport.exchange import Exchange, Request, Response

_LIST, _ONE = Operation("", "GET", "/jobs"), Operation("", "GET", "/jobs/{job_id}")


@pytest.mark.parametrize(
    "schema",
    [
        {},
        {"type": "string", "minLength": 9, "maxLength": 9},
        {"type": "string", "maxLength": 2},
        {"type": "string", "pattern": "^[A-Z]{3}-[0-9]+$"},
        {"type": "string", "format": "date-time"},
        {"type": "string", "format": "uuid", "example": 1},
        {"type": ["null", "integer"], "minimum": 3},
        {"anyOf": [{"type": "null"}, {"type": "integer"}]},
        {"anyOf": [{"type": "integer"}, {"type": "string"}]},
        {"type": "integer", "exclusiveMinimum": 3, "multipleOf": 5},
        {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 0.1},
        {"type": "integer", "maximum": -4},
        {"type": "integer", "minimum": 0, "exclusiveMinimum": True},
        {"type": "number", "maximum": 0, "exclusiveMaximum": True},
        {"type": "boolean"},
        {"enum": [None, "a"]},
        {"const": 7},
        {"type": "array", "items": {"type": "integer"}, "minItems": 3, "uniqueItems": True},
        {"type": "array", "prefixItems": [{"type": "integer"}, {"type": "string"}], "items": False, "minItems": 2},
        {"type": "object", "required": ["a"], "properties": {"a": {"type": "object", "required": ["b"]}}},
        {"allOf": [{"type": "object", "required": ["a"], "properties": {"a": {"const": 4}}}, {"required": ["c"]}]},
        {"oneOf": [{"type": "object", "required": ["k"], "properties": {"k": {"enum": ["x"]}}}, {"type": "array"}]},
        {"type": "object", "minProperties": 0, "additionalProperties": {"type": "string"}},
        {"type": "object", "minProperties": 2, "properties": {"a": {}, "b": {"type": "integer"}, "c": {}}},
        {"required": ["a"], "properties": {"a": {}, "b": {}}, "dependentRequired": {"a": ["b"]}},
    ],
)  # fmt: skip
def test_a_sample_fits_its_schema(schema):
    schema = modern(schema)
    for whole in (False, True):
        value = sample(schema, whole=whole)
        assert fits(schema, value), value


@pytest.mark.parametrize(
    "pattern", ["^[a-z]{2}_[0-9a-f]{8}$", "^[0-9A-F]{2}(:[0-9A-F]{2}){5}$", "^(?:[a-z0-9-]{1,63}\\.){2}[a-z]{2,9}$"]
)
def test_a_text_with_a_pattern_is_made_at_once(pattern):
    started = time.process_time()
    for _ in range(20):
        assert re.fullmatch(pattern, sample({"type": "string", "pattern": pattern}))
    assert time.process_time() - started < 1.5  # with an explanation of why it is the shortest: 2 to 5 s each


def test_what_only_responses_have_is_not_sent():
    part = {"type": "integer", "readOnly": True}
    schema = {"type": "object", "required": ["id", "n"], "properties": {"id": part, "n": {"type": "integer"}}}
    assert sample(schema) == sample(schema, whole=True) == {"n": 1}


def _response(body, status=200, **headers):
    fields = (("Content-Type", "application/json"), *headers.items())
    return Exchange(Request("GET", "http://h/", (), b""), Response(status, fields, json.dumps(body).encode(), 1.0))


@pytest.mark.parametrize(
    ("operation", "exchange", "known"),
    [
        (_LIST, _response([{"id": "x"}, {"id": "y"}]), ["y", "x"]),
        (_LIST, _response(["x", "y"]), ["y", "x"]),
        (Operation("", "POST", "/jobs"), _response({"uuid": "x"}, 201), ["x"]),
        (Operation("", "POST", "/jobs"), _response({}, 201, Location="/v1/jobs/x?y=1"), ["x"]),
        (Operation("", "GET", "/else"), _response({"last": {"jobId": "x"}}), ["x"]),
        (_LIST, _response([{"id": "x"}], 404), []),
    ],
)
def test_ids_come_from_earlier_responses(operation, exchange, known):
    values = Values()
    values.learn(operation, exchange)
    parameter = Parameter("job_id", "path", required=True, schema={"type": "string"})
    assert values.of(_ONE, parameter) == [*known, "roaas"]


def test_what_the_user_gives_comes_first_and_the_description_next():
    values = Values({"jobId": ["given", 5]})
    parameter = Parameter("job_id", "path", required=True, schema={"type": "string"}, examples=("shown", 6))
    assert values.of(_ONE, parameter) == ["given", 5, "shown", "roaas"]
    schema = {"type": "object", "required": ["job_id"], "properties": {"job_id": {"type": "string"}}}
    assert values.body(schema, ({"job_id": "e"},)) == [{"job_id": "e"}, {"job_id": "given"}]


def test_the_second_body_takes_the_last_alternative_of_each_union():
    part = {"type": "object", "required": ["type"], "properties": {"type": {"type": "string"}}}
    union = {"anyOf": [part, {"type": "array", "items": part}, {"type": "null"}]}
    schema = {"type": "object", "required": ["physics"], "properties": {"physics": union}}
    assert Values().body(schema) == [{"physics": {"type": "roaas"}}, {"physics": []}]
    plain = {"type": "object", "required": ["on"], "properties": {"on": {"type": "boolean"}}}
    assert Values().body(plain) == [{"on": True}]


def test_an_example_that_was_deleted_is_tried_last_until_it_is_there_again():
    values, schema = Values(), {"type": "string"}
    job = Parameter("job_id", "path", required=True, schema=schema, examples=("first",))
    read, write, delete = (Operation("", method, "/jobs/{job_id}") for method in ("GET", "PUT", "DELETE"))

    def learn(operation, url, body=b""):
        request = Request(operation.method, f"http://device{url}", (), b"")
        values.learn(operation, Exchange(request, Response(200, (("content-type", "application/json"),), body, 1.0)))

    learn(_LIST, "/jobs", b'[{"id": "second"}]')
    assert values.of(read, job)[:2] == ["first", "second"]
    learn(delete, "/jobs/first")
    assert values.of(read, job)[0] == "second"
    assert values.of(read, job)[-1] == "first"
    learn(write, "/jobs/first")
    assert values.of(read, job)[0] == "first"
    learn(Operation("", "POST", "/jobs"), "/jobs", b'{"id": "own"}')
    assert [values.of(one, job)[0] for one in (read, delete)] == ["first", "own"]
