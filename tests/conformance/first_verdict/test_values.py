"""Parameters and forms are written and judged as the specification has them: a right device passes, a lax one fails."""

import json
import re
from urllib.parse import unquote, unquote_plus

import jsonschema_rs
import pytest
from aiohttp import web
from small_device import REFUSED, answers, certified, constant, described, error, small_device

_WHOLE = {"type": "integer", "minimum": 0, "maximum": 9}
_LIST = {"type": "array", "items": _WHOLE, "minItems": 2, "maxItems": 3}
_POINT = {"type": "object", "required": ["x"], "properties": {"x": {"type": "number"}, "y": {"type": "number"}}}
_TAG = {"type": "object", "required": ["min"], "additionalProperties": False, "properties": {"min": _WHOLE}}
_NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
# For each operation its parameter, and what the text of its value has to look like, decoded.
_QUERIES = {
    "/csv": ({"schema": _LIST, "explode": False}, r"p=\d(,\d){1,2}"),
    "/multi": ({"schema": _LIST}, r"p=\d(&p=\d){1,2}"),
    "/pipes": ({"schema": _LIST, "style": "pipeDelimited", "explode": False}, r"p=\d(\|\d){1,2}"),
    "/spaces": ({"schema": _LIST, "style": "spaceDelimited", "explode": False}, r"p=\d( \d){1,2}"),
    "/deep": ({"schema": _TAG, "style": "deepObject", "explode": True}, r"p\[min\]=\d"),
    "/apart": ({"schema": _POINT}, rf"(?!.*\by=(?!{_NUMBER}(?:&|$)))(.*&)?x={_NUMBER}(&.*)?"),
    "/together": ({"schema": _POINT, "explode": False}, None),
    "/content": ({"content": {"application/json": {"schema": _TAG}}}, r'p=\{"min": ?\d\}'),
    "/reserved": ({"schema": {"type": "string", "enum": ["a/b", "c:d"]}, "allowReserved": True}, r"p=(a/b|c:d)"),
}
_PATHS = {
    "/matrix/{p}": ({"schema": _WHOLE, "style": "matrix"}, r";p=\d"),
    "/label/{p}": ({"schema": _WHOLE, "style": "label"}, r"\.\d"),
    "/simple/{p}": ({"schema": _LIST}, r"\d(,\d){1,2}"),
    "/members/{p}": ({"schema": _POINT, "explode": True}, rf"(?!.*\by=(?!{_NUMBER}(?:,|$)))(.*,)?x={_NUMBER}(,.*)?"),
}
_RESPONSES = {"200": answers({"type": "object"}), "4XX": REFUSED}


def _operation(name, where, given):
    return {"get": {"parameters": [{"name": name, "in": where, "required": True, **given}], "responses": _RESPONSES}}


def _paths():
    paths = {path: _operation("p", "query", given) for path, (given, _) in _QUERIES.items()}
    paths |= {path: _operation("p", "path", given) for path, (given, _) in _PATHS.items()}
    paths["/header"] = _operation("X-Ids", "header", {"schema": _LIST})
    paths["/cookie"] = _operation("mode", "cookie", {"schema": {"enum": ["auto", "manual"]}})
    form = {"type": "object", "required": ["n"], "properties": {"n": _WHOLE, "ids": _LIST}}
    content = {"application/x-www-form-urlencoded": {"schema": form, "encoding": {"ids": {"explode": False}}}}
    paths["/form"] = {"post": {"requestBody": {"required": True, "content": content}, "responses": _RESPONSES}}
    ignored = [
        {"name": name, "in": "header", "required": True, "schema": {"enum": ["roaas"]}}
        for name in ("Authorization", "accept", "Content-Type")
    ]
    paths["/ignored"] = {"get": {"parameters": ignored, "responses": _RESPONSES}}
    return paths


def _refusing(is_right):
    async def handle(request):
        try:
            right = is_right(request, await request.text())
        except (KeyError, ValueError):
            right = False
        return web.json_response({}) if right else error(400, "refused")

    return handle


def _of_pairs(request, _):
    texts = unquote_plus(request.rel_url.raw_query_string.removeprefix("p=")).split(",")
    members = dict(zip(texts[::2], texts[1::2], strict=True))
    return "x" in members and all(re.fullmatch(_NUMBER, members.get(name, "0"), re.ASCII) for name in "xy")


def _of_query(pattern):
    if pattern is None:
        return _of_pairs
    return lambda request, _: re.fullmatch(pattern, unquote_plus(request.rel_url.raw_query_string), re.ASCII)


def _of_path(pattern):
    return lambda request, _: re.fullmatch(pattern, unquote(request.rel_url.raw_path.rsplit("/", 1)[1]), re.ASCII)


def _of_form(_, text):
    fields = [part.split("=") for part in text.split("&")]
    values = {unquote_plus(name): unquote_plus(value) for name, value in fields}
    whole = len(values) == len(fields) and re.fullmatch(r"\d", values["n"], re.ASCII) is not None
    return whole and re.fullmatch(r"\d(,\d){1,2}", values.get("ids", "1,2"), re.ASCII)


