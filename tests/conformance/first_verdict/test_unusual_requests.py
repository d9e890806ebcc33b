"""Bodies and parameters of the rarer kinds: a right device passes, and what it creates is found again."""

import json
import re

import jsonschema_rs
from aiohttp import web
from small_device import REFUSED, answers, body_of, certified, described, error, object_of, small_device

from conformance.history.events import Sent, read_history
from conformance.history.writing import HISTORY_NAME

_RESPONSES = {"200": answers({"type": "object"}), "4XX": REFUSED}
_WHOLE = {"type": "integer"}
_ITEM = object_of(
    "id", "n", "secret", id={"type": "string", "readOnly": True}, n=_WHOLE, secret={"type": "string", "writeOnly": True}
)
_SENT_ITEM = {**_ITEM, "required": ["n", "secret"]}
_STEP = object_of("op", "path", op={"enum": ["add", "remove"]}, path={"type": "string"})
_CAT = object_of("kind", "m", kind={"type": "string"}, m=_WHOLE)
_DOG = object_of("kind", "b", kind={"type": "string"}, b={"type": "boolean"})
_ANIMAL = {
    "oneOf": [{"$ref": "#/components/schemas/Cat"}, {"$ref": "#/components/schemas/Dog"}],
    "discriminator": {
        "propertyName": "kind",
        "mapping": {"cat": "#/components/schemas/Cat", "dog": "#/components/schemas/Dog"},
    },
}
# Path: method, media type of the body, its schema, and the schema that its JSON has to keep.
_BODIES = {
    "/item": ("put", "application/json", _ITEM, _SENT_ITEM),
    "/unique": (
        "post",
        "application/json",
        *[{"type": "array", "uniqueItems": True, "minItems": 2, "items": {"type": "string"}}] * 2,
    ),
    "/merge": ("patch", "application/merge-patch+json", *[object_of(a=_WHOLE)] * 2),
    "/patch": ("patch", "application/json-patch+json", *[{"type": "array", "minItems": 1, "items": _STEP}] * 2),
    "/animal": ("post", "application/json", _ANIMAL, {"oneOf": [_CAT, _DOG]}),
    "/text": ("put", "text/plain", {"type": "string", "maxLength": 10}, {"type": "string", "maxLength": 10}),
    "/lines": ("post", "application/x-ndjson", object_of("a", a=_WHOLE), None),
    "/blob": ("put", "application/octet-stream", {"type": "string", "format": "binary"}, None),
}
_QUERY = [
    {
        "name": "n",
        "in": "query",
        "schema": {"type": "integer", "nullable": True, "minimum": 0, "exclusiveMinimum": True},
    },
    {"name": "flag", "in": "query", "allowEmptyValue": True, "schema": {"type": "boolean"}},
    {"name": "old", "in": "query", "deprecated": True, "schema": {"type": "string", "enum": ["a", "b"]}},
]
_UUID = re.compile("[0-9a-fA-F]{8}(-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}")
_SHARED = {"name": "v", "in": "query", "required": False, "schema": _WHOLE}
_OWN = {"name": "v", "in": "query", "required": True, "schema": {"type": "string", "enum": ["x"]}}
_KEY = {"name": "Idempotency-Key", "in": "header", "required": True, "schema": {"type": "string", "format": "uuid"}}
_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}


def _paths():
    paths = {}
    for path, (method, media_type, schema, _) in _BODIES.items():
        body = {"required": True, "content": {media_type: {"schema": schema}}}
        paths[path] = {method: {"requestBody": body, "responses": _RESPONSES}}
    paths["/item"]["put"]["responses"] = {"200": answers(_ITEM), "4XX": REFUSED}
    examples = {"far": {"externalValue": "http://127.0.0.1:1/none"}, "near": {"value": "text"}}
    paths["/text"]["put"]["requestBody"]["content"]["text/plain"]["examples"] = examples
    paths["/query"] = {"get": {"parameters": _QUERY, "responses": _RESPONSES}}
    paths["/own"] = {"parameters": [_SHARED], "get": {"parameters": [_OWN], "responses": _RESPONSES}}
    match = {"name": "If-Match", "in": "header", "schema": {"type": "string"}}
    paths["/locked"] = {"get": {"parameters": [match], "responses": _RESPONSES}}
    job = object_of("kind", kind={"type": "string", "default": "scan"})
    body = body_of(job)
    made = {**answers({"type": "object"}), "headers": {"Location": {"schema": {"type": "string"}}}}
    paths["/jobs"] = {"post": {"parameters": [_KEY], "requestBody": body, "responses": {"201": made, "4XX": REFUSED}}}
    paths["/jobs/{id}"] = {"get": {"parameters": [_ID], "responses": _RESPONSES}}
    return paths


