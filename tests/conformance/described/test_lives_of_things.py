"""What a run created is read once more at its end; the lives of things are those of hostile/test_kept_things.py."""

import asyncio
import itertools

import pytest
from aiohttp import web
from small_device import REFUSED, answers, certified, described, error, reading, small_device


def test_what_was_created_is_read_once_more_at_the_end(tmp_path):
    made, sent = [], []
    job = {"type": "object", "required": ["id"], "properties": {"id": {"type": "string"}}}
    item = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
    created = {"201": answers(job), "4XX": REFUSED}
    document = described({"/jobs": {"post": {"responses": created}}, "/jobs/{id}": reading(job, parameters=[item])})

    async def create(_):
        made.append(f"j{len(made)}")
        sent.clear()
        return web.json_response({"id": made[-1]}, status=201, headers={"Location": f"/jobs/{made[-1]}"})

    async def read(request):
        sent.append(request.path)
        is_there = request.match_info["id"] in made
        return web.json_response({"id": request.match_info["id"]}) if is_there else error(404, "no such job")

    with small_device(document, {"/jobs": {"POST": create}, "/jobs/{id}": {"GET": read}}) as url:
        seen = certified(f"{url}/openapi.json", tmp_path / "out", "--call", "*")

    assert seen.exit_code == 0, seen.text
    assert {f"/jobs/{one}" for one in made[:30]} <= set(sent)  # since the last one was created


@pytest.mark.parametrize("keeps_half", [False, True])
def test_a_creation_may_change_what_has_the_same_key(tmp_path, keeps_half):
    parts, ids = {}, itertools.count(1)
    text = {"type": "string", "maxLength": 40}
    part = {"type": "object", "properties": {"serial": {"type": "string", "enum": ["A1"]}, "label": text, "note": text}}
    shown = {**part, "properties": {**part["properties"], "id": {"type": "integer"}}}
    item = {"name": "id", "in": "path", "required": True, "schema": {"type": "integer"}}
    sent, known = {"required": True, "content": {"application/json": {"schema": part}}}, {"200": answers(shown)}
    document = described(
        {
            "/parts": {"post": {"requestBody": sent, "responses": {**known, "201": answers(shown), "4XX": REFUSED}}},
            "/parts/{id}": {
                "parameters": [item],
                **reading(shown),
                "patch": {"requestBody": sent, "responses": {**known, "4XX": REFUSED}},
                "delete": {"responses": {"204": {"description": "gone"}, "4XX": REFUSED}},
            },
        }
    )

    async def body_of(request):
        try:
            body = await request.json()
        except ValueError:
            return None, True
        wrong = not isinstance(body, dict) or [
            name
            for name, one in body.items()
            if name in part["properties"]
            and not (isinstance(one, str) and len(one) <= 40 and (name != "serial" or one == "A1"))
        ]
        return body, wrong

    async def create(request):
        body, wrong = await body_of(request)
        if wrong:
            return error(422, "no part")
        serial = body.get("serial", "A1")
        known = next((number for number, one in parts.items() if one["serial"] == serial), None)
        number = known or next(ids)
        parts.setdefault(number, {"id": number, "serial": serial, "label": "", "note": ""}).update(body)
        return web.json_response(parts[number], status=200 if known else 201, headers={"Location": f"/parts/{number}"})

    async def one(request):
        number = request.match_info["id"]
        found = parts.get(int(number)) if number.isdigit() else None
        if found and request.method == "DELETE":
            del parts[found["id"]]
            return web.Response(status=204)
        if found is None or request.method != "PATCH":
            return web.json_response(found) if found else error(404, "no such part")
        body, wrong = await body_of(request)
        if wrong:
            found.update(label=f"{len(found['label'])}") if keeps_half and isinstance(body, dict) else None
            return error(422, "no part")
        found.update(body)
        return web.json_response(found)

    routes = {"/parts": {"POST": create}, "/parts/{id}": {"GET": one, "PATCH": one, "DELETE": one}}
    with small_device(document, routes) as url:
        seen = certified(f"{url}/openapi.json", tmp_path / "out", "--call", "*")
    assert seen.blamed == ({"description/refused-keeps": "fail"} if keeps_half else {}), seen.text