def _strict():
    routes = {path: {"GET": _refusing(_of_query(pattern))} for path, (_, pattern) in _QUERIES.items()}
    routes |= {path: {"GET": _refusing(_of_path(pattern))} for path, (_, pattern) in _PATHS.items()}
    routes["/header"] = {
        "GET": _refusing(lambda request, _: re.fullmatch(r"\d(, ?\d){1,2}", request.headers.get("X-Ids", "")))
    }
    routes["/cookie"] = {"GET": _refusing(lambda request, _: request.cookies.get("mode") in {"auto", "manual"})}
    routes["/form"] = {"POST": _refusing(_of_form)}
    return routes | {"/ignored": constant({})}


def _lax():
    routes = {path: {method.upper(): _refusing(lambda *_: True) for method in item} for path, item in _paths().items()}
    return routes | {"/ignored": constant({})}


def test_each_style_that_a_device_reads_rightly_passes(tmp_path):
    with small_device(described(_paths()), _strict()) as url:
        seen = certified(f"{url}/openapi.json", tmp_path / "out", "--call", "*")
    assert seen.blamed == {}
    assert seen.exit_code == 0
    assert f"{len(_paths())} of {len(_paths())} operations called" in seen.text


@pytest.mark.parametrize("first", [0, 9])
def test_a_device_that_takes_anything_in_any_style_is_caught_at_quick(tmp_path, first):
    some = dict(list(_paths().items())[first : first + 9])
    with small_device(described(some), {path: _lax()[path] for path in some}) as url:
        more = ("--call", "*", "--select", "description/invalid-refused")
        seen = certified(f"{url}/openapi.json", tmp_path / "out", *more)
    assert seen.blamed["description/invalid-refused"] == "fail"
    found = {one["operation"].split()[1] for one in seen.result["api"]["operations"] if one["findings"]}
    assert found == some.keys() - {"/ignored"}


async def _locked(request):
    refusals = {"lease": error(428, "no lease"), "limit": error(403, "no"), "taken": error(409, "taken")}
    states = request.query.getall("state", ["free"])
    return web.json_response({}) if states == ["free"] else refusals.get(states[0]) or error(400, "no such state")


_STATES = {"name": "state", "in": "query", "schema": {"enum": ["free", "lease", "limit", "taken"]}}


def test_a_status_that_the_application_decides_on_has_to_be_declared(tmp_path):
    declared = {
        "/bare": {"400": REFUSED},
        "/class": {"400": REFUSED, "4XX": REFUSED},
        "/default": {"default": REFUSED},
        "/each": {"400": REFUSED, "403": REFUSED, "409": REFUSED, "428": REFUSED},
    }
    ok = {"200": answers({"type": "object"})}
    paths = {path: {"get": {"parameters": [_STATES], "responses": ok | more}} for path, more in declared.items()}
    with small_device(described(paths), {path: {"GET": _locked} for path in paths}) as url:
        seen = certified(f"{url}/openapi.json", tmp_path / "out", "--class", "description")
    found = {one["operation"]: len(one["findings"]) for one in seen.result["api"]["operations"]}
    assert found == {"GET /bare": 3, "GET /class": 0, "GET /default": 0, "GET /each": 0}
    assert seen.blamed == {"description/status-declared": "fail"}


@pytest.mark.parametrize(("absent", "invalid", "blamed"), [(204, 204, False), (404, 204, True), (204, 400, False)])
def test_an_idempotent_delete_may_succeed_for_what_a_path_cannot_name(tmp_path, absent, invalid, blamed):
    name = {"name": "name", "in": "path", "required": True, "schema": {"type": "string", "pattern": "^[a-z]{1,8}$"}}
    gone = {"description": "no such thing any more"}
    document = described(
        {"/maps/{name}": {"delete": {"parameters": [name], "responses": {"204": gone, "4XX": REFUSED}}}}
    )

    async def delete(request):
        status = absent if re.fullmatch("[a-z]{1,8}", request.match_info["name"]) else invalid
        return web.Response(status=status) if status == 204 else error(status, "refused")

    with small_device(document, {"/maps/{name}": {"DELETE": delete}}) as url:
        more = ("--call", "*", "--select", "description/invalid-refused")
        seen = certified(f"{url}/openapi.json", tmp_path / "out", *more)

    assert (seen.blamed.get("description/invalid-refused") == "fail") is blamed, seen.text


@pytest.mark.parametrize("demanded", [{"minProperties": 1}, {"anyOf": [{"required": ["a"]}, {"required": ["b"]}]}])
def test_a_body_without_all_optional_members_is_not_asked_for_where_one_is_demanded(tmp_path, demanded):
    part = {"type": "object", "properties": {"a": {"type": "integer"}, "b": {"type": "string"}}, **demanded}
    body = {"required": True, "content": {"application/json": {"schema": part}}}
    responses = {"200": answers({"type": "object"}), "4XX": REFUSED}
    document = described({"/settings": {"patch": {"requestBody": body, "responses": responses}}})
    takes = jsonschema_rs.validator_for(part).is_valid

    async def patch(request):
        try:
            right = request.content_type == "application/json" and takes(json.loads(await request.text()))
        except ValueError:
            right = False
        return web.json_response({}) if right else error(422, "refused")

    with small_device(document, {"/settings": {"PATCH": patch}}) as url:
        more = ("--call", "*", "--select", "description/optional")
        seen = certified(f"{url}/openapi.json", tmp_path / "out", *more)

    assert "description/optional" not in seen.blamed, seen.text
