"""Lists as CSV obey the filters that they obey as JSON."""

import pytest
from aiohttp import web
from driven_device import driven
from small_device import REFUSED, answers, described

from conformance.api.rest.values import Values
from conformance.scenarios.tables import tables

_ITEM = {"type": "object", "properties": {"number": {"type": "integer"}, "level": {"enum": ["low", "high"]}}}
_LEVEL = {"in": "query", "name": "level", "schema": _ITEM["properties"]["level"]}
_ENTRIES = [{"number": number, "level": "high" if number % 3 else "low"} for number in range(6)]


def _device(ignoring):
    """Return the description and the routes of a log whose filter some media types ignore."""
    listed = answers({"type": "array", "items": _ITEM})
    listed["content"]["text/csv"] = {"schema": {"type": "string"}}

    async def entries(request):
        media_type = "text/csv" if "csv" in request.headers.get("Accept", "") else "application/json"
        level = "" if media_type in ignoring else request.query.get("level", "")
        found = [one for one in _ENTRIES if level in {"", one["level"]}]
        if media_type == "application/json":
            return web.json_response(found)
        text = "".join(f"{one['number']},{one['level']}\r\n" for one in found)
        return web.Response(text=f"number,level\r\n{text}", content_type="text/csv")

    paths = {"/log": {"get": {"parameters": [_LEVEL], "responses": {"200": listed, "4XX": REFUSED}}}}
    return described(paths, "3.1.0"), {"/log": {"GET": entries}}


@pytest.mark.parametrize(
    ("ignoring", "is_found"), [((), False), (("text/csv",), True), (("text/csv", "application/json"), False)]
)
def test_a_filter_holds_for_both_formats(tmp_path, ignoring, is_found):
    with driven(*_device(ignoring), tmp_path) as (api, _, _):
        found = tables.play(api, Values({}, frozenset()))
    assert [bool(one.fault) for one in found if one.fault] == [True] * is_found


def _log_below_a_zone(writer):
    """Return the description and the routes of entries below zones, without an entry; writer: makes a line of CSV."""
    entries, text = {}, {"type": "string"}
    parts = {"number": {"type": "integer", "readOnly": True}, "level": text, "note": text}
    schema = {"type": "object", "properties": parts}
    listed = answers({"type": "array", "items": schema})
    listed["content"]["text/csv"] = {"schema": text}
    posted = {"required": True, "content": {"application/json": {"schema": {**schema, "required": ["level"]}}}}

    async def create(request):
        of = entries.setdefault(request.match_info["zone"], [])
        of.append({"note": "", **await request.json(), "number": len(of)})
        return web.json_response(of[-1], status=201)

    async def read(request):
        of = entries.get(request.match_info["zone"], [])
        if "csv" not in request.headers.get("Accept", ""):
            return web.json_response(of)
        rows = "".join(writer(one) + "\r\n" for one in of)
        return web.Response(text=f"number,level,note\r\n{rows}", content_type="text/csv")

    zone = {"in": "path", "name": "zone", "required": True, "schema": text, "example": "north"}
    paths = {
        "/zones/{zone}/entries": {
            "parameters": [zone],
            "get": {"responses": {"200": listed, "4XX": REFUSED}},
            "post": {"requestBody": posted, "responses": {"201": answers(schema), "4XX": REFUSED}},
        }
    }
    return described(paths, "3.1.0"), {"/zones/{zone}/entries": {"GET": read, "POST": create}}


def _quoted(entry):
    notes = entry["note"].replace('"', '""')
    return f'{entry["number"]},"{entry["level"].replace(chr(34), chr(34) * 2)}","{notes}"'


@pytest.mark.parametrize(
    ("writer", "is_found"), [(_quoted, False), (lambda one: f"{one['number']},{one['level']},{one['note']}", True)]
)
def test_texts_below_a_thing_are_quoted(tmp_path, writer, is_found):
    with driven(*_log_below_a_zone(writer), tmp_path) as (api, _, _):
        found = tables.play(api, Values({}, frozenset()))
    assert [bool(one.fault) for one in found] == [is_found], found
