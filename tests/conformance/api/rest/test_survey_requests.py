"""Usual requests are valid, each variation differs in one thing, and what is called invalid is so for any reader."""

import json

import pytest

from conformance.api.rest.inputs import NOTHING, Inputs, request_of, usual_inputs
from conformance.api.rest.invalid_variations import invalid_variations
from conformance.api.rest.samples import fits
from conformance.api.rest.validity import json_fault
from conformance.api.rest.values import Values
from conformance.api.rest.variations import (
    Kind,
    least_inputs,
    most_references,
    odd_variations,
    together,
    unknown_variations,
    valid_variations,
)
from conformance.documents.openapi import read_operations
from conformance.documents.writing import json_text
from conformance.transport.exchange import Exchange, Request, Response

_POSE = {
    "type": "object",
    "required": ["x", "id"],
    "properties": {
        "id": {"type": "integer", "readOnly": True},
        "x": {"type": "number", "minimum": 0, "maximum": 2},
        "frame": {"enum": ["map", "odom"], "default": "map"},
        "inner": {"type": "object", "required": ["y"], "properties": {"y": {"type": "string", "maxLength": 3}}},
    },
}


def _operation(method="post", path="/a/{id}", parameters=(), body=None, media_type="application/json"):
    given = {"responses": {}, "parameters": [*parameters]}
    if body is not None:
        given["requestBody"] = {"required": True, "content": {media_type: {"schema": body}}}
    (found,) = read_operations({"paths": {path: {method: given}}}, closed=True)
    return found


def _item(name, schema, where="query", **more):
    return {"name": name, "in": where, "schema": schema, "required": where == "path", **more}


_MANY = _operation(
    parameters=[
        _item("id", {"anyOf": [{"type": "integer"}, {"type": "string"}]}, "path"),
        _item("id", {"type": "integer", "minimum": 4}, required=True),
        _item("n", {"type": "integer", "maximum": 9}),
        _item("many", {"type": "array", "items": {"type": "string"}, "minItems": 2}, required=True, explode=False),
        _item("X-H", {"type": "boolean"}, "header", required=True),
        _item("c", {"type": "string"}, "cookie", required=True),
    ],
    body=_POSE,
)


def test_the_usual_request_has_what_is_required():
    inputs = usual_inputs(_MANY, Values())[0]
    request = request_of(_MANY, inputs)
    assert request.target == "/a/1?id=4&many=roaas,roaas"
    assert dict(request.headers) == {"X-H": "true", "Cookie": "c=roaas", "Content-Type": "application/json"}
    assert json.loads(request.body) == {"x": 0}


@pytest.mark.parametrize(
    ("media_type", "schema", "body"),
    [
        ("application/x-www-form-urlencoded", {"type": "object", "example": {"a": "b c"}}, b"a=b+c"),
        ("text/plain", {"type": "string", "example": "go"}, b"go"),
        ("application/vnd.x+json", {"type": "integer"}, b"1"),
        ("application/json", {"type": "string"}, b'"roaas"'),
    ],
)  # fmt: skip
def test_bodies_are_written_by_their_media_types(media_type, schema, body):
    operation = _operation(path="/a", body=schema, media_type=media_type)
    request = request_of(operation, usual_inputs(operation, Values())[0])
    assert (request.media_type, request.body) == (media_type, body)


def _variations(operation, of):
    return list(of(operation, usual_inputs(operation, Values())[0]))


def test_valid_variations_fit():
    usual = usual_inputs(_MANY, Values())[0]
    found = list(valid_variations(_MANY, usual, Values()))
    schema = _MANY.bodies["application/json"].schema
    assert all(fits(schema, one.inputs.body) and one.inputs != usual for one in found)
    assert {(one.kind, one.place) for one in found} >= {
        (Kind.BOUND, "query n"),
        (Kind.BOUND, "body /x"),
        (Kind.ENUM, "body /frame"),
        (Kind.DEFAULT, "body /frame"),
        (Kind.OPTIONAL, "body /inner"),
        (Kind.ENUM, "header X-H"),
    }


