"""Words of schemas: those of another version of OpenAPI, and which of several alternatives a text names."""

import json

import pytest

from conformance.documents.description import read_description
from conformance.documents.description_faults import invalid
from conformance.documents.json_schema import modern
from conformance.documents.json_shape import shape_of
from conformance.documents.openapi import read_operations


def _document(schema, version, **members):
    answer = {"description": "ok", "content": {"application/json": {"schema": schema}}}
    paths = {"/t": {"get": {"responses": {"200": answer}}}}
    return {"openapi": version, "info": {"title": "t", "version": "1"}, "paths": paths, **members}


_PLACE = "/paths/~1t/get/responses/200/content/application~1json/schema"
_NEW = f"a word of OpenAPI 3.1 in a document of 3.0 or 2.0, at {_PLACE}"
_OLD = f"a word of OpenAPI 3.0 in a document of 3.1 or later, at {_PLACE}"


@pytest.mark.parametrize(
    ("version", "schema", "told", "right", "wrong"),
    [
        ("3.0.3", {"type": ["integer", "null"]}, f'{{"type": ["integer", "null"]}}, {_NEW}', None, "a"),
        ("3.0.3", {"anyOf": [{"type": "null"}, {"type": "integer"}]}, f"at {_PLACE}/anyOf/0", None, "a"),
        ("3.0.3", {"exclusiveMinimum": 0}, "exclusiveMinimum as a number", 1, 0),
        ("3.0.3", {"const": 1}, "const", 1, 2),
        ("3.0.3", {"prefixItems": [{"const": 1}], "items": False}, f"prefixItems, {_NEW}", [1], [1, 2]),
        ("3.0.3", {"type": "integer", "nullable": True, "not": {"const": 3}}, f"const, {_NEW}/not", None, 3),
        ("3.0.3", {"properties": {"a": True, "b": False}}, f"false, {_NEW}/properties/b", {"a": 1}, {"b": 1}),
        ("3.1.0", {"minimum": 0, "exclusiveMinimum": True}, f'{{"exclusiveMinimum": true}}, {_OLD}', 1, 0),
        ("3.1.0", {"type": "array", "items": [{"type": "integer"}]}, "items as an array", [1], ["a"]),
    ],
)
def test_a_word_of_another_version_is_named_and_judged(version, schema, told, right, wrong):
    document = _document(schema, version)
    assert told in "; ".join(invalid(document))
    read = read_description("http://device.invalid/o.json", lambda _: json.dumps(document).encode()).document
    shape = shape_of(read_operations(read, closed=True)[0].responses["200"]["application/json"])
    assert (shape.holds(right), shape.holds(wrong)) == (True, False)


@pytest.mark.parametrize(
    "document",
    [
        _document({"type": "integer", "nullable": True, "minimum": 0, "exclusiveMinimum": True}, "3.0.3"),
        _document({"additionalProperties": False, "properties": {"const": {"type": "string"}, "if": {}}}, "3.0.3"),
        _document({"enum": [{"const": 1, "type": "null"}], "default": {"const": 1}}, "3.0.3"),
        _document({}, "3.0.3", **{"x-vendor": {"schema": {"const": 1, "type": "null"}}}),
        _document({"type": ["integer", "null"], "const": 1, "exclusiveMinimum": 0, "items": False}, "3.1.0"),
        _document({"nullable": True, "type": "string"}, "3.1.0"),
        _document({"$schema": "http://json-schema.org/draft-07/schema#", "items": [{"type": "integer"}]}, "3.1.0"),
        _document({"exclusiveMinimum": 0}, "3.1.0", jsonSchemaDialect="https://spec.openapis.org/oas/3.1/dialect/base"),
    ],
)
def test_words_of_its_own_version_and_what_is_no_schema_are_no_fault(document):
    assert invalid(document) == []


def test_other_faults_are_told_beside_such_words():
    document = _document({"const": 1, "type": "number", "minimum": "low"}, "3.0.3")
    assert [one for one in invalid(document) if "const" in one]
    assert [one for one in invalid(document) if "low" in one]


def test_numbers_of_an_integer_are_whole_and_those_of_a_number_stay():
    given = {"minimum": 1.0, "default": 60.0, "enum": [1.0, 2.5], "multipleOf": 1.0}
    whole = {"minimum": 1, "default": 60, "enum": [1, 2.5], "multipleOf": 1}
    assert json.dumps(modern({"type": "integer", **given})) == json.dumps({"type": "integer", **whole})
    assert json.dumps(modern({"type": "number", **given})) == json.dumps({"type": "number", **given})


def _object(**members):
    return {"type": "object", "required": sorted(members), "properties": members}


_DOG = _object(kind={"const": "dog"}, bark={"type": "string"})
_CAT = _object(kind={"enum": ["cat"]}, meow={"type": "integer"})
_SIZED = {"anyOf": [{"type": "null"}, _object(size=_object(w={"type": "number"}))]}
_NONE_FITS = "is not valid under any of the given schemas"
CASES = (
    # the alternatives, the value, what is said of it
    ([_DOG, _CAT], {"kind": "cat", "meow": "x"}, 'it.meow is "x", not of type integer'),
    ([_DOG, _CAT], {"kind": "cat"}, "it.meow is missing"),
    ([_CAT, _DOG], {"kind": "dog"}, "it.bark is missing"),
    ([_CAT, _DOG], {"kind": "dog", "bark": 1}, "it.bark is 1, not of type string"),
    ([_DOG, _CAT], {"kind": "bird"}, _NONE_FITS),
    ([_DOG, _CAT], {}, _NONE_FITS),
    ([_DOG, _CAT], 5, _NONE_FITS),
    ([{"type": "null"}, _CAT], {"kind": "cat"}, "it.meow is missing"),
    ([{"type": "string", "pattern": "^a"}, {"type": "integer", "minimum": 5}], 3, "less than the minimum of 5"),
    ([{"type": "string", "pattern": "^a"}, {"type": "integer", "minimum": 5}], "b", "does not match '^a'"),
    ([{"type": "string"}, _SIZED], {"size": {"w": "x"}}, 'it.size.w is "x", not of type number'),
)


@pytest.mark.parametrize("word", ["oneOf", "anyOf"])
@pytest.mark.parametrize(("alternatives", "value", "said"), CASES)
def test_the_alternative_that_fits_best_is_named(word, alternatives, value, said):
    assert said in shape_of(modern({word: alternatives})).problem(value, "it")


def test_a_discriminator_chooses_where_several_alternatives_allow_a_value():
    tool = _object(kind={"enum": ["gripper", "drill"]})
    chosen = {"oneOf": [tool, dict(tool)], "discriminator": {"propertyName": "kind"}}
    assert shape_of(modern(chosen)).problem({"kind": "drill"}, "it") == ""
    assert shape_of(modern({"oneOf": chosen["oneOf"]})).problem({"kind": "drill"}, "it")
