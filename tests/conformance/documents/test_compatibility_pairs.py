"""Pairs of schemas and of operations, each with the answer and the reason for it."""

import pytest

from conformance.documents.operation_compatibility import changes

TEXT, INT, NUMBER = {"type": "string"}, {"type": "integer"}, {"type": "number"}


def obj(*required, **properties):
    return {"type": "object", "properties": properties, "required": list(required)}


def array(**words):
    return {"type": "array", **words}


# Old and new schema; whether a request breaks, and whether a response does (None: not known); why.
PAIRS = [
    (INT, NUMBER, False, True, "more numbers"),
    (NUMBER, INT, True, False, "fewer numbers"),
    ({**INT, "minimum": 0.5}, {**INT, "minimum": 1}, False, False, "the same integers"),
    ({**INT, "exclusiveMaximum": 5}, {**INT, "maximum": 4}, False, False, "the same integers"),
    ({**NUMBER, "exclusiveMaximum": 5}, {**NUMBER, "maximum": 5}, False, True, "5 more"),
    ({**INT, "multipleOf": 4}, {**INT, "multipleOf": 2}, False, True, "2 more"),
    ({**INT, "multipleOf": 2}, {**INT, "multipleOf": 3}, True, True, "other numbers"),
    ({**TEXT, "maxLength": 5}, {**TEXT, "maxLength": 9}, False, True, "longer"),
    ({**TEXT, "minLength": 1}, TEXT, False, True, "the empty one more"),
    ({**TEXT, "pattern": "^a"}, TEXT, False, True, "any string"),
    ({**TEXT, "format": "date"}, {**TEXT, "format": "date-time"}, True, True, "other strings"),
    ({**TEXT, "format": "uuid"}, TEXT, False, True, "any string"),
    ({"const": "a"}, {"enum": ["a", "b"]}, False, True, "b more"),
    ({"enum": ["a", "b"]}, {"enum": ["b", "a"]}, False, False, "the order says nothing"),
    ({"const": None}, {}, False, True, "anything"),
    ({"enum": ["a"]}, TEXT, False, True, "any string"),
    (True, {}, False, False, "the same"),
    (True, False, True, False, "nothing"),
    (TEXT, {"type": ["string", "null"]}, False, True, "null more"),
    (TEXT, {"anyOf": [TEXT, {"type": "null"}]}, False, True, "null more"),
    ({"type": ["string", "null"]}, {"oneOf": [{"type": "null"}, TEXT]}, False, False, "the same"),
    ({"anyOf": [INT, NUMBER]}, {"oneOf": [INT, NUMBER]}, True, False, "an integer fits both"),
    ({"allOf": [TEXT, {"minLength": 2}]}, {**TEXT, "minLength": 2}, False, False, "the same"),
    (TEXT, {**TEXT, "not": {"const": "a"}}, True, False, "one fewer"),
    (TEXT, {**TEXT, "not": INT}, False, False, "no string is an integer"),
    (array(items=NUMBER), array(items=INT), True, False, "fewer items"),
    (array(), array(items=INT), True, False, "fewer items"),
    (array(maxItems=2), array(maxItems=3), False, True, "longer"),
    (array(), array(minItems=1), True, False, "no empty one"),
    (array(items=INT), array(items=INT, uniqueItems=True), True, False, "[1, 1]"),
    (array(prefixItems=[INT]), array(prefixItems=[INT, INT]), True, False, "the second one"),
    (array(prefixItems=[INT], items=INT), array(items=INT), False, False, "the same"),
    (array(items=False), array(maxItems=0), False, False, "the empty one"),
    (array(prefixItems=[INT], items=False), array(prefixItems=[INT]), False, True, "more items"),
    (array(contains=INT), array(), False, True, "the empty one"),
    (array(contains=INT), array(contains=NUMBER), False, True, "1.5 suffices"),
    (array(contains=INT), array(contains=INT, minContains=2), True, False, "[1]"),
    (array(items=INT), array(items=INT, minContains=2), False, False, "minContains alone says nothing"),
    (obj(a=TEXT), obj("a", a=TEXT), True, False, "a is needed"),
    (obj(a=TEXT), obj(a=TEXT, b=TEXT), False, False, "an optional member"),
    (obj(a=TEXT), obj("b", a=TEXT, b=TEXT), True, False, "b is needed"),
    (obj(a=TEXT, b=TEXT), obj(a=TEXT), True, True, "b is gone"),
    (obj(a=TEXT), {**obj(a=TEXT), "additionalProperties": False}, True, False, "others are refused"),
    (obj(a=obj(b=TEXT)), obj(a=obj("b", b=TEXT)), True, False, "b is needed"),
    ({"type": "object", "additionalProperties": INT}, {"type": "object", "additionalProperties": NUMBER},
     False, True, "1.5"),
    ({"type": "object"}, {"type": "object", "maxProperties": 1}, True, False, "two members"),
    ({"type": "object"}, {"type": "object", "propertyNames": {"maxLength": 2}}, True, False, "long names"),
    ({"type": "object"}, {"type": "object", "dependentRequired": {"a": ["b"]}}, True, False, "a alone"),
    ({"type": "object"}, {"type": "object", "dependentSchemas": {"a": {"required": ["b"]}}}, True, False, "a alone"),
    ({"type": "object", "patternProperties": {"^x": INT}}, {"type": "object", "patternProperties": {"^x": NUMBER}},
     False, True, "x: 1.5"),
    (obj(a=TEXT, b=TEXT), {**obj(a=TEXT, b=TEXT), "if": {"required": ["a"]}, "then": {"required": ["b"]}},
     True, False, "a alone"),
    ({"if": TEXT, "then": {"minLength": 1}}, {"if": TEXT, "then": {"minLength": 1}, "else": True}, False,
     False, "the same"),
    ({"$ref": "#/components/schemas/Tree"}, obj(a={"$ref": "#/components/schemas/Tree"}), False, False, "the same"),
    ({"$ref": "#/components/schemas/Same"}, TEXT, False, False, "the same"),
    (TEXT, {**TEXT, "description": "d", "examples": ["a"], "deprecated": True, "x-a": 1}, False, False, "notes"),
    (TEXT, {**TEXT, "contentSchema": INT}, None, None, "no validator judges it"),
    ({**INT, "format": "int32"}, {**INT, "format": "int64"}, False, True, "2^40"),
    ({**NUMBER, "format": "double"}, NUMBER, False, False, "each number is a double"),
]  # fmt: skip