def test_the_default_of_a_path_parameter_is_not_tried():
    ways = [{"type": "string", "format": "integer", "default": 0}, {"type": "integer"}]
    item = _item("id", {"anyOf": ways, "example": 3}, "path")
    usual = usual_inputs(operation := _operation(parameters=[item]), Values())[0]
    assert Kind.DEFAULT not in {one.kind for one in valid_variations(operation, usual, Values())}


def test_members_are_tried_together_and_each_of_their_values_once():
    usual = usual_inputs(_MANY, Values())[0]
    found = list(valid_variations(_MANY, usual, Values()))
    few = together(_MANY, usual, found)
    schema, of_body = _MANY.bodies["application/json"].schema, [one for one in found if one.place.startswith("body /")]
    assert len(few) < len(found)
    assert all(fits(schema, one.inputs.body) for one in few)
    assert sorted(part.says for one in few for part in one.parts or [one]) == sorted(one.says for one in found)
    for one in (one for one in few if one.parts):
        at = {part.place.removeprefix("body /").split("/")[0]: part.inputs.body for part in one.parts}
        assert all(one.inputs.body[name] == body[name] for name, body in at.items() if name != "inner")
    assert max(len(one.parts) for one in few) >= 3
    assert of_body


def test_a_merge_patch_may_leave_out_what_is_required():
    operation = _operation("patch", "/a", body=_POSE, media_type="application/merge-patch+json")
    kinds = {one.kind for one in _variations(operation, invalid_variations) if one.place.startswith("body /")}
    assert Kind.INVALID in kinds
    assert Kind.MISSING not in kinds


def test_a_bound_is_exceeded_beside_a_filter_too():
    parameters = [_item("limit", {"type": "integer", "minimum": 1, "maximum": 9}), _item("open", {"type": "boolean"})]
    found = _variations(_operation("get", "/a", parameters), invalid_variations)
    sent = [one.inputs.query for one in found if "limit" in one.inputs.query]
    assert {(one["limit"], one.get("open")) for one in sent} >= {
        (0, None), (10, None), (10, True),
    }  # fmt: skip


@pytest.mark.parametrize("more", [[], ["text/csv"], ["text/csv", "text/html"]])
def test_a_wrong_value_is_sent_for_each_format_of_the_response(more):
    answer = {"content": {name: {"schema": {}} for name in ("application/json", *more)}}
    given = {"parameters": [_item("max", {"type": "integer", "maximum": 9})], "responses": {"200": answer}}
    (operation,) = read_operations({"paths": {"/a": {"get": given}}}, closed=True)
    found = [one.inputs.accept for one in _variations(operation, invalid_variations) if one.inputs.query == {"max": 10}]
    assert sorted(found) == ["", *more]


@pytest.mark.parametrize(("known", "sent"), [(3, [2, 3]), (2, [])])
def test_as_many_known_references_as_may_be_are_sent_after_all_but_one(known, sent):
    body = {"type": "object", "properties": {"lamp_ids": {"type": "array", "items": {"type": "string"}, "maxItems": 3}}}
    operation, values = _operation("post", "/orders", body=body), Values({}, frozenset({"lamp"}))
    (lamps,) = read_operations({"paths": {"/lamps": {"get": {"responses": {}}}}}, closed=True)
    listed = json.dumps([{"id": f"l{number}"} for number in range(known)]).encode()
    answer = Response(200, (("Content-Type", "application/json"),), listed, 1.0)
    values.learn(lamps, Exchange(Request("GET", "http://device/lamps", (), b""), answer))
    (usual, *_) = usual_inputs(operation, values)
    found = [
        (len(fewer.body["lamp_ids"]), len(most.inputs.body["lamp_ids"]))
        for fewer, most in most_references(operation, usual, values)
    ]
    assert found == ([tuple(sent)] if sent else [])


def test_the_least_creation_has_what_is_required_alone():
    body = {"type": "object", "required": ["a"], "properties": {"a": {"type": "integer"}, "b": {"type": "integer"}}}
    usual = Inputs(body={"a": 1, "b": 2}, media_type="application/json")
    least = least_inputs(_operation("post", "/a", body=body), usual)
    assert least is not None
    assert least.body == {"a": 1}
    assert least_inputs(_operation("put", "/a", body=body), usual) is None
    assert least_inputs(_operation("post", "/a", body=body), least) is None


