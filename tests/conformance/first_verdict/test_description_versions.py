"""What one version of OpenAPI has and another has not: judged as it is meant, or named."""

import json

import pytest
from aiohttp import web
from small_device import REFUSED, answers, certified, constant, described, error, reading, small_device


def _with(name, schema):
    """Return the schema of an object that must have one member."""
    return {"type": "object", "required": [name], "properties": {name: schema}}


def _query_32(wrong):
    async def query(request):
        if request.content_type != "application/json":
            return error(415, "no JSON")
        try:
            value = json.loads(await request.text(), parse_constant=lambda name: float(name + "x"))
        except (ValueError, RecursionError):
            return error(400, "no JSON")
        is_right = isinstance(value, dict) and value.get("kind") in ("arm", "base")
        return web.json_response([1] if wrong else ["a"]) if is_right or wrong else error(422, "no such kind")

    async def parts(request):
        given = request.query.getall("n", [])
        is_right = len(given) == 1 and given[0].isascii() and given[0].isdigit()
        return web.json_response([]) if is_right or wrong else error(400, "n is no number")

    async def copy(_):
        return error(404, "it is gone") if wrong else web.Response(status=204)

    return {"QUERY": query, "GET": parts, "COPY": copy}


_FORM = _with("n", {"type": "integer", "minimum": 0})
_KIND = _with("kind", {"enum": ["arm", "base"]})
_PARTS_32 = {
    "query": {
        "requestBody": {"required": True, "content": {"application/json": {"schema": _KIND}}},
        "responses": {"200": answers({"type": "array", "items": {"type": "string"}}), "4XX": REFUSED},
    },
    "get": {
        "parameters": [
            {
                "name": "all",
                "in": "querystring",
                "required": True,
                "content": {"application/x-www-form-urlencoded": {"schema": _FORM}},
            }
        ],
        "responses": {"200": answers({"type": "array"}), "4XX": REFUSED},
    },
    "additionalOperations": {"COPY": {"responses": {"204": {"description": "copied"}, "400": REFUSED}}},
}
_JSONPATH = {
    "parameters": [
        {
            "name": "all",
            "in": "querystring",
            "required": True,
            "content": {"application/jsonpath": {"schema": {"type": "string"}}},
        }
    ],
    "responses": {"200": answers({"type": "array"}), "4XX": REFUSED},
}


def test_methods_and_query_strings_of_openapi_3_2_are_judged_or_named_before_the_run(tmp_path):
    description = described({"/parts": _PARTS_32, "/found": {"get": _JSONPATH}}, "3.2.0")
    for wrong in (False, True):
        with small_device(description, {"/parts": _query_32(wrong), "/found": constant([])}) as url:
            done = certified(f"{url}/openapi.json", tmp_path / str(wrong), "--call", "*")
        assert "Calls 3 of 4 operations" in done.text
        assert "GET /found is not called: its query string is application/jsonpath" in done.text
        operations = {one["operation"]: bool(one["findings"]) for one in done.result["api"]["operations"]}
        called = ("QUERY /parts", "GET /parts", "COPY /parts")
        assert operations == {**dict.fromkeys(called, wrong), "GET /found": False}, done.text
        assert wrong or (done.exit_code, done.blamed) == (0, {}), done.text


_MIXED_30 = {
    "/log": {
        "get": {
            "parameters": [
                {
                    "name": "limit",
                    "in": "query",
                    "schema": {"anyOf": [{"type": "integer", "exclusiveMinimum": 0, "maximum": 9}, {"type": "null"}]},
                }
            ],
            "responses": {"200": answers(_with("note", {"type": ["string", "null"]})), "4XX": REFUSED},
        }
    },
    "/old": reading(_with("a", {"type": "integer", "nullable": True})),
    "/const": reading(_with("a", {"const": "x"})),
}
_MIXED_31 = {
    "/bound": reading(_with("a", {"type": "number", "minimum": 0, "exclusiveMinimum": True})),
    "/new": reading(_with("a", {"type": ["string", "null"]})),
}


async def _log(request):
    given = request.query.getall("limit", [])
    is_right = len(given) <= 1 and all(one == "null" or (len(one) == 1 and one in "123456789") for one in given)
    return web.json_response({"note": None}) if is_right else error(422, "no such limit")


@pytest.mark.parametrize(
    ("version", "paths", "words"),
    [
        (
            "3.0.3",
            _MIXED_30,
            ('{"type": "null"}', "/paths/~1log/get/parameters/0/schema/anyOf/1", "exclusiveMinimum", "const"),
        ),
        ("3.1.0", _MIXED_31, ('{"exclusiveMinimum": true}', "/paths/~1bound/")),
    ],
)
def test_words_of_another_version_are_one_finding_and_judged_as_they_are_meant(version, paths, words, tmp_path):
    values = {"/old": {"a": None}, "/const": {"a": "x"}, "/bound": {"a": 0.5}, "/new": {"a": None}}
    routes = {path: {"GET": _log} if path == "/log" else constant(values[path]) for path in paths}
    with small_device(described(paths, version), routes) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "right")
    assert done.blamed == {"description/file-valid": "fail"}, done.text
    assert all(word in done.text for word in words), done.text
    wrong = {path: constant({"a": 0, "note": 0}) for path in paths}
    with small_device(described(paths, version), wrong) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "wrong", "--class", "description")
    named = {one["operation"] for one in done.result["api"]["operations"] if one["findings"]}
    assert named == {f"GET {path}" for path in paths if path != "/old"}, done.text
