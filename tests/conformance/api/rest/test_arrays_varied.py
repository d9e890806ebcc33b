"""Arrays among the requests of the survey: of equal items where they are to be unique, and of several in each style."""

import pytest

from conformance.api.rest.inputs import Inputs, request_of
from conformance.api.rest.invalid_variations import invalid_variations
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Kind, valid_variations
from conformance.documents.openapi import read_operations

_TEXTS = {"type": "array", "items": {"type": "string"}}
_NUMBERS = {"type": "array", "items": {"type": "integer"}}
_WORDS = {"type": "array", "items": {"enum": ["a", "b"]}}


def _operation(parameter=None, member=None):
    body = {"type": "object", "required": ["list"], "properties": {"list": member or {}}}
    given = {"parameters": [{"in": "query", "name": "list", **parameter}]} if parameter else {}
    given |= {"requestBody": {"content": {"application/json": {"schema": body}}}} if member else {}
    document = {"openapi": "3.1.0", "paths": {"/things": {"post": {**given, "responses": {"200": {}}}}}}
    return read_operations(document)[0]


@pytest.mark.parametrize(
    "schema",
    [
        _TEXTS,
        _NUMBERS,
        {"type": "array", "items": {"type": "string", "enum": ["red", "green"]}},
        {"type": "array", "items": {"type": "object", "properties": {"a": {"type": "integer"}}}},
        {**_NUMBERS, "minItems": 3},
        {"type": "array", "items": {"type": "boolean"}},
    ],
)
def test_equal_items_are_sent_where_items_are_unique(schema):
    usual = Inputs(body={"list": []}, media_type="application/json")

    def doubled(member):
        found = invalid_variations(_operation(member=member), usual)
        return [one.inputs.body["list"] for one in found if isinstance(one.inputs.body, dict) and "equal" in one.says]

    assert [len(one) >= 2 and one[0] == one[1] for one in doubled({**schema, "uniqueItems": True})] == [True]
    assert doubled(schema) == []


def test_equal_items_are_sent_in_a_query():
    usual = Inputs(query={"list": [1]})
    once = {"schema": {**_NUMBERS, "uniqueItems": True}}
    assert any("equal" in one.says for one in invalid_variations(_operation(once), usual))


@pytest.mark.parametrize(
    ("style", "schema", "query"),
    [
        ({"style": "pipeDelimited", "explode": False}, _NUMBERS, "list=1%7C2"),
        ({"style": "spaceDelimited", "explode": False}, _NUMBERS, "list=1%202"),
        ({"style": "form", "explode": False}, _NUMBERS, "list=1,2"),
        ({"style": "form"}, _NUMBERS, "list=1&list=2"),
        ({"style": "pipeDelimited", "explode": False}, _WORDS, "list=a%7Cb list=a list=b"),
        ({"style": "pipeDelimited", "explode": False}, {**_NUMBERS, "maxItems": 1}, ""),
    ],
)
def test_several_items_are_sent_in_their_style(style, schema, query):
    operation = _operation({**style, "schema": schema})
    sent = [
        request_of(operation, one.inputs).target.partition("?")[2]
        for one in valid_variations(operation, Inputs(), Values())
        if one.kind is Kind.BOUND
    ]
    assert sent == query.split()
