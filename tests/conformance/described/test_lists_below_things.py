"""A list below a thing, whose items have no path of their own, is judged while it has items."""

import asyncio
import itertools
import json
import re

import pytest
from aiohttp import web
from small_device import REFUSED, answers, body_of, certified, described, error, object_of, reading, small_device

pytestmark = pytest.mark.side_by_side
_SHELF = object_of("id", "name", id={"type": "integer"}, name={"type": "string"})
_NEW = object_of("name", name={"type": "string", "minLength": 1})
_NOTE = object_of(
    "id", "text", "at", id={"type": "integer"}, text={"type": "string"}, at={"type": "string", "format": "date-time"}
)
_TEXT = object_of("text", text={"type": "string", "minLength": 1})
_ID = {"parameters": [{"in": "path", "name": "shelfId", "required": True, "schema": {"type": "integer"}}]}
_PARTS = [
    {"in": "query", "name": name, "schema": {"type": "integer", "minimum": least, "maximum": 99}}
    for name, least in (("limit", 1), ("offset", 0))
]


def _made(body, schema):
    content = {"application/json": {"schema": body}}
    return {
        "requestBody": {"required": True, "content": content},
        "responses": {"201": answers(schema), "4XX": REFUSED},
    }


def _device(fault):  # noqa: C901 - a device
    shelves, notes, count = {1: {"id": 1, "name": "first"}}, {}, itertools.count(2)

    async def given(request, name):
        try:
            value = await request.json() if request.content_type == "application/json" else None
        except (ValueError, RecursionError):
            return None
        text = value.get(name) if isinstance(value, dict) else None
        is_text = isinstance(text, str) and text and not any(0xD800 <= ord(one) < 0xE000 for one in text)
        return text if is_text else None

    async def listed(_):
        return web.json_response(list(shelves.values()))

    async def create(request):
        if (name := await given(request, "name")) is None:
            return error(400, "a name, please")
        shelf = {"id": next(count), "name": name}
        shelves[shelf["id"]] = shelf
        return web.json_response(shelf, status=201)

    def of(request):
        text = request.match_info["shelfId"]
        return shelves.get(int(text)) if text.isascii() and text.isdigit() and len(text) < 18 else None

    async def read(request):
        return web.json_response(of(request)) if of(request) else error(404, "no such shelf")

    async def noted(request):
        if of(request) is None:
            return error(404, "no such shelf")
        limit, offset = (request.query.get(name, least) for name, least in (("limit", "20"), ("offset", "0")))
        if not all(re.fullmatch(r"0|[1-9][0-9]?", one) for one in (limit, offset)) or limit == "0":
            return error(400, "a number, please")
        kept = [one for some in notes.values() for one in some] if fault == "all" else notes.get(of(request)["id"], [])
        begin = int(offset) + (fault == "gap" and offset > "1")
        shown = [dict(one) for one in kept[begin : begin + int(limit)]]
        for one in shown:
            if fault == "time":
                one["at"] = one["at"].removesuffix("Z")
            if fault == "text":
                one["text"] = "".join(sign if ord(sign) < 0x10000 else "\ufffd" for sign in one["text"])
            if fault == "short":
                one["text"] = f"{one['text'][:4]}\u2026"
        return web.json_response(shown)

    async def note(request):
        if of(request) is None:
            return error(404, "no such shelf")
        if (text := await given(request, "text")) is None:
            return error(400, "a text, please")
        kept = notes.setdefault(of(request)["id"], [])
        made = {"id": len(kept) + 1 if fault == "number" else next(count), "text": text, "at": "2026-11-01T10:00:00Z"}
        await asyncio.sleep(0.1 if fault == "number" else 0)
        kept.append(made)
        return web.json_response(made, status=201)

    shelf_list, note_list = ({"type": "array", "items": one} for one in (_SHELF, _NOTE))
    paths = {
        "/shelves": {**reading(shelf_list), "post": _made(_NEW, _SHELF)},
        "/shelves/{shelfId}": {**_ID, **reading(_SHELF)},
        "/shelves/{shelfId}/notes": {
            **_ID,
            "get": {**reading(note_list)["get"], "parameters": _PARTS},
            "post": _made(_TEXT, _NOTE),
        },
    }
    routes = {
        "/shelves": {"GET": listed, "POST": create},
        "/shelves/{shelfId}": {"GET": read},
        "/shelves/{shelfId}/notes": {"GET": noted, "POST": note},
    }
    return small_device(described(paths), routes)


