"""What differs between what was written and what is read."""

import re

import pytest

from conformance.api.rest.things import as_answered, differences, path_chosen, with_items
from conformance.documents.openapi import read_operations

_SCHEMA = {
    "type": "object",
    "properties": {
        "positions": {"type": "array", "items": {"type": "number"}},
        "names": {"type": "array", "items": {"type": "string"}},
        "count": {"type": "integer"},
        "level": {"type": "number"},
        "gain": {"type": "number", "description": "dB, in steps of 3"},
        "flag": {"type": "boolean"},
        "steps": {"type": "array", "items": {"properties": {"a": {"type": "integer"}, "rank": {"type": "integer"}}}},
    },
}


@pytest.mark.parametrize(
    ("sent", "seen", "differs"),
    [
        ({"positions": [1, 2]}, {"positions": [1.0, 2.0]}, False),
        ({"positions": [0.1 + 0.2]}, {"positions": [0.3]}, False),
        ({"positions": [1, 2]}, {"positions": [1.0, -2.0]}, True),
        ({"positions": [1, 2]}, {"positions": [1.0]}, True),
        ({"names": ["b", "A"]}, {"names": ["a", "b "]}, False),
        ({"names": ["b"]}, {"names": ["c"]}, True),
        ({"count": 3}, {"count": 3.0}, False),
        ({"count": 3}, {"count": 4}, True),
        ({"level": 1}, {"level": 1.0000001}, False),
        ({"gain": 4}, {"gain": 3}, False),
        ({"flag": True}, {"flag": False}, True),
        ({"flag": True}, {}, False),
        ({"steps": [{"a": 1}, {"a": 2}]}, {"steps": [{"a": 2, "b": 1}, {"a": 1}]}, False),
        ({"steps": [{"a": 1}, {"a": 2}]}, {"steps": [{"a": 1}, {"a": 1}]}, True),
        ({"steps": [{"a": 1}, {"a": 2}]}, {"steps": [{"a": 3}]}, False),  # put together
        ({"steps": [{"a": 1}, {"a": 2}, {"a": 3}]}, {"steps": [{"a": 1}, {"a": 2}]}, True),
        ({"steps": [{"a": 1, "rank": 7}]}, {"steps": [{"a": 1, "rank": 1}]}, False),
    ],
)
def test_numbers_are_compared_as_numbers_and_texts_without_their_form(sent, seen, differs):
    assert bool(list(differences(sent, seen, _SCHEMA, _SCHEMA, frozenset()))) is differs


@pytest.mark.parametrize(("most", "count"), [(9, 3), (2, 2), (1, 1)])
def test_lists_of_objects_get_as_many_different_items_as_may_be(most, count):
    schema = {"properties": {"steps": {**_SCHEMA["properties"]["steps"], "type": "array", "maxItems": most}}}
    made = with_items(schema, {"steps": [{"a": 1}]}, 1, frozenset())["steps"]
    assert len({one["a"] for one in made}) == len(made) == count


@pytest.mark.parametrize(("more", "count"), [({"maxItems": 20}, 12), ({"maxItems": 3}, 3), ({}, 2)])
def test_whole_items_have_optional_members_and_are_many_where_the_schema_says_how_many(more, count):
    item = {"type": "object", "required": ["a"], "properties": {"a": {"type": "integer"}, "b": {"type": "boolean"}}}
    schema = {"properties": {"steps": {"type": "array", "items": item, **more}}}
    made = with_items(schema, {"steps": [{"a": 1}]}, 1, frozenset(), whole=True)["steps"]
    assert len(made) == count
    assert {one["b"] for one in made} == {True, False}


@pytest.mark.parametrize(
    ("schema", "given", "form"),
    [
        ({"type": "string"}, {}, r"/parcels/roaas-7"),
        ({"type": "string", "pattern": "^[A-Z]{2}[0-9]{4}$"}, {}, r"/parcels/[A-Z]{2}\d{4}"),
        ({"type": "string", "pattern": "^[a-z]+$", "maxLength": 4}, {"example": "abcd"}, r"/parcels/(?!abcd)[a-z]{4}"),
        ({"type": "integer", "maximum": 5000}, {}, r"/parcels/\d{1,4}"),
        ({"type": "string", "enum": ["left", "right"]}, {}, ""),
    ],
)
def test_a_client_chooses_identifiers_that_the_schema_allows(schema, given, form):
    parameter = {"name": "code", "in": "path", "required": True, "schema": schema, **given}
    paths = {"/parcels/{code}": {"get": {"parameters": [parameter], "responses": {"200": {"description": "x"}}}}}
    (read,) = read_operations({"openapi": "3.1.0", "info": {"title": "t", "version": "1"}, "paths": paths})
    assert re.fullmatch(form, path_chosen(read, 7))
    assert path_chosen(read, 7) != path_chosen(read, 8) or not form


@pytest.mark.parametrize(
    ("says", "taken"),
    [
        ("Replaces all settings. GET then returns them unchanged.", 0),
        ("Stores the value exactly as sent.", 0),
        ("Replaces all settings.", 50),
        ("Members that are left out stay unchanged.", 50),
        ("Returns the settings. What was left out is unchanged.", 50),
    ],
)
def test_a_device_that_promises_what_was_sent_takes_no_other_value(says, taken):
    schema = {"properties": {"brightness": {"type": "integer"}}}
    assert as_answered({"brightness": 0}, {"brightness": 50}, {"brightness": 40}, schema, says) == {"brightness": taken}
