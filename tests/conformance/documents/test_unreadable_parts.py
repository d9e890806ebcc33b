"""What cannot be read in a description is left out and named; the rest is read."""

import json

import pytest

from conformance.documents.description import read_description
from conformance.documents.json_shape import shape_of
from conformance.documents.openapi import read_operations

_OK = {"responses": {"200": {"description": "ok", "content": {"application/json": {"schema": {"type": "integer"}}}}}}
_SCHEMA = "/paths/~1x/get/responses/200/content/application~1json/schema"


def _read(item, version="3.1.0"):
    document = {"openapi": version, "info": {}, "paths": {"/ok": {"get": _OK}, "/x": item}}
    return read_description("http://device.invalid/o.json", lambda _: json.dumps(document).encode())


def _answering(schema):
    return {"get": {"responses": {"200": {"description": "ok", "content": {"application/json": {"schema": schema}}}}}}


@pytest.mark.parametrize(
    "broken",
    [None, [], {"parameters": [{"in": "query"}], "responses": {}}, {"parameters": {"a": 1}}, {"responses": None}],
)
@pytest.mark.parametrize("others", [{}, {"put": _OK}, {"additionalOperations": {"COPY": _OK}}])
def test_an_unreadable_operation_leaves_the_others(broken, others):
    read = _read({"get": broken, **others}, "3.2.0")
    methods = [method.upper() for method in others.get("additionalOperations", others)]
    assert [one.label for one in read_operations(read.document)] == ["GET /ok", *(f"{one} /x" for one in methods)]
    assert [one.partition(": not judged: ")[0] for one in read.unread] == ["GET /x"]


def test_recursive_schemas_beside_an_unreadable_operation_are_kept():
    tree = {"type": "object", "additionalProperties": {"$ref": "#/paths/~1x/get/responses/200/content/a/schema"}}
    answer = {"description": "ok", "content": {"a": {"schema": tree}}}
    read = _read({"get": {"responses": {"200": answer}}, "put": None})
    assert read.document["paths"]["/x"] == {"get": {"responses": {"200": answer}}}


@pytest.mark.parametrize(
    ("schema", "place"),
    [
        ({"type": "strin"}, ""),
        ({"$ref": 5}, ""),
        ([1], ""),
        ({"properties": {"a": {"minimum": "1"}, "b": {"type": "integer"}}}, "/properties/a"),
        ({"items": {"anyOf": [{"type": "null"}, {"required": "a"}]}}, "/items/anyOf/1"),
    ],
)
def test_an_unreadable_schema_allows_any_value_and_leaves_the_others(schema, place):
    read = _read(_answering(schema))
    assert [one.partition(": not judged: ")[0] for one in read.unread] == [_SCHEMA + place]
    shape = shape_of(read_operations(read.document)[1].responses["200"]["application/json"])
    assert shape.holds({"a": "x", "b": 1})
    assert shape.holds({"b": "x"}) == (place != "/properties/a")


@pytest.mark.parametrize("version", ["3.0.3", "3.1.0"])
def test_a_readable_description_stays_as_it_is(version):
    item = {**_answering({"type": "integer", "minimum": 0}), "x-vendor": {"schema": "text", "schemas": {"A": 5}}}
    read = _read(item, version)
    assert read.unread == ()
    assert read.document["paths"]["/x"] == item
