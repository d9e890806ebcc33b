"""Swagger 2.0 becomes OpenAPI 3.0 with the same meaning."""

import pytest

from conformance.api.rest.inputs import Inputs, request_of
from conformance.documents.description import as_openapi_3
from conformance.documents.openapi import read_operations

_TEXT = {"type": "string"}
_FORM = "application/x-www-form-urlencoded"


def _operation(given, **more):
    document = {"swagger": "2.0", "paths": {"/a": {"post": {"responses": {}, **given}}}, **more}
    (operation,) = read_operations(as_openapi_3(document))
    return operation


@pytest.mark.parametrize(
    ("format_", "style", "explode"),
    [
        ("csv", "form", False),
        ("multi", "form", True),
        ("pipes", "pipeDelimited", False),
        ("ssv", "spaceDelimited", False),
    ],
)
def test_collections_in_a_query(format_, style, explode):
    item = {"name": "n", "in": "query", "type": "array", "items": _TEXT, "collectionFormat": format_}
    (parameter,) = _operation({"parameters": [item]}).parameters
    assert (parameter.style, parameter.explode) == (style, explode)
    assert parameter.schema == {"type": "array", "items": _TEXT}


@pytest.mark.parametrize(
    ("more", "consumes", "media_type", "sent"),
    [
        ({}, [], _FORM, b"n=a%2Cb"),
        ({"collectionFormat": "multi"}, [], _FORM, b"n=a&n=b"),
        ({}, ["multipart/form-data", _FORM], _FORM, b"n=a%2Cb"),
    ],
)
def test_forms(more, consumes, media_type, sent):
    item = {"name": "n", "in": "formData", "type": "array", "items": _TEXT, "required": True, **more}
    operation = _operation({"parameters": [item], "consumes": consumes})
    assert (list(operation.bodies), operation.body_required) == ([media_type], True)
    assert request_of(operation, Inputs(body={"n": ["a", "b"]}, media_type=media_type)).body == sent


def test_a_file_is_sent_as_multipart():
    operation = _operation({"parameters": [{"name": "f", "in": "formData", "type": "file"}]})
    assert operation.bodies["multipart/form-data"].schema["properties"]["f"]["format"] == "binary"


def test_shared_parameters_bodies_responses_and_references():
    operation = _operation(
        {
            "parameters": [
                {"$ref": "#/parameters/B"},
                {"name": "h", "in": "header", "type": "integer", "x-example": 3},
            ],
            "responses": {"200": {"$ref": "#/responses/R"}, "x-note": "none"},
            "consumes": ["application/json"],
        },
        parameters={"B": {"name": "b", "in": "body", "schema": {"$ref": "#/definitions/D"}}},
        responses={
            "R": {
                "description": "",
                "schema": {"$ref": "#/definitions/D"},
                "headers": {"X-N": {"type": "integer"}},
                "examples": {"application/json": {"a": None}},
            }
        },
        definitions={"D": {"type": "object", "properties": {"a": {"type": "string", "x-nullable": True}}}},
        produces=["application/json"],
    )
    schema = {"type": "object", "properties": {"a": {"type": ["string", "null"]}}}
    assert operation.bodies["application/json"].schema == operation.shape == schema
    assert operation.headers["200"] == {"x-n": (False, {"type": "integer"})}
    assert (operation.parameters[0].examples, list(operation.responses)) == ((3,), ["200"])


def test_a_path_item_may_be_a_reference():
    document = {
        "swagger": "2.0",
        "paths": {"/a": {"$ref": "#/x-items/a"}},
        "x-items": {"a": {"get": {"responses": {}}}},
    }
    assert [one.label for one in read_operations(as_openapi_3(document))] == ["GET /a"]


@pytest.mark.parametrize(
    ("given", "found"),
    [
        ({"type": "basic"}, {"type": "http", "scheme": "basic"}),
        ({"type": "apiKey", "in": "query", "name": "k"}, {"type": "apiKey", "in": "query", "name": "k"}),
    ],
)
def test_security_schemes(given, found):
    document = as_openapi_3({"paths": {}, "securityDefinitions": {"s": given}})
    assert document["components"]["securitySchemes"] == {"s": found}
