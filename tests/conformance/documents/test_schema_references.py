"""Schemas of a description: references by pointer, id and anchor, booleans, recursion, files, YAML 1.2."""

import json
from typing import Any

import pytest

from conformance.contract.document_text import parsed
from conformance.documents.description import read_description
from conformance.documents.json_shape import shape_of
from conformance.documents.openapi import read_operations
from conformance.documents.representation import flat

BASE = "http://device.invalid/"


def _document(schema: Any, schemas: Any = None, version: str = "3.1.0") -> dict[str, Any]:
    content = {"application/json": {"schema": schema}}
    paths = {"/t": {"get": {"responses": {"200": {"description": "ok", "content": content}}}}}
    return {"openapi": version, "info": {}, "paths": paths, "components": {"schemas": schemas or {}}}


def _problem(value: Any, document: Any, **files: Any) -> str:
    """Return what is wrong with a response of GET /t by a description, whose references all lead somewhere."""
    texts = {f"{BASE}openapi.json": document, **{f"{BASE}{name}.json": one for name, one in files.items()}}
    read = read_description(f"{BASE}openapi.json", lambda url: json.dumps(texts[url]).encode())
    assert not read.unresolved
    shape = shape_of(read_operations(read.document, closed=True)[0].responses["200"]["application/json"])
    problem = shape.problem(value)
    assert shape.holds(value) == (not problem)
    return problem


TREE = {
    "T": {
        "type": "object",
        "required": ["v"],
        "properties": {
            "v": {"type": "integer"},
            "kids": {"type": "array", "items": {"$ref": "#/components/schemas/T"}},
        },
    }
}
IDS = {
    "T": {
        "$id": "https://a.invalid/t",
        "type": "object",
        "properties": {"x": {"$ref": "u"}, "y": {"$ref": "#/$defs/n"}, "z": {"$ref": "#in"}},
        "$defs": {"n": {"type": "null", "$anchor": "in"}, "U": {"$id": "u", "type": "integer"}},
    }
}
DYNAMIC = {"N": {"$dynamicAnchor": "n", "properties": {"v": {"type": "integer"}, "c": {"$dynamicRef": "#n"}}}}


def _nested(depth: int, innermost: Any) -> Any:
    value = {"v": innermost}
    for _ in range(depth):
        value = {"v": 1, "kids": [value]}
    return value


@pytest.mark.parametrize(
    ("schema", "schemas", "right", "wrong"),
    [
        ({"$ref": "#/components/schemas/T"}, TREE, _nested(60, 1), _nested(60, "x")),
        ({"$ref": "https://a.invalid/t"}, IDS, {"x": 1, "y": None, "z": None}, {"z": 3}),
        ({"$ref": "https://a.invalid/t"}, IDS, {}, {"x": "1"}),
        ({"$ref": "#other"}, {"B": {"$anchor": "other", "type": "object"}}, {}, 1),
        ({"$ref": "#/components/schemas/N"}, DYNAMIC, {"c": {"c": {"v": 1}}}, {"c": {"c": {"v": "x"}}}),
        ({"$ref": "#/components/schemas/A~1b~0c%20d"}, {"A/b~c d": {"const": None}}, None, 0),
        ({"type": "array", "items": True}, {}, [1], 1),
        ({"type": "array", "prefixItems": [{"type": "number"}], "items": False}, {}, [1], [1, 2]),
        ({"properties": {"a": False}}, {}, {}, {"a": 1}),
        ({"$schema": "urn:unknown", "type": "integer"}, {}, 1, "1"),
        ({"$ref": "#/components/schemas/N", "required": ["b"]}, {"N": {"required": ["a"]}}, {"a": 1, "b": 1}, {"b": 1}),
    ],
)
def test_a_value_is_judged_wherever_its_schema_stands(schema: Any, schemas: Any, right: Any, wrong: Any) -> None:
    document = _document(schema, schemas)
    assert _problem(right, document) == ""
    assert _problem(wrong, document) != ""


def test_a_boolean_is_a_schema() -> None:
    assert _problem({}, _document(schema=True)) == ""
    assert _problem({}, _document(schema=False)) != ""


def test_the_place_below_a_recursive_schema_is_named() -> None:
    wrong = _problem(_nested(2, "x"), _document({"$ref": "#/components/schemas/T"}, TREE, "3.0.3"))
    assert wrong == 'kids[0].kids[0].v is "x", not of type integer'


def test_openapi_3_0_ignores_constraints_beside_a_reference() -> None:
    schema, named = {"$ref": "#/components/schemas/N", "required": ["b"]}, {"N": {"required": ["a"]}}
    assert _problem({"a": 1}, _document(schema, named, "3.0.3")) == ""


