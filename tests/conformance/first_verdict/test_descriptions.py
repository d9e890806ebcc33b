"""Descriptions of each version are read as they are meant: right devices pass, their wrong twins fail at each place."""

import json

import pytest
from small_device import certified, constant, described, object_of, reading, small_device


def _with(name, schema):
    """Return the schema of an object that must have one member."""
    return {"type": "object", "required": [name], "properties": {name: schema}}


_CAT = object_of("kind", "lives", kind={"const": "cat"}, lives={"type": "integer"})
_DOG = object_of("kind", "bark", kind={"const": "dog"}, bark={"type": "boolean"})
_X = _with("x", {"type": "number"})
_SCHEMAS = {
    "Cat": _CAT,
    "Dog": _DOG,
    "Alias": {"$ref": "#/components/schemas/Again"},
    "Again": {"$ref": "#/components/schemas/Cat"},
    "Tree": {
        "type": "object",
        "required": ["v"],
        "additionalProperties": {"$ref": "#/components/schemas/Tree"},
        "properties": {"v": {"type": "integer"}},
    },
    "Even": _with("n", {"$ref": "#/components/schemas/Odd"}),
    "Odd": {"anyOf": [{"type": "null"}, {"$ref": "#/components/schemas/Even"}]},
    "Holder": {"type": "object", "properties": {"a/b~c d": _X, "straße": _X}},
}
_DISCRIMINATED = {
    "oneOf": [{"$ref": "#/components/schemas/Cat"}, {"$ref": "#/components/schemas/Dog"}],
    "discriminator": {"propertyName": "kind", "mapping": {"cat": "#/components/schemas/Cat", "dog": "Dog"}},
}
_BASE = _with("id", {"type": "integer"})
_IF = {
    "type": "object",
    "required": ["mode"],
    "properties": {"mode": {"enum": ["on", "off"]}},
    "if": {"properties": {"mode": {"const": "on"}}},
    "then": {"required": ["rpm"]},
    "else": {"not": {"required": ["rpm"]}},
}
# For each path: a schema of OpenAPI 3.1, a value that is valid by it, and one that is not.
_MODERN = {
    "/prefix": (
        {"type": "array", "prefixItems": [{"type": "number"}, {"type": "string"}], "items": False},
        [1, "a"],
        [1, "a", 2],
    ),
    "/tuple-rest": (
        {"type": "array", "prefixItems": [{"const": "t"}], "items": {"type": "integer"}},
        ["t", 1],
        ["t", "u"],
    ),
    "/if": (_IF, {"mode": "on", "rpm": 2}, {"mode": "on"}),
    "/else": (_IF, {"mode": "off"}, {"mode": "off", "rpm": 2}),
    "/const-null": (_with("x", {"const": None}), {"x": None}, {"x": 0}),
    "/type-array": (
        {"type": ["object", "null"], "required": ["a"], "properties": {"a": {"type": ["integer", "null"]}}},
        {"a": None},
        {"a": "b"},
    ),
    "/bounds": (_with("a", {"exclusiveMinimum": 0, "exclusiveMaximum": 1, "type": "number"}), {"a": 0.5}, {"a": 1}),
    "/dependent": (
        {"type": "object", "dependentSchemas": {"a": {"required": ["b"]}}, "dependentRequired": {"c": ["d"]}},
        {"a": 1, "b": 2},
        {"a": 1},
    ),
    "/unevaluated": (
        {"allOf": [_BASE], "properties": {"own": True}, "unevaluatedProperties": {"type": "string"}},
        {"id": 1, "own": 2, "x": "y"},
        {"id": 1, "x": 2},
    ),
    "/pattern": (
        {"type": "object", "patternProperties": {"^j[0-9]$": {"type": "number"}}, "propertyNames": {"maxLength": 3}},
        {"j1": 1.5},
        {"j1": "a"},
    ),
    "/contains": ({"type": "array", "contains": {"const": "ok"}, "minContains": 2}, ["ok", 1, "ok"], ["ok", 1]),
    "/defs": (
        {
            "$defs": {"n": {"type": "integer"}},
            "type": "object",
            "required": ["a"],
            "properties": {"a": {"$ref": "#/paths/~1defs/get/responses/200/content/application~1json/schema/$defs/n"}},
        },
        {"a": 1},
        {"a": "b"},
    ),
    "/beside": (
        {"$ref": "#/components/schemas/Cat", "required": ["age"], "maxProperties": 3},
        {"kind": "cat", "lives": 9, "age": 1},
        {"kind": "cat", "lives": 9},
    ),
    "/not-false": (object_of(a={"not": False}, b=False), {"a": 1}, {"b": 1}),
    "/any": ({"type": "array", "items": True}, [1, None], {}),
    "/encoded": (
        _with("png", {"type": "string", "contentEncoding": "base64", "contentMediaType": "image/png"}),
        {"png": "iVBORw0="},
        {"png": 1},
    ),
    "/examples": (_with("a", {"type": "integer", "examples": [1, 2]}), {"a": 3}, {"a": "x"}),
}
# The same of OpenAPI 3.0.
_OLD = {
    "/nullable": (_with("a", {"type": "integer", "nullable": True}), {"a": None}, {"a": "b"}),
    "/nullable-ref": (
        _with("c", {"nullable": True, "allOf": [{"$ref": "#/components/schemas/Cat"}]}),
        {"c": None},
        {"c": 1},
    ),
    "/bounds-3.0": (_with("a", {"minimum": 0, "exclusiveMinimum": True, "type": "number"}), {"a": 0.5}, {"a": 0}),
    "/beside-3.0": (
        {"$ref": "#/components/schemas/Cat", "required": ["age"]},
        {"kind": "cat", "lives": 9},
        {"kind": "cat"},
    ),
}
_EITHER = {
    "/pet": (_DISCRIMINATED, {"kind": "dog", "bark": True}, {"kind": "dog", "lives": 9}),
    "/alias": ({"$ref": "#/components/schemas/Alias"}, {"kind": "cat", "lives": 9}, {"kind": "cat"}),
    "/tree": (
        {"$ref": "#/components/schemas/Tree"},
        {"v": 1, "l": {"v": 2, "m": {"v": 3}}},
        {"v": 1, "l": {"v": 2, "m": {}}},
    ),
    "/even": ({"$ref": "#/components/schemas/Even"}, {"n": {"n": None}}, {"n": {"n": {"n": 1}}}),
    "/escaped": ({"$ref": "#/components/schemas/Holder/properties/a~1b~0c%20d"}, {"x": 1}, {"x": "y"}),
    "/percent": ({"$ref": "#/components/schemas/Holder/properties/stra%C3%9Fe"}, {"x": 1}, {"x": "y"}),
    "/deep": (
        {
            "allOf": [
                {
                    "anyOf": [
                        {"oneOf": [{"allOf": [_BASE, {"maxProperties": 2}]}, {"type": "array", "items": {}}]},
                        {"type": "boolean"},
                    ]
                }
            ]
        },
        {"id": 1},
        {"id": "x"},
    ),
    "/closed": ({"type": "object", "additionalProperties": {"type": "integer"}}, {"a": 1}, {"a": "b"}),
}


