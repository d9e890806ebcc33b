"""The faults of a description are named with their places, and a right description has none."""

import pytest

from conformance.documents import description_faults as faults

_OK = {"200": {"description": "well"}}


def _document(paths, version="3.1.0", **more):
    named = {"swagger": "2.0"} if version.startswith("2") else {"openapi": version}
    return {**named, "info": {"title": "t", "version": "1"}, "paths": paths, **more}


def _get(**operation):
    return {"get": {"responses": _OK, **operation}}


def _query(schema, **more):
    return {"name": "n", "in": "query", "schema": schema, **more}


_GOOD = {"/a/{b}": _get(parameters=[{"name": "b", "in": "path", "required": True, "schema": {"type": "string"}}])}
_GOOD_2 = {"/a/{b}": _get(parameters=[{"name": "b", "in": "path", "required": True, "type": "string"}])}


@pytest.mark.parametrize("version", ["3.0.3", "3.1.0", "3.1.1"])
def test_a_valid_description_has_no_fault(version):
    document = _document(_GOOD, version)
    assert faults.invalid(document) == faults.dead_references(document) == faults.repeated_ids(document) == []
    assert faults.alike_paths(document) == faults.unfitting_examples(document) == []


def test_a_valid_swagger_has_no_fault():
    assert faults.invalid(_document(_GOOD_2, "2.0")) == []


@pytest.mark.parametrize(
    ("paths", "version", "found"),
    [
        ({"/a": {"get": {"responses": {"200": {}}}}}, "3.1.0", "description"),
        ({"/a": {"get": {"responses": {"200": {}}}}}, "3.0.3", "/paths//a/get/responses/200"),
        ({"/a": {"get": {"responses": {"200": {}}}}}, "2.0", "/paths//a/get/responses/200"),
        ({"a": _get()}, "3.1.0", "a"),
        ({"/a/{b}": _get()}, "3.1.0", "does not declare its path parameter b"),
        ({"/a": _GOOD["/a/{b}"]}, "3.1.0", "which is not in the path"),
        ({"/a": _get(parameters=[_query({"type": "string", "pattern": "["})])}, "3.1.0", "is no JSON Schema"),
        ({"/a": _get(parameters=[_query({"type": "text"})])}, "3.1.0", "text"),
    ],
)
def test_an_invalid_description_says_where(paths, version, found):
    said = faults.invalid(_document(paths, version))
    assert said
    assert any(found in one for one in said), said


def test_references_that_lead_nowhere():
    document = _document({"/a": _get(parameters=[{"$ref": "#/gone"}])}, x={"example": {"$ref": "#/not/one"}})
    assert faults.dead_references(document) == ["#/gone"]


def test_ids_and_templates_occur_once():
    document = _document({"/a/{b}": _get(operationId="i"), "/a/{c}": _get(operationId="i"), "/a/d": _get()})
    assert faults.repeated_ids(document) == ["i: GET /a/{b}, GET /a/{c}"]
    assert faults.alike_paths(document) == ["/a/{b} and /a/{c}"]


def _responding(schema, **media):
    content = {"application/json": {"schema": schema, **media}}
    return {"/a": {"get": {"responses": {"200": {"description": "", "content": content}}}}}


_THING = {
    "type": "object",
    "required": ["id", "name"],
    "properties": {
        "id": {"type": "integer", "readOnly": True},
        "name": {"type": "string"},
        "secret": {"type": "string", "writeOnly": True},
    },
}


def _asking(schema, **media):
    body = {"content": {"application/json": {"schema": schema, **media}}}
    return {"/a": {"post": {"requestBody": body, "responses": {"200": {"description": ""}}}}}


@pytest.mark.parametrize(
    ("paths", "count"),
    [
        ({"/a": _get(parameters=[_query({"type": "integer"}, example="x")])}, 1),
        ({"/a": _get(parameters=[_query({"type": "integer", "default": "x"})])}, 1),
        ({"/a": _get(parameters=[_query({"type": "integer"}, examples={"e": {"value": 1}})])}, 0),
        (_responding({"type": "object", "required": ["a"]}, example={}), 1),
        (_responding({"type": "object", "properties": {"a": {"type": "string", "default": 1}}}), 1),
        (_responding({"type": "string", "nullable": True}, example=None), 0),
        (_responding({"$ref": "#/components/schemas/A"}, example="b"), 1),
        (_responding({"type": "integer", "default": None}), 0),
        (_asking(_THING, example={"name": "a"}), 0),
        (_asking(_THING, example={"id": 1}), 1),
        (_responding(_THING, example={"id": 1, "name": "a"}), 0),
        (_responding(_THING, example={"name": "a"}), 1),
        (_responding({**_THING, "example": {"name": "a"}}), 0),
        (_asking({**_THING, "required": ["secret"]}, example={"name": "a"}), 1),
        (_responding({**_THING, "required": ["secret"]}, example={"name": "a"}), 0),
    ],
)
def test_examples_and_defaults_fit_their_schemas(paths, count):
    document = _document(paths, components={"schemas": {"A": {"enum": ["a"]}}})
    assert len(faults.unfitting_examples(document)) == count