def _taking(path):
    _, media_type, _, schema = _BODIES[path]
    is_valid = jsonschema_rs.validator_for(schema or {}).is_valid

    def refused(_):
        raise ValueError

    async def handle(request):
        if request.content_type != media_type:
            return error(415, "another media type")
        content = await request.read()
        try:
            if media_type == "text/plain":
                assert is_valid(content.decode())
            elif media_type == "application/x-ndjson":
                lines = [json.loads(line) for line in content.splitlines()]
                assert all(type(line["a"]) is int for line in lines)
                assert lines
            elif schema is not None:
                value = json.loads(content.decode(), parse_constant=refused)
                assert is_valid(value)
                kind = {"cat": "m", "dog": "b"}.get(value["kind"], "?") if path == "/animal" else ""
                assert not kind or kind in value
        except (ValueError, KeyError, TypeError, AssertionError, RecursionError):
            return error(400, "not valid")
        return web.json_response({"id": "a", "n": value["n"]} if path == "/item" else {})

    return handle


def _one(request, name, pattern):
    """Return whether a query has a parameter once, as this pattern, or not at all."""
    given = request.query.getall(name, [])
    return not given or (len(given) == 1 and re.fullmatch(pattern, given[0], re.ASCII) is not None)


async def _query(request):
    right = (
        _one(request, "n", "|null|[1-9][0-9]*")
        and _one(request, "flag", "|true|false")
        and _one(request, "old", "[ab]")
    )
    return web.json_response({}) if right else error(400, "query")


async def _own(request):
    return web.json_response({}) if request.query.getall("v", []) == ["x"] else error(400, "v")


async def _locked(request):
    given = request.headers.get("If-Match")
    return error(428, "If-Match") if given is None else error(412, "other") if given != '"1"' else web.json_response({})


def _device():
    jobs, made = {}, {}

    async def make(request):
        key = re.fullmatch(
            r"[0-9a-fA-F]{8}(-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}", request.headers.get("Idempotency-Key", "")
        )
        try:
            given = json.loads(await request.text()) if request.content_type == "application/json" else None
            right = isinstance(given["kind"], str)
        except (ValueError, KeyError, TypeError):
            right = False
        if not key or not right:
            return error(400, "not a job")
        # A repeated key does not make another job, and does not stand for another one.
        id_ = made.setdefault(key[0], f"j{len(jobs)}")
        if jobs.setdefault(id_, given) != given:
            return error(400, "the key of another job")
        return web.json_response({"job": {"id": id_}}, status=201, headers={"Location": f"/jobs/{id_}"})

    async def job(request):
        found = jobs.get(request.match_info["id"])
        return error(404, "no such job") if found is None else web.json_response(found)

    routes = {path: {method.upper(): _taking(path)} for path, (method, *_) in _BODIES.items()}
    more = {"/query": _query, "/own": _own, "/locked": _locked, "/jobs/{id}": job}
    return {**routes, **{path: {"GET": handle} for path, handle in more.items()}, "/jobs": {"POST": make}}


def test_a_right_device_with_unusual_requests_passes(tmp_path):
    document = described(_paths(), components={"schemas": {"Cat": _CAT, "Dog": _DOG}})
    with small_device(document, _device()) as url:
        seen = certified(f"{url}/openapi.json", tmp_path / "out", "--call", "*")
    assert seen.blamed == {}
    assert seen.exit_code == 0
    taken = {one["operation"] for one in seen.result["api"]["operations"] if {"200", "201"} & one["statuses"].keys()}
    assert {one["operation"] for one in seen.result["api"]["operations"]} - taken <= {"GET /locked"}
    events = [one for one in read_history(tmp_path / "out" / HISTORY_NAME) if isinstance(one, Sent)]
    generated = [one for one in events if one.span.endswith("[generated_requests]")]
    types = {(one.url.removeprefix(url), *pair) for one in generated for pair in one.headers}
    declared = {(path, "Content-Type", media_type) for path, (_, media_type, *_) in _BODIES.items()}
    # Schemathesis writes no lines of JSON.
    assert declared - types == {("/lines", "Content-Type", "application/x-ndjson")}


def test_a_404_by_a_router_that_knows_no_head_is_not_compared_with_that_of_get(tmp_path):
    async def no_head(_):
        return web.Response(status=404, text="Not Found")

    async def absent(_):
        return error(404, "there is no such job")

    async def state(_):
        return web.json_response({})

    paths = {path: {"get": {"responses": _RESPONSES}} for path in ("/state", "/jobs/{id}")}
    paths["/jobs/{id}"]["parameters"] = [_ID]
    routes = {"/state": {"GET": state, "HEAD": no_head}, "/jobs/{id}": {"GET": absent, "HEAD": no_head}}
    with small_device(described(paths), routes) as url:
        outcome = certified(f"{url}/openapi.json", tmp_path)
    assert not [one for one in outcome.blamed if one.startswith("http/head")], outcome.blamed
