"""Descriptions that are right, and each of their members replaced by a value of another type."""

import copy
from collections.abc import Iterator
from typing import Any

WRONG: tuple[Any, ...] = (5, "x", None, True, [], [5], {}, {"x": 5})
_TEXT = {"type": "string"}
_PART = {
    "type": "object",
    "required": ["name"],
    "additionalProperties": _TEXT,
    "discriminator": {"propertyName": "kind", "mapping": {"a": "#/components/schemas/Part"}},
    "properties": {
        "name": {"type": "string", "enum": ["a", "b"], "example": "a"},
        "tags": {"type": "array", "items": {"anyOf": [_TEXT, {"not": {"type": "null"}}]}, "prefixItems": [_TEXT]},
        "next": {"$ref": "#/components/schemas/Part"},
    },
    "allOf": [{"patternProperties": {"^x": _TEXT}, "if": {}, "then": {}, "dependentRequired": {"name": []}}],
}
_OK = {"description": "ok"}
_REF = {"$ref": "#/components/schemas/Part"}
OPENAPI: dict[str, Any] = {
    "openapi": "3.1.0",
    "info": {"title": "Parts", "version": "1", "contact": {"name": "x"}},
    "servers": [{"url": "http://{host}:1/", "variables": {"host": {"default": "127.0.0.1", "enum": ["127.0.0.1"]}}}],
    "security": [{"token": []}],
    "tags": [{"name": "a"}],
    "x-roaas": {"a": 1},
    "paths": {
        "/parts/{id}": {
            "parameters": [
                {"name": "id", "in": "path", "required": True, "schema": {"type": "integer"}, "example": 1}
            ],
            "servers": [{"url": "/"}],
            "get": {
                "operationId": "part",
                "tags": ["a"],
                "parameters": [
                    {"name": "q", "in": "query", "content": {"application/json": {"schema": _REF}}},
                    {"name": "l", "in": "query", "style": "form", "explode": False,
                     "schema": {"type": "array", "items": _TEXT}, "examples": {"one": {"value": ["a"]}}},
                    {"$ref": "#/components/parameters/X"},
                ],
                "responses": {
                    "200": {
                        "description": "ok",
                        "headers": {"X-A": {"schema": _TEXT, "required": True}},
                        "content": {"application/json": {"schema": _REF, "example": {"name": "a"}}},
                        "links": {"next": {"operationId": "part", "parameters": {"id": "$response.body#/name"}}},
                    },
                    "default": {"$ref": "#/components/responses/Problem"},
                },
                "x-roaas-stop": False,
            },
            "post": {
                "security": [],
                "requestBody": {
                    "required": True,
                    "content": {
                        "application/json": {"schema": _REF, "examples": {"one": {"value": {"name": "a"}}}},
                        "multipart/form-data": {
                            "schema": {"type": "object", "properties": {"file": {"type": "string"}}},
                            "encoding": {"file": {"contentType": "image/png", "headers": {"X-B": {"schema": _TEXT}}}},
                        },
                    },
                },
                "responses": {"201": {"description": "made"}, "4XX": {"description": "no"}},
                "callbacks": {"done": {"{$request.body#/url}": {"post": {"responses": {"200": _OK}}}}},
            },
        },
        "/old": {"$ref": "#/components/pathItems/Old"},
    },
    "components": {
        "schemas": {"Part": _PART},
        "parameters": {"X": {"name": "x", "in": "header", "schema": _TEXT}},
        "responses": {"Problem": {"description": "no", "content": {"application/problem+json": {"schema": {}}}}},
        "pathItems": {"Old": {"get": {"responses": {"200": {"description": "ok"}}}}},
        "securitySchemes": {
            "token": {"type": "http", "scheme": "bearer"},
            "key": {"type": "apiKey", "in": "query", "name": "k"},
            "flow": {"type": "oauth2", "flows": {"clientCredentials": {"tokenUrl": "http://a/t", "scopes": {}}}},
        },
    },
    "webhooks": {"new": {"post": {"responses": {"200": {"description": "ok"}}}}},
}  # fmt: skip
SWAGGER: dict[str, Any] = {
    "swagger": "2.0",
    "info": {"title": "Parts", "version": "1"},
    "host": "127.0.0.1:1",
    "basePath": "/api",
    "schemes": ["http"],
    "consumes": ["application/json"],
    "produces": ["application/json"],
    "security": [{"key": []}],
    "paths": {
        "/parts/{id}": {
            "parameters": [{"name": "id", "in": "path", "required": True, "type": "integer", "minimum": 1}],
            "get": {
                "parameters": [
                    {
                        "name": "l",
                        "in": "query",
                        "type": "array",
                        "items": {"type": "string"},
                        "collectionFormat": "csv",
                    },
                    {"$ref": "#/parameters/X"},
                ],
                "produces": ["application/json"],
                "responses": {
                    "200": {
                        "description": "ok",
                        "schema": {"$ref": "#/definitions/Part"},
                        "headers": {"X-A": {"type": "string"}},
                        "examples": {"application/json": {"name": "a"}},
                    },
                    "default": {"$ref": "#/responses/Problem"},
                },
            },
            "put": {
                "consumes": ["application/json"],
                "parameters": [{"name": "body", "in": "body", "schema": {"$ref": "#/definitions/Part"}}],
                "responses": {"204": {"description": "ok"}},
            },
            "post": {
                "parameters": [
                    {"name": "file", "in": "formData", "type": "file"},
                    {"name": "n", "in": "formData", "type": "string", "enum": ["a"]},
                ],
                "responses": {"201": {"description": "ok"}},
            },
        }
    },
    "definitions": {"Part": {"type": "object", "properties": {"name": {"type": "string"}}, "required": ["name"]}},
    "parameters": {"X": {"name": "x", "in": "header", "type": "string"}},
    "responses": {"Problem": {"description": "no", "schema": {"type": "object"}}},
    "securityDefinitions": {
        "key": {"type": "apiKey", "in": "query", "name": "k"},
        "flow": {"type": "oauth2", "flow": "application", "tokenUrl": "http://a/t", "scopes": {"s": "x"}},
    },
}


def places(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the place of each member of a document."""
    members = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for name, member in members:
        yield (*place, name)
        yield from places(member, (*place, name))


def with_wrong(document: dict[str, Any], place: tuple[Any, ...], wrong: Any) -> dict[str, Any]:
    """Return a document with another value at a place."""
    changed = copy.deepcopy(document)
    part: Any = changed
    for name in place[:-1]:
        part = part[name]
    part[place[-1]] = wrong
    return changed
