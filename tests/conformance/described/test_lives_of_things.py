"""What a run created is read once more at its end; the lives of things are those of hostile/test_kept_things.py."""

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