def test_invalid_variations_do_not_fit():
    found = _variations(_MANY, invalid_variations)
    schema = _MANY.bodies["application/json"].schema
    bodies = [one.inputs.body for one in found if one.place.startswith("body /")]
    assert not any(fits(schema, body) for body in bodies)
    places = {(one.kind, one.place) for one in found}
    assert places >= {
        (Kind.MISSING, "query id"),
        (Kind.INVALID, "query id"),
        (Kind.INVALID, "query n"),
        (Kind.MISSING, "header X-H"),
        (Kind.MISSING, "body"),
        (Kind.MISSING, "body /x"),
        (Kind.INVALID, "body /x"),
        (Kind.INVALID, "body /frame"),
        (Kind.MALFORMED, "body"),
    }
    assert not any(place.rpartition("/")[2] == "id" or place == "path id" for _, place in places)


_NUMBERS = {"type": "array", "items": {"type": "number"}}


@pytest.mark.parametrize(
    ("schema", "place", "body"),
    [
        ({"type": "number"}, "/room", {"room": False}),
        (_NUMBERS, "/room/0", {"room": [False]}),
        ({**_NUMBERS, "minItems": 2}, "/room/0", {"room": [False, 1]}),
        ({"type": "object", "properties": {"max": _NUMBERS}}, "/room/max/0", {"room": {"max": [False]}}),
        ({"type": "array", "items": {"properties": {"a": {"type": "integer"}}, "type": "object"}}, "/room/0/a",
         {"room": [{"a": False}]}),
    ],
)  # fmt: skip
@pytest.mark.parametrize("required", [True, False])
def test_a_truth_value_stands_for_no_number_however_deep(schema, place, body, required):
    whole = {"type": "object", "properties": {"room": schema}, "required": ["room"] if required else []}
    found = _variations(_operation(path="/a", body=whole), invalid_variations)
    assert [one.inputs.body for one in found if one.place == f"body {place}" and False in _scalars(one.inputs)] == [
        body
    ]


_AXIS = {"type": "object", "properties": {"um": {"type": "integer", "minimum": 2}}, "additionalProperties": False}


@pytest.mark.parametrize("axis", [_AXIS, {"oneOf": [_AXIS, {"type": "null"}], "default": None}])
@pytest.mark.parametrize("wrong", [{"um": 2.5}, {"um": 2, "roaas_unknown": 1}])
def test_fractions_and_unknown_members_are_sent_within_objects(axis, wrong):
    found = _variations(_operation(path="/a", body={"type": "object", "properties": {"z": axis}}), invalid_variations)
    assert {"z": wrong} in [one.inputs.body for one in found]


@pytest.mark.parametrize(
    ("member", "fractions"),
    [
        ({"enum": [1, 2]}, [1.5]),
        ({"const": 4}, [1.5]),
        ({"oneOf": [{"type": "integer", "maximum": -3}, {"type": "null"}]}, [-2.5]),
        ({"type": "integer", "minimum": 0.5}, [-0.5, 0.5]),
        ({"type": "integer", "minimum": "2"}, []),
        ({"anyOf": [{"type": "string"}, {"type": "integer"}]}, []),
        ({"anyOf": [{"type": "integer"}, {"type": "number"}]}, []),
    ],
)
def test_a_fraction_is_sent_for_each_schema_of_integers_alone(member, fractions):
    found = _variations(_operation(path="/a", body={"type": "object", "properties": {"n": member}}), invalid_variations)
    sent = [one.inputs.body.get("n") for one in found if isinstance(one.inputs.body, dict)]
    assert [value for value in sent if isinstance(value, float) and value % 1] == fractions


@pytest.mark.parametrize(
    ("pattern", "texts"),
    [
        ("^([01][0-9]|2[0-3]):[0-5][0-9]$", ["23:69", "24:59", "23:599"]),
        ("^[A-Z]{2}-[0-9]{5}$", ["AA-999999"]),
        ("^[0-9]{4,6}$", ["9999999"]),
        (r"^v\d+$", ["~ roaas ~"]),
    ],
)
def test_texts_next_to_a_pattern_are_sent(pattern, texts):
    member = {"type": "string", "pattern": pattern}
    found = _variations(_operation(path="/a", body={"type": "object", "properties": {"n": member}}), invalid_variations)
    assert [one.inputs.body["n"] for one in found if one.says.endswith("which its pattern excludes")] == texts