_S0 = {"$ref": "#/components/schemas/S0"}
_ODD = {"properties": {"s": _S0}, "patternProperties": {"^x\\cA": {"type": "integer"}}, "additionalProperties": False}
#: Schemas that refer to themselves, in each way in which what is behind a reference is judged.
RECURSIVE = {
    "not": ({"properties": {"no": {"not": _S0}}, "required": ["a"]}, {"no": {}, "a": 1}, {"no": {"a": 1}, "a": 1}),
    "one of": (
        {"oneOf": [{"type": "null"}, {"type": "object", "properties": {"s": _S0}, "required": ["s"]}]},
        {"s": {"s": None}},
        {"s": {"s": 1}},
    ),
    "names that only ECMA-262 reads": (_ODD, {"s": {"x\x01": 1}}, {"s": {"s": {"x\x01": "a"}}}),
    "such names, refused": (
        {"properties": {"s": {"not": _ODD}}, "required": ["b"]}, {"s": {"c": 1}, "b": 1}, {"s": {}, "b": 1},
    ),
    "unevaluated": (
        {"properties": {"s": {"allOf": [_S0], "unevaluatedProperties": False}}}, {"s": {"s": {}}}, {"s": {"t": {}}},
    ),
    "large numbers": (
        {"properties": {"n": {"multipleOf": 1, "maximum": 10**25}, "s": _S0}},
        {"s": {"n": 10**25}},
        {"s": {"n": 10**26}},
    ),
    "boolean": (
        {"properties": {"s": {"anyOf": [_S0, False]}}, "required": ["a"]}, {"a": 1, "s": {"a": 1}}, {"a": 1, "s": {}},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", RECURSIVE)
def test_a_recursive_schema_is_judged_behind_its_references(name: str) -> None:
    schema, right, wrong = RECURSIVE[name]
    document = _document(_S0, {"S0": schema})
    assert _problem(right, document) == ""
    assert _problem(wrong, document) != ""


@pytest.mark.parametrize("value", [{"$ref": "elsewhere.json#/a"}, {"a": {"$ref": "#/nowhere"}}, [{"$ref": "#/paths"}]])
def test_a_constant_is_data_though_it_looks_like_a_reference(value: Any) -> None:
    document = _document(
        {"oneOf": [{"const": value}, {"enum": [value, 1]}]}, {"const": {"$ref": "#/components/schemas/T"}, **TREE}
    )
    operation = read_operations(document, closed=True)[0]
    assert shape_of(operation.responses["200"]["application/json"]).holds(1)


def test_a_property_named_const_is_a_schema() -> None:
    document = _document({"properties": {"const": {"$ref": "#/components/schemas/T"}}}, TREE)
    assert not _problem({"const": {"v": 1}}, document)
    assert _problem({"const": {"v": "a"}}, document)


@pytest.mark.parametrize("word", ["allOf", "oneOf", "anyOf"])
def test_a_schema_that_combines_itself_can_be_merged(word: str) -> None:
    itself = {"type": "object", "properties": {"n": {"type": "integer"}}, word: [{"$ref": "#/components/schemas/A"}]}
    schema = read_operations(_document({"$ref": "#/components/schemas/A"}, {"A": itself}), closed=False)[0]
    merged = flat(schema.responses["200"]["application/json"])
    assert merged["properties"] == {"n": {"type": "integer"}}


def test_files_refer_to_each_other_by_anchor_and_to_themselves() -> None:
    first = {
        "type": "object",
        "properties": {"n": {"$ref": "#"}, "m": {"$ref": "second.json#bb"}},
        "additionalProperties": False,
    }
    second = {"$defs": {"Q": {"$anchor": "bb", "type": "integer"}}}
    document = _document({"$ref": "first.json"})
    assert _problem({"n": {"n": {"m": 1}}}, document, first=first, second=second) == ""
    assert "n.n.m" in _problem({"n": {"n": {"m": "x"}}}, document, first=first, second=second)


def test_many_schemas_that_name_each_other_fit_into_memory() -> None:
    names = [f"S{i}" for i in range(60)]
    schemas = {
        name: {
            "properties": {
                "v": {"type": "integer"},
                **{f"p{j}": {"$ref": f"#/components/schemas/S{(i + j * 7 + 1) % 60}"} for j in range(12)},
            }
        }
        for i, name in enumerate(names)
    }
    wrong = _problem({"p0": {"p1": {"p2": {"v": "x"}}}}, _document({"$ref": "#/components/schemas/S0"}, schemas))
    assert "p0.p1.p2.v" in wrong


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a: Off", "Off"), ("a: no", "no"), ("a: 12:30:45", "12:30:45"), ("a: 2024-01-02", "2024-01-02"),
        ("a: 0755", "0755"), ("a: 0o17", 15), ("a: 1e-05", 1e-05), ("a: .5", 0.5), ("a: ~", None), ("a: -0", 0),
        ("a: !!str 5", "5"), ("a: '5'", "5"), ("a: 1_000", "1_000"), ("a: 1E400", 1.7976931348623157e308),
        ('{"a": 1e-05}', 1e-05), ('{"a": 123456789012345678901}', 123456789012345678901), ('\ufeff{"a": 1}', 1),
    ],
)  # fmt: skip
def test_scalars_are_those_of_yaml_1_2_and_of_json(text: str, value: Any) -> None:
    found = parsed(text.encode())["a"]
    assert found == value
    assert type(found) is type(value)


def test_keys_are_texts_and_merges_are_followed() -> None:
    assert parsed(b"x: &x {b: 1}\non: {<<: *x, 200: 2}") == {"x": {"b": 1}, "on": {"b": 1, "200": 2}}


def test_utf_16_is_read() -> None:
    assert parsed('{"a": "ö"}'.encode("utf-16")) == {"a": "ö"}


@pytest.mark.parametrize("text", ["a: &a [*a]", "[" * 100_000, "- " * 100_000, '{"a":' * 100_000, "a: ["])
def test_what_cannot_be_read_is_refused_at_once(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        parsed(text.encode())


def test_aliases_have_a_budget() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)]
    with pytest.raises(ValueError, match="aliases repeat"):
        parsed("\n".join(lines).encode())
