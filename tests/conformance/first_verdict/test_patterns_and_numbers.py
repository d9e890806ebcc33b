"""Patterns of ECMA-262, numbers in any spelling, and formats: right devices pass, wrong ones are told each place."""

import json
import math
import unicodedata

import pytest
from aiohttp import web
from small_device import REFUSED, answers, certified, constant, described, error, reading, small_device

_NAMED = r"^(?<k>[ab])\k<k>$"
_PATTERNS = {
    "named": (_NAMED, "aa", "ab"),
    "letters": (r"^\p{L}+$", "aé", "a1"),
    "greek": (r"^\p{Script=Greek}+$", "αβ", "ab"),
    "digit": (r"^\d$", "3", "٣"),
    "behind": (r"(?<=a+)b$", "aab", "cb"),
    "any": (r"^[^]\cA\u{1F600}$", "\n\x01😀", "x"),
    "end": (r"^a$", "a", "a\n"),
}
_FORMATS = {
    "ticks": ("integer", "int32", 2147483647, 4294967295),
    "ns": ("integer", "int64", -(2**63), 18446744073709551615),
    "gain": ("number", "float", 0.1, 1e39),
    "png": ("string", "byte", "_-A", "not base64 at all!"),
    "id": ("string", "uuid", "3FA85F64-5717-4562-B3FC-2C963F66AFA6", "17"),
    "every": ("string", "duration", "P2W", "2 weeks"),
    "at": ("string", "date-time", "1998-12-31t23:59:60z", "1998-12-31 23:59:59"),
}
_NUMBERS = {
    "small": ({"type": "number", "multipleOf": 0.00001, "minimum": -90, "maximum": 90}, 52.12345),
    "large": ({"type": "number", "maximum": 1e16, "exclusiveMinimum": -1e300}, 1e-05),
    "whole": ({"type": "integer"}, 1.0),
    "zero": ({"type": "number", "minimum": 0}, -0.0),
    "huge": ({"type": "integer", "maximum": 2**70}, 2**70),
    "cents": ({"type": "number", "multipleOf": 0.01}, 19.99),
}


async def _find(request: web.Request) -> web.Response:
    """Return an object for a q of one to eight letters."""
    texts = request.query.getall("q", [])
    letters = all(1 <= len(text) <= 8 and all(unicodedata.category(one)[0] == "L" for one in text) for text in texts)
    return web.json_response({}) if len(texts) <= 1 and letters else error(400, "q")


def _number(text: str) -> float:
    """Return the finite number that a text stands for."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


async def _gain(request: web.Request) -> web.Response:
    """Take a positive gain in the query and in the body."""
    try:
        given = json.loads((await request.read()).decode(), parse_constant=_number)
        values = [given["ki"], *(_number(text) for text in request.query.getall("step", []))]
        positive = all(type(one) in {int, float} and 0 < one < 1e308 for one in values)
    except (ValueError, KeyError, TypeError, RecursionError):
        return error(400, "no gain")
    if request.content_type != "application/json":
        return error(415, "JSON")
    return web.Response(status=204) if positive and len(values) < 3 else error(400, "no gain")


def _device(values, which):
    """Return the paths and routes of a device that answers the value of this number in each row."""
    paths, routes = {}, {}
    for name, (pattern, *texts) in _PATTERNS.items():
        schema = {"type": "object", "required": ["v"], "properties": {"v": {"type": "string", "pattern": pattern}}}
        paths[f"/{name}"] = reading(schema)
        routes[f"/{name}"] = constant({"v": texts[which]})
    formats = {name: {"type": kind, "format": word} for name, (kind, word, *_) in _FORMATS.items()}
    paths["/formats"] = reading({"type": "object", "required": list(formats), "properties": formats})
    routes["/formats"] = constant({name: row[2 + values] for name, row in _FORMATS.items()})
    return paths, routes


def test_what_is_right_by_ecma_262_and_json_passes(tmp_path):
    paths, routes = _device(0, 0)
    numbers = {name: schema for name, (schema, _) in _NUMBERS.items()}
    paths["/numbers"] = reading({"type": "object", "required": list(numbers), "properties": numbers})
    routes["/numbers"] = constant({name: value for name, (_, value) in _NUMBERS.items()})
    names = {"type": "object", "patternProperties": {_NAMED: {"type": "integer"}}, "additionalProperties": False}
    paths["/names"], routes["/names"] = reading(names), constant({"aa": 1, "bb": 2})
    word = {"name": "q", "in": "query", "schema": {"type": "string", "pattern": r"^\p{L}{1,8}$"}}
    paths["/find"], routes["/find"] = reading({"type": "object"}, parameters=[word]), {"GET": _find}
    positive = {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1e308}
    body = {"type": "object", "required": ["ki"], "properties": {"ki": positive}}
    step = {"name": "step", "in": "query", "schema": positive, "example": 0.00001}
    content = {"application/json": {"schema": body, "example": {"ki": 0.00001}}}
    refused = {"204": {"description": "set"}, "400": REFUSED, "415": REFUSED}
    put = {"parameters": [step], "requestBody": {"required": True, "content": content}, "responses": refused}
    paths["/gain"], routes["/gain"] = {"put": put}, {"PUT": _gain}
    with small_device(described(paths, "3.1.0"), routes) as url:
        said = certified(f"{url}/openapi.json", tmp_path / "out", "--call", "*")
    assert (said.exit_code, said.blamed) == (0, {}), said.text


def test_what_is_wrong_by_ecma_262_and_by_its_format_is_told(tmp_path):
    paths, routes = _device(1, 1)
    with small_device(described(paths, "3.1.0"), routes) as url:
        said = certified(f"{url}/openapi.json", tmp_path / "out", "--class", "description")
    assert said.exit_code == 1
    assert said.blamed == {"description/body-schema": "fail", "description/formats": "warn"}, said.text
    told = json.dumps(said.requirement("description/body-schema"))
    assert all(f"/{name}" in told for name in _PATTERNS)
    warned = json.dumps(said.requirement("description/formats"))
    assert all(f"at /{name}, which is no {row[1]}" in warned for name, row in _FORMATS.items())


@pytest.mark.parametrize(
    ("pattern", "exit_code", "text"),
    [("(?P<n>a)", 1, "no regular expression of ECMA-262"), (r"^(?=a)(a+)+$", 4, "GET /t: not judged: the pattern")],
)
def test_a_pattern_that_cannot_be_judged_is_told_and_the_rest_is_judged(tmp_path, pattern, exit_code, text):
    member = {"type": "string", "pattern": pattern}
    paths = {
        "/t": reading({"type": "object", "properties": {"v": member}}, parameters=[
            {"name": "q", "in": "query", "schema": member}
        ]),
        "/other": {"get": {"responses": {"200": answers({"type": "integer"}), "4XX": REFUSED}}},
    }  # fmt: skip

    async def taking_letters(request):
        is_right = set(request.query.get("q", "a")) == {"a"}
        return web.json_response({"v": "a" * 60 + "!"}) if is_right else error(400, "no letters a")

    with small_device(described(paths, "3.1.0"), {"/t": {"GET": taking_letters}, "/other": constant(1)}) as url:
        said = certified(f"{url}/openapi.json", tmp_path / "out", "--class", "description")
    assert said.exit_code == exit_code, said.text
    assert text in said.text
    if exit_code == 1:
        (finding,) = said.requirement("description/file-valid")["failures"]
        assert text in json.dumps(finding)
        assert said.blamed == {"description/file-valid": "fail"}, said.text
