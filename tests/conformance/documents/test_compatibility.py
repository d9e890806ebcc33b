"""What breaks clients of an older description, and what does not."""

import json

import pytest

from conformance.documents.description import as_openapi_3
from conformance.documents.operation_compatibility import changes

POSE = {
    "type": "object",
    "required": ["x"],
    "properties": {
        "x": {"type": "number", "minimum": -5, "maximum": 5},
        "frame": {"type": "string", "enum": ["map", "odom"]},
        "note": {"type": "string"},
        "id": {"type": "integer", "readOnly": True},
        "tags": {"type": "array", "items": {"type": "string"}},
    },
}


def _api():
    """Return a description with a request and a response of the same schema, in two copies."""
    return json.loads(
        json.dumps(
            {
                "openapi": "3.1.0",
                "info": {"title": "Arm", "version": "1"},
                "paths": {
                    "/goals/{id}": {
                        "put": {
                            "parameters": [
                                {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}},
                                {"name": "speed", "in": "query", "schema": {"type": "integer"}},
                                {"name": "X-Mode", "in": "header", "schema": {"type": "string"}},
                            ],
                            "requestBody": {
                                "content": {"application/json": {"schema": POSE}, "application/xml": {"schema": POSE}}
                            },
                            "responses": {
                                "200": {
                                    "content": {"application/json": {"schema": POSE}, "text/plain": {}},
                                    "headers": {"ETag": {"required": True, "schema": {"type": "string"}}},
                                },
                                "404": {"description": "No such goal."},
                            },
                        }
                    },
                    "/state": {"get": {"responses": {"200": {"description": "The state."}}}},
                },
            }
        )
    )


def put(api):
    return api["paths"]["/goals/{id}"]["put"]


def body(api):
    return put(api)["requestBody"]["content"]["application/json"]["schema"]


def reply(api):
    return put(api)["responses"]["200"]["content"]["application/json"]["schema"]


def query(api):
    return put(api)["parameters"][1]


def speed(**schema):
    return lambda api: query(api).update(schema=schema)


def add(**parameter):
    return lambda api: put(api)["parameters"].append({"in": "query", "schema": {"type": "string"}, **parameter})


def member(of, name, **schema):
    return lambda api: of(api)["properties"].update({name: schema})


JSON_TEXT = {"application/json": {"schema": {"type": "string"}}}