class _Lamps:
    """Lamps that are created in a room and have paths of their own, and their photos."""

    def __init__(self, fault):
        self.fault, self.lamps, self.made = fault, {}, itertools.count(1)
        text, number = {"type": "string", "maxLength": 40}, {"type": "integer"}
        lamp = {"type": "object", "required": ["name"], "properties": {"name": text}}
        shown = {**lamp, "properties": {"id": number, "room": text, **lamp["properties"]}}
        ids = {
            name: {"name": name, "in": "path", "required": True, "schema": one}
            for name, one in (("room", {"enum": ["hall"]}), ("id", number))
        }
        body = {"required": True, "content": {"application/json": {"schema": lamp}}}
        octets = {"image/png": {"schema": {"type": "string", "format": "binary"}}}
        bad, none, found = {"4XX": REFUSED}, {"description": "done"}, answers(shown)
        self.description = described(
            {
                "/rooms/{room}/lamps": {
                    "parameters": [ids["room"]],
                    "get": {"responses": {"200": answers({"type": "array", "items": shown}), **bad}},
                    "post": {"requestBody": body, "responses": {"201": found, **bad}},
                },
                "/lamps/{id}": {
                    "parameters": [ids["id"]],
                    **reading(shown),
                    "put": {"requestBody": body, "responses": {"200": found, **bad}},
                    "delete": {"responses": {"204": none, **bad}},
                },
                "/lamps/{id}/photo": {
                    "parameters": [ids["id"]],
                    "get": {"responses": {"200": {"description": "a photo", "content": octets}, **bad}},
                    "put": {"requestBody": {"required": True, "content": octets}, "responses": {"204": none, **bad}},
                },
            }
        )
        self.routes = {
            "/rooms/{room}/lamps": {"GET": self.in_room, "POST": self.create},
            "/lamps/{id}": {"GET": self.one, "PUT": self.one, "DELETE": self.one},
            "/lamps/{id}/photo": {"GET": self.photo, "PUT": self.photo},
        }

    def shown(self, number):
        return {"id": number, "room": "hall", "name": self.lamps[number][0]}

    async def name_in(self, request):
        try:
            body = await request.json() if request.content_type == "application/json" else None
        except ValueError:
            return None
        name = body.get("name") if isinstance(body, dict) else None
        return name if isinstance(name, str) and len(name) <= 40 else None

    async def in_room(self, request):
        if request.match_info["room"] != "hall":
            return error(404, "no such room")
        gone = "a deleted lamp is listed" in self.fault
        there = [number for number, one in self.lamps.items() if gone or one[2]]
        return web.json_response([self.shown(number) for number in there])

    async def create(self, request):
        name = await self.name_in(request)
        if name is None or request.match_info["room"] != "hall":
            return error(422, "no lamp")
        if any(one[0] == name and one[2] for one in self.lamps.values()):
            return error(409, "another lamp has this name")
        if "twins" in self.fault:
            await asyncio.sleep(0.05)
        number = next(self.made)
        self.lamps[number] = [name, b"", number % 3 > 0 or "the third lamp is lost" not in self.fault]
        return web.json_response(self.shown(number), status=201, headers={"Location": f"/lamps/{number}"})

    def found(self, request):
        text = request.match_info["id"]
        lamp = self.lamps.get(int(text)) if text.isascii() and text.isdigit() else None
        return lamp if lamp is not None and lamp[2] else None

    async def one(self, request):
        lamp = self.found(request)
        if lamp is None:
            return error(404, "no such lamp")
        if request.method == "DELETE":
            lamp[2] = False
            return web.Response(status=204)
        if request.method == "PUT":
            name = await self.name_in(request)
            if name is None:
                return error(422, "no lamp")
            lamp[0] = name
        return web.json_response(self.shown(int(request.match_info["id"])))

    async def photo(self, request):
        lamp = self.found(request)
        if lamp is None or (request.method != "PUT" and not lamp[1]):
            return error(404, "no photo")
        if request.method == "PUT":
            octets = await request.read()
            if not octets.startswith(b"\x89PNG") or request.content_type != "image/png":
                return error(422, "no PNG")
            lamp[1] = octets[:4096] if "a photo is cut" in self.fault else octets
            return web.Response(status=204)
        return web.Response(body=lamp[1], content_type="image/png")


@pytest.mark.side_by_side
@pytest.mark.parametrize(
    ("fault", "blamed"),
    [
        ("", set()),
        ("a deleted lamp is listed", {"deleted-is-gone"}),
        ("the third lamp is lost", {"created-is-there"}),
        ("a photo is cut", {"written-is-read"}),
        ("twins at once", {"created-is-there"}),
    ],
)
def test_things_below_others_with_paths_of_their_own(tmp_path, fault, blamed):
    device = _Lamps(fault)
    with small_device(device.description, device.routes) as url:
        seen = certified(f"{url}/openapi.json", tmp_path / "out", "--call", "*", "--class", "description")
    assert {f"description/{name}" for name in blamed} <= seen.blamed.keys(), seen.text
    assert blamed or not seen.blamed, seen.text