def api(operation=None, **top):
    tree = obj(a={"$ref": "#/components/schemas/Tree"})
    components = {"schemas": {"Tree": tree, "Same": TEXT}, "securitySchemes": {"o": {"type": "oauth2", "flows": {}}}}
    paths = {"/a": {"post": {"responses": {"200": {"description": "ok"}}, **(operation or {})}}}
    return {"openapi": "3.1.0", "info": {}, "components": components, "paths": paths, **top}


def content(schema, media_type="application/json"):
    return {"content": {media_type: {"schema": schema}}}


def answered(old, new):
    found = {one.breaking for one in changes(old, new)}
    return True if True in found else None if None in found else False


@pytest.mark.parametrize(("old", "new", "request_", "response", "why"), PAIRS)
def test_a_schema_in_each_direction(old, new, request_, response, why):
    assert answered(*(api({"requestBody": content(one)}) for one in (old, new))) is request_, why
    assert answered(*(api({"responses": {"200": content(one)}}) for one in (old, new))) is response, why
    # In a webhook the API sends the request.
    hooks = ({"webhooks": {"w": {"post": {"requestBody": content(one)}}}} for one in (old, new))
    assert answered(*(api(**one) for one in hooks)) is response, why


def parameters(*given):
    return {"parameters": [{"in": "query", "schema": TEXT, **one} for one in given]}


def statuses(*keys):
    return {"responses": {"200": {}, **dict.fromkeys(keys, content(TEXT))}}


OPERATIONS = [
    (parameters(), parameters({"name": "q"}), False, "optional"),
    (parameters(), parameters({"name": "q", "required": True}), True, "needed"),
    (parameters({"name": "q"}), parameters({"name": "q", "explode": False}), False, "one value"),
    (parameters({"name": "q", "schema": array()}), parameters({"name": "q", "schema": array(), "explode": False}), True,
     "several values"),
    (parameters({"name": "Accept", "in": "header"}), parameters(), False, "it is ignored"),
    (parameters({"name": "X-A", "in": "header"}), parameters({"name": "x-a", "in": "header"}), False, "any case"),
    (parameters({"name": "q"}), parameters({"name": "q", "in": "cookie"}), True, "elsewhere"),
    (statuses("4XX"), statuses("404"), False, "fewer errors"),
    (statuses("404"), statuses("4XX"), False, "an error that is no longer alone"),
    (statuses("404"), statuses(), False, "no error"),
    (statuses("201"), statuses(), True, "a success that is gone"),
    (statuses("default"), statuses("404", "default"), False, "it was covered"),
    ({"responses": {"200": {}, "default": content(INT)}}, {"responses": {"200": {}, "404": content(TEXT),
     "default": content(INT)}},
     True, "an error of another shape"),
    ({"security": [{"o": ["r"]}]}, {"security": [{"o": ["r", "w"]}]}, True, "a scope more"),
    ({"security": [{"o": ["r", "w"]}]}, {"security": [{"o": ["r"]}]}, False, "a scope less"),
    ({"security": [{"o": []}]}, {"security": [{"o": []}, {"k": []}]}, False, "an alternative"),
    ({"security": [{"o": []}, {"k": []}]}, {"security": [{"o": []}]}, True, "an alternative less"),
    ({"security": []}, {"security": [{"o": []}]}, True, "credentials"),
    ({"requestBody": content(TEXT)}, {"requestBody": {**content(TEXT), "required": True}}, True, "a body is needed"),
    ({"requestBody": content(TEXT)}, {"requestBody": content(TEXT, "application/*")}, False, "a range more"),
    ({"requestBody": content(TEXT, "application/*")}, {"requestBody": content(TEXT)}, True, "a range less"),
    ({"responses": {"200": content(TEXT)}}, {"responses": {"200": content(TEXT, "text/plain")}}, True,
     "another media type"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "breaks", "why"), OPERATIONS)
def test_an_operation(old, new, breaks, why):
    assert answered(api(old), api(new)) is breaks, why


def test_what_is_not_compared_is_named():
    old, new = (api({"requestBody": content(obj(a=one))}) for one in (TEXT, {**TEXT, "contentSchema": INT}))
    assert [one.text for one in changes(old, new)] == ["the body, member a: not compared: contentSchema"]