def test_a_text_for_a_truth_value_is_sent_where_no_text_is_allowed():
    for kinds, is_sent in (("boolean", True), (["boolean", "string"], False)):
        body = {"type": "object", "properties": {"n": {"type": kinds}}}
        found = _variations(_operation(path="/a", body=body), invalid_variations)
        assert ({"n": "true"} in [one.inputs.body for one in found]) is is_sent


def test_items_of_a_body_that_is_a_list():
    found = _variations(_operation(path="/a", body=_NUMBERS), invalid_variations)
    assert [False] in [one.inputs.body for one in found]


def test_a_truth_value_where_one_is_allowed_is_not_called_invalid():
    items = {"type": "array", "items": {"type": ["number", "boolean"]}}
    found = _variations(_operation(path="/a", body={"type": "object", "properties": {"n": items}}), invalid_variations)
    assert not any(one.inputs.body == {"n": [False]} for one in found)


def _scalars(inputs):
    return [one for one in _flattened(inputs.body) if isinstance(one, bool)]


def _flattened(value):
    if not isinstance(value, dict | list):
        return [value]
    return [one for item in (value.values() if isinstance(value, dict) else value) for one in _flattened(item)]


@pytest.mark.parametrize(
    "schema",
    [
        {},
        {"type": "string"},
        {"anyOf": [{"type": "integer"}, {"type": "string"}]},
        {"type": ["integer", "string"]},
        {"type": "object"},
        {"type": "array"},
    ],
)
def test_a_text_that_some_reading_allows_is_not_called_invalid(schema):
    operation = _operation("get", parameters=[_item("id", schema, "path")])
    assert _variations(operation, invalid_variations) == []


def test_what_another_alternative_allows_is_not_called_invalid():
    a, b = ({"type": "object", "required": [name], "properties": {name: {"type": "integer"}}} for name in "ab")
    operation = _operation(path="/a", body={"anyOf": [a, b, {"type": "object", "maxProperties": 0}]})
    assert [
        one for one in _variations(operation, invalid_variations) if one.kind is Kind.MISSING and one.place != "body"
    ] == []


@pytest.mark.parametrize(
    ("schema", "value"),
    [
        ({"type": "string"}, "roaas-unknown"),
        ({"type": "integer"}, 987_654_321),
        ({"type": "string", "format": "uuid", "pattern": "^[0-9a-f-]{36}$"}, "00000000-0000-4000-8000-000000000000"),
        ({"type": "integer", "maximum": 3}, None),
        ({"enum": ["a"]}, None),
    ],
)
def test_identifiers_of_what_does_not_exist(schema, value):
    found = _variations(_operation("get", parameters=[_item("id", schema, "path")]), unknown_variations)
    assert [one.inputs.path["id"] for one in found] == ([] if value is None else [value])


def test_odd_values_can_be_sent():
    found = _variations(_MANY, odd_variations)
    assert len(found) > 20
    for one in found:
        request = request_of(_MANY, one.inputs)
        assert "/../" not in request.target
        assert all("\r" not in value and "\n" not in value and "\x00" not in value for _, value in request.headers)
    bodies = [request_of(_MANY, one.inputs).body for one in found]
    assert any(rb"\u0000" in body or b"\0" in body for body in bodies), "a NUL in a text"
    half = json_text({"x": "\ud83e"}).encode()
    said = [json_fault(body, {})[0] for body in (half, half.replace(rb"\ud83e", rb"\ud83e\udd16"))]
    assert said == ["unclear", "valid"]


def test_inputs_are_replaced_and_left_out():
    inputs = Inputs(query={"a": 1}).having("query", "b", 2).having("query", "a", NOTHING).having("header", "h", 3)
    assert (inputs.query, inputs.headers) == ({"b": 2}, {"h": 3})