def _device(shapes, version, which):
    paths = {path: reading(schema) for path, (schema, _, _) in shapes.items()}
    schemas = (
        _SCHEMAS
        if version >= "3.1"
        else json.loads(
            json.dumps(_SCHEMAS)
            .replace('"const": "cat"', '"enum": ["cat"]')
            .replace('"const": "dog"', '"enum": ["dog"]')
            .replace('{"type": "null"}', '{"nullable": true, "enum": [null]}')
        )
    )
    document = described(paths, version, components={"schemas": schemas})
    return small_device(document, {path: constant(values[which]) for path, (_, *values) in shapes.items()})


@pytest.mark.parametrize(("shapes", "version"), [({**_MODERN, **_EITHER}, "3.1.0"), ({**_OLD, **_EITHER}, "3.0.3")])
def test_a_right_device_passes_and_its_wrong_twin_fails_at_each_place(shapes, version, tmp_path):
    with _device(shapes, version, 0) as url:
        right = certified(f"{url}/openapi.json", tmp_path / "right")
    assert (right.exit_code, right.blamed) == (0, {}), right.text
    with _device(shapes, version, 1) as url:
        wrong = certified(f"{url}/openapi.json", tmp_path / "wrong", "--class", "description")
    named = {one["operation"] for one in wrong.result["api"]["operations"] if one["findings"]}
    assert named == {f"GET {path}" for path in shapes}, wrong.text
    assert set(wrong.blamed) == {"description/body-schema"}
