"""Ids, cursors and names of other resources are the device's: a refusal of an invented one is no fault."""

import json
import re

from aiohttp import web
from small_device import REFUSED, answers, certified, constant, described, error, reading, small_device

_TEXT = {"type": "string"}
_ID = {"name": "id", "in": "path", "required": True, "schema": _TEXT}
_KEY = {"name": "key", "in": "path", "required": True, "schema": _TEXT}
# Formats of texts that the description only names, and what the device takes.
_FORMS = {
    "grams": ("int64", "-?[0-9]{1,18}"),
    "version": ("semver", r"[0-9]+\.[0-9]+\.[0-9]+"),
    "colour": ("color", "#.{6}"),
    "price": ("decimal", r"-?[0-9]{1,3}(\.[0-9]{1,2})?"),
}
# Django REST framework writes it so, and takes neither "" nor "-".
_LOAD = {name: {**_TEXT, "format": form} for name, (form, _) in _FORMS.items()}
_LOAD["price"]["pattern"] = r"^-?\d{0,3}(?:\.\d{0,2})?$"
_OBJECT = "65f0c1e2a7b3d4e5f6a7b8c9"
_VALVES = [{"id": "v-17", "open": True}, {"id": "v-18", "open": False}]


def _query(*names, required=True):
    return [{"name": name, "in": "query", "required": required, "schema": _TEXT} for name in names]


def _taking(properties, required, status="201"):
    schema = {"type": "object", "required": required, "properties": properties}
    body = {"required": True, "content": {"application/json": {"schema": schema}}}
    return {"post": {"requestBody": body, "responses": {status: answers({"type": "object"}), "400": REFUSED}}}


_PATHS = {
    "/valves": reading({"type": "array"}),
    "/valves/{id}": reading(
        {"type": "object"}, parameters=[{"name": "id", "in": "path", "required": True, "schema": _TEXT}]
    ),
    "/openings": _taking({"valve": _TEXT, "share": {"type": "integer", "minimum": 0}}, ["valve"]),
    "/events": reading({"type": "object"}, parameters=_query("cursor", required=False)),
    "/frames": {**reading({"type": "array"}), **_taking({"name": _TEXT, "parent_id": _TEXT}, ["name"])},
    "/loads": _taking(_LOAD, ["grams", "price"]),
    "/loads/latest": reading(
        {"type": "object"}, parameters=[{"name": "above", "in": "query", "schema": {**_TEXT, "format": "int64"}}]
    ),
    "/objects": reading({"type": "array"}),
    "/objects/{key}": reading({"type": "object"}, parameters=[_KEY]),
    "/scan": {
        "get": {"parameters": _query("session_id"), "responses": {"200": answers({"type": "object"}), "400": REFUSED}}
    },
}


async def _object(request, name):
    """Return the JSON object of a request, in which this member is a text; None for any other content."""
    try:
        given = json.loads(await request.text()) if request.content_type == "application/json" else None
        return given if isinstance(given[name], str) else None
    except (ValueError, KeyError, TypeError):
        return None


async def _valve(request):
    found = [one for one in _VALVES if one["id"] == request.match_info["id"]]
    return web.json_response(found[0]) if found else error(404, "no such valve")


async def _opening(request):
    given = await _object(request, "valve")
    share = (given or {}).get("share", 1)
    if given is None or type(share) is not int or share < 0:
        return error(400, "not a valid opening")
    if given["valve"] not in {one["id"] for one in _VALVES}:
        return error(422, f"no valve {given['valve']}")
    return web.json_response({}, status=201)


async def _events(request):
    right = request.query.getall("cursor", ["c-0"]) in (["c-0"], ["c-1"])
    return web.json_response({"next": "/events?cursor=c-1"}) if right else error(400, "no such cursor")


async def _scan(request):
    session = request.query.get("session_id")
    return error(400, "no session") if session is None else error(404, f"no session {session}")


async def _load(request):
    given = await _object(request, "grams")
    forms = {name: form for name, (_, form) in _FORMS.items() if name in (given or ())}
    if given is None or "price" not in given or not all(isinstance(given[name], str) for name in forms):
        return error(400, "not a valid load")
    right = all(re.fullmatch(form, given[name], re.ASCII) for name, form in forms.items())
    return web.json_response({}, status=201) if right else error(400, "not of the format")


async def _latest(request):
    given = request.query.getall("above", ["0"])
    right = len(given) == 1 and re.fullmatch(_FORMS["grams"][1], given[0], re.ASCII)
    return web.json_response({}) if right else error(400, "not of the format")


async def _object_of(request):
    right = request.match_info["key"] == "65f0c1e2a7b3d4e5f6a7b8c9"
    return web.json_response({}) if right else error(400, "no key of an object")


def _device():
    frames = {}

    async def frame(request):
        given = await _object(request, "name")
        if given is None or not isinstance(given.get("parent_id", ""), str):
            return error(400, "not a valid frame")
        if given.get("parent_id") not in {None, *frames}:
            return error(409, "no such parent")
        id_ = f"f-{len(frames)}"
        frames[id_] = given
        return web.json_response({"id": id_}, status=201)

    async def all_frames(_):
        return web.json_response([{"id": id_} for id_ in frames])

    return {
        "/valves": constant(_VALVES),
        "/valves/{id}": {"GET": _valve},
        "/openings": {"POST": _opening},
        "/events": {"GET": _events},
        "/frames": {"GET": all_frames, "POST": frame},
        "/loads": {"POST": _load},
        "/loads/latest": {"GET": _latest},
        "/objects": constant([{"key": _OBJECT}]),
        "/objects/{key}": {"GET": _object_of},
        "/scan": {"GET": _scan},
    }


def test_what_the_device_named_is_used_and_what_is_invented_may_be_refused(tmp_path):
    with small_device(described(_PATHS), _device()) as url:
        more = ("--call", "*", "--class", "description", "--class", "robustness")
        seen = certified(f"{url}/openapi.json", tmp_path / "out", *more)
    assert seen.blamed == {}
    counts = {one["operation"]: one["statuses"] for one in seen.result["api"]["operations"]}
    assert counts["POST /loads"].get("201")
    assert counts["POST /openings"].get("201")
    assert counts["POST /frames"].get("201")


def test_an_operation_whose_404_is_that_of_any_path_is_missing(tmp_path):
    routes = {path: methods for path, methods in _device().items() if path != "/scan"}
    with small_device(described(_PATHS), routes) as url:
        seen = certified(f"{url}/openapi.json", tmp_path / "out", "--select", "description/operations")
    assert seen.blamed["description/operations"] == "fail"