BREAKING = [
    (lambda api: api["paths"].pop("/state"), "the operation is gone"),
    (lambda api: put(api)["parameters"].pop(1), "query parameter speed is gone"),
    (lambda api: query(api).update(name="pace"), "query parameter speed is gone"),
    (add(name="who", required=True), "query parameter who is new, and required"),
    (lambda api: query(api).update(required=True), "query parameter speed is required now"),
    (lambda api: query(api).update(content=JSON_TEXT), "query parameter speed is written in another way"),
    (speed(type="string"), "query parameter speed: type integer → string"),
    (speed(type="integer", minimum=1), "query parameter speed: minimum none → 1"),
    (speed(type="integer", maximum=9), "query parameter speed: maximum none → 9"),
    (speed(type="integer", enum=[1, 2]), "query parameter speed: values none → 1, 2"),
    (lambda api: put(api)["parameters"][2]["schema"].update(pattern="^a"), "header X-Mode: pattern none → ^a"),
    (lambda api: put(api)["parameters"][2]["schema"].update(format="uuid"), "header X-Mode: format none → uuid"),
    (lambda api: put(api).pop("requestBody"), "takes no body any more"),
    (lambda api: put(api)["requestBody"].update(required=True), "the body is required now"),
    (lambda api: put(api)["requestBody"]["content"].pop("application/xml"), "the body is no longer application/xml"),
    (lambda api: body(api)["required"].append("frame"), "the body, member frame is required now"),
    (member(body, "frame", type="string", enum=["map"]), "the body, member frame may no longer be odom"),
    (member(body, "x", type="integer", minimum=-5, maximum=5), "the body, member x: type number → integer"),
    (member(body, "tags", type="array", items={"type": "integer"}), "the body, member tags[]: type string → integer"),
    (lambda api: body(api)["properties"].pop("note"), "the body, member note is gone"),
    (lambda api: body(api).update(additionalProperties=False), "members that are not described are refused now"),
    (
        lambda api: (body(api)["properties"].update(y={}), body(api)["required"].append("y")),
        "the body, member y is new, and required",
    ),
    (lambda api: put(api)["responses"].pop("200"), "status 200 is gone"),
    (lambda api: put(api)["responses"]["200"]["content"].pop("text/plain"), "response 200 is no longer text/plain"),
    (lambda api: put(api)["responses"]["200"].pop("headers"), "response 200, header etag is gone"),
    (lambda api: reply(api)["properties"].pop("note"), "response 200, member note is gone"),
    (lambda api: reply(api)["required"].remove("x"), "response 200, member x is optional now"),
    (member(reply, "frame", type="string", enum=["map", "odom", "base"]), "member frame may now be base"),
    (member(reply, "frame", type="string"), "member frame: values map, odom → none"),
    (member(reply, "x", type="number", minimum=-5, maximum=9), "response 200, member x: maximum 5 → 9"),
    (member(reply, "note", type=["string", "null"]), "response 200, member note may now be null"),
    (member(reply, "note", anyOf=[{"type": "string"}, {"type": "integer"}]), "member note may now be integer"),
    (member(reply, "id", type="number", readOnly=True), "response 200, member id: type integer → number"),
    (lambda api: put(api).update(security=[{"token": []}]), "needs token, before no credentials"),
    (lambda api: api.update(security=[{"token": []}]), "needs token, before no credentials"),
    (lambda api: api.update(servers=[{"url": "/v2"}]), "the operation is gone"),
]
HARMLESS = [
    (lambda api: api["paths"].update({"/new": {"get": {"responses": {}}}}), "the operation is new"),
    (add(name="who"), "query parameter who is new"),
    (speed(type="number"), "query parameter speed: type integer → number"),
    (speed(type=["integer", "null"]), "query parameter speed may now be null"),
    (member(body, "frame", type="string", enum=["map", "odom", "base"]), "member frame may now be base"),
    (member(body, "x", type="number", minimum=-9, maximum=5), "member x: minimum -5 → -9"),
    (member(body, "y", type="number"), "the body, member y is new"),
    (lambda api: body(api)["required"].remove("x"), "the body, member x is optional now"),
    (member(body, "id", type="string", readOnly=True), ""),
    (member(reply, "y", type="number"), "response 200, member y is new"),
    (member(reply, "frame", type="string", enum=["map"]), "member frame may no longer be odom"),
    (member(reply, "x", type="number", minimum=-5, maximum=4), "member x: maximum 5 → 4"),
    (lambda api: put(api)["responses"].pop("404"), "status 404 is gone"),
    (lambda api: reply(api)["required"].append("note"), "response 200, member note is required now"),
    (lambda api: put(api)["responses"].update({"409": {}}), "status 409 is new"),
    (lambda api: put(api)["responses"].update({"4XX": put(api)["responses"].pop("404")}), "status 4XX is new"),
    (lambda api: put(api)["requestBody"]["content"].update({"text/plain": {}}), "the body may be text/plain"),
    (lambda api: put(api).update(security=[{}, {"token": []}]), "needs no credentials or token"),
    (lambda api: put(api)["parameters"][2].update(name="x-mode"), ""),
    (lambda api: put(api).update(summary="Set a goal", tags=["goals"]), ""),
    (lambda api: body(api).update(title="Pose", description="Where to go"), ""),
]


def _told(change):
    before, after = _api(), _api()
    change(after)
    return changes(before, after)


@pytest.mark.parametrize(("change", "text"), BREAKING, ids=[text for _, text in BREAKING])
def test_it_breaks_clients(change, text):
    assert any(text in one.text for one in _told(change) if one.breaking)


@pytest.mark.parametrize(("change", "text"), HARMLESS, ids=[f"{n} {text}" for n, (_, text) in enumerate(HARMLESS)])
def test_it_harms_no_client(change, text):
    told = _told(change)
    assert [one for one in told if one.breaking] == []
    assert any(text in one.text for one in told) or not (text or told)


def test_a_parameter_of_the_path_may_have_another_name():
    after = _api()
    after["paths"]["/goals/{goal}"] = after["paths"].pop("/goals/{id}")
    put_ = after["paths"]["/goals/{goal}"]["put"]
    put_["parameters"][0]["name"] = "goal"
    assert changes(_api(), after) == []


def test_the_same_in_other_words_is_no_change():
    before, after = _api(), _api()
    member(reply, "note", type=["string", "null"])(before)
    member(reply, "note", anyOf=[{"type": "null"}, {"type": "string"}])(after)
    assert changes(before, after) == []


def test_swagger_2_and_openapi_3_compare():
    swagger = {
        "swagger": "2.0", "info": {"title": "a", "version": "1"}, "basePath": "/v1",
        "paths": {"/a": {"get": {"responses": {"200": {"description": "", "schema": {"type": "string"}}}}}},
    }  # fmt: skip
    openapi = {
        "openapi": "3.0.0", "info": {"title": "a", "version": "1"}, "servers": [{"url": "http://robot/v1/"}],
        "paths": {"/a": {"get": {"responses": {"200": {"content": JSON_TEXT}}}}},
    }  # fmt: skip
    assert changes(as_openapi_3(swagger), openapi) == []