@pytest.mark.parametrize(
    ("fault", "blamed"),
    [
        ("", []),
        ("short", []),
        ("time", ["description/formats"]),
        ("text", ["description/written-is-read"]),
        ("number", ["description/created-is-there"]),
        ("all", ["description/own-identifier"]),
        ("gap", ["description/list-pages"]),
    ],
)
def test_what_is_created_below_a_thing_is_read_in_its_list(fault, blamed, tmp_path):
    with _device(fault) as url:
        done = certified(f"{url}/openapi.json", tmp_path, "--call", "POST *", "--select", *(blamed or ["description"]))
    assert set(done.blamed) == set(blamed), done.text


@pytest.mark.parametrize("fault", [False, True])
def test_what_nobody_can_create_is_written_as_well(fault, tmp_path):
    tray = {"label": "left", "note": "a", "serviced_on": "2026-01-31"}
    known = set(tray)
    schema = {
        "type": "object",
        "required": ["label", "note"],
        "properties": {
            "label": {"type": "string"},
            "note": {"type": ["string", "null"]},
            "serviced_on": {"type": "string", "format": "date"},
        },
        "additionalProperties": False,
    }
    free = {**schema["properties"], "serviced_on": {"type": ["string", "null"], "format": "date"}}
    taken = {**schema, "properties": free, "required": []}
    patch = body_of(taken, "application/merge-patch+json")

    async def read(request):
        return web.json_response(tray) if request.match_info["trayId"] == "1" else error(404, "no such tray")

    async def change(request):
        try:
            value = json.loads(await request.text())
            json.dumps(value, ensure_ascii=False).encode()
        except (ValueError, RecursionError):
            return error(400, "JSON, please")
        texts = [1]
        if isinstance(value, dict):
            texts = [one for name, one in value.items() if name == "label" or one is not None]
        if request.content_type != next(iter(patch["content"])):
            return error(415, "a merge patch, please")
        day = value.get("serviced_on") if isinstance(value, dict) else None
        is_day = day is None or (
            isinstance(day, str) and re.fullmatch(r"20[0-9][0-9]-0[1-9]-[0-2][1-8]|2026-01-31", day)
        )
        if not all(isinstance(one, str) for one in texts) or not value.keys() <= known or not is_day:
            return error(400, "texts and a day, please")
        tray.update({name: one for name, one in value.items() if one is not None or not fault})
        if tray.get("serviced_on", "") is None:
            del tray["serviced_on"]
        return await read(request)

    async def find(request):
        is_there = request.match_info["trayId"] == "1"
        return web.json_response({"id": 1, "text": "a", "at": "2026-11-01T10:00:00Z"}) if is_there else error(404, "no")

    item = {**reading(schema), "patch": {"requestBody": patch, "responses": {"200": answers(schema), "4XX": REFUSED}}}
    number = {"in": "path", "name": "trayId", "required": True, "schema": {"type": "integer"}, "example": 1}
    # A collection with the name of a member that is a text.
    paths = {
        "/trays/{trayId}": {"parameters": [number], **item},
        "/notes/{trayId}": {"parameters": [number], **reading(_NOTE)},
    }
    routes = {"/trays/{trayId}": {"GET": read, "PATCH": change}, "/notes/{trayId}": {"GET": find}}
    with small_device(described(paths, "3.1.0"), routes) as url:
        done = certified(f"{url}/openapi.json", tmp_path, "--call", "PATCH *", "--class", "description")
    assert set(done.blamed) == ({"description/patch"} if fault else set()), done.text
    failures = done.requirement("description/patch")["failures"]
    said = [failure["expected"].partition(",")[0] for failure in failures]
    assert set(said) >= ({"no note", "no serviced_on"} if fault else set()), said
