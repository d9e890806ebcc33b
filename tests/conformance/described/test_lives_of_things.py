"""Things that are created, written and deleted: no right device is blamed, in whatever shape, and faults are found."""

import asyncio

import pytest
from aiohttp import web
from small_device import REFUSED, answers, certified, described, error, reading, small_device

_WRITTEN = {
    "type": "object",
    "required": ["label", "level"],
    "properties": {
        "label": {"type": "string", "minLength": 1, "maxLength": 20},
        "level": {"type": "integer", "minimum": 0, "maximum": 90},
    },
}


def _things(shape, fault):  # noqa: C901, PLR0915 - one device
    """Return the description and the routes of a device with one collection."""
    end, key, wrapped = shape.get("end", ""), shape.get("key", "id"), shape.get("wrapped", False)
    thing = {"type": "object", "properties": {"id": {"type": "integer", "readOnly": True}, **_WRITTEN["properties"]}}
    shown = {"type": "object", "properties": {"data": thing}} if wrapped else thing
    content = {"required": True, "content": {"application/json": {"schema": _WRITTEN}}}
    bad = {"4XX": REFUSED}
    document = described(
        {
            f"/valves{end}": {
                "get": {"responses": {"200": answers({"type": "array", "items": thing}), **bad}},
                "post": {"requestBody": content, "responses": {"201": answers(shown), **bad}},
            },
            f"/valves/{{{key}}}{end}": {
                "parameters": [{"in": "path", "name": key, "required": True, "schema": {"type": "integer"}}],
                "get": {"responses": {"200": answers(shown), **bad}},
                "put": {"requestBody": content, "responses": {"200": answers(shown), **bad}},
                "delete": {"responses": {"204": {"description": "gone"}, **bad}},
            },
        }
    )
    there, count = {1: {"id": 1, "label": "first", "level": 3}}, [1]

    def later(act, *values):
        if shape.get("later"):
            asyncio.get_running_loop().call_later(shape["later"], act, *values)
        else:
            act(*values)

    def body(value):
        return web.json_response({"data": value} if wrapped else value)

    async def given(request):
        try:
            value = await request.json()
        except ValueError:
            return None
        right = (
            isinstance(value, dict)
            and isinstance(value.get("label"), str)
            and 1 <= len(value["label"]) <= 20
            and type(value.get("level")) is int
            and 0 <= value["level"] <= 90
        )
        return {"label": value["label"].strip().lower(), "level": value["level"]} if right else None

    async def post(request):
        if (value := await given(request)) is None:
            return error(422, "not valid")
        count[0] += 1
        if fault != "created is lost":
            kept = {"id": count[0], **value, **({"label": "new"} if fault == "POST changes" else {})}
            later(there.__setitem__, count[0], kept)
        told = {"id": count[0] + (5000 if fault == "wrong id" else 0), **value}
        answer = web.json_response({"data": told} if wrapped else told, status=201)
        if shape.get("located"):
            answer = web.Response(status=201, headers={"Location": f"/valves/{told['id']}{end}"})
        return answer

    def of(request):
        text = request.match_info["key"]
        return int(text) if text.isascii() and text.isdigit() and len(text) < 18 else None

    async def get(request):
        number = of(request)
        if number not in there:
            is_past = number is not None and number <= count[0]
            return error(shape.get("gone", 404) if is_past else 404, "no such valve")
        return body(there[number])

    async def put(request):
        number = of(request)
        if number not in there:
            return error(404, "no such valve")
        if (value := await given(request)) is None:
            return error(422, "not valid")
        kept = {**value, "level": min(value["level"], 60)} if fault == "PUT clamps" else value
        if shape.get("clamps"):
            value = kept = {**value, "level": max(value["level"], 30)}
        if fault != "PUT without effect":
            later(there.__setitem__, number, {"id": number, **kept})
        return body({"id": number, **value})

    async def delete(request):
        number = of(request)
        if number not in there:
            return error(404, "no such valve")
        if fault != "DELETE keeps":
            later(there.pop, number, None)
        return web.Response(status=204)

    async def every(_):
        return web.json_response(list(there.values()))

    routes = {f"/valves{end}": {"GET": every, "POST": post}}
    routes[f"/valves/{{key}}{end}"] = {"GET": get, "PUT": put, "DELETE": delete}
    return document, routes


_SHAPES = {
    "plain": {},
    "slash": {"end": "/", "key": "pk"},
    "located": {"located": True, "key": "valve_id"},
    "wrapped": {"wrapped": True},
    "later": {"later": 0.5, "gone": 410},
    "clamps and says so": {"clamps": True},
}
_FAULTS = [
    ("slash", "created is lost", "description/created-is-there"),
    ("wrapped", "wrong id", "description/created-is-there"),
    ("slash", "POST changes", "description/written-is-read"),
    ("wrapped", "PUT clamps", "description/written-is-read"),
    ("located", "PUT without effect", "description/written-is-read"),
    ("slash", "DELETE keeps", "description/deleted-is-gone"),
]


def _blamed(shape, fault, tmp_path):
    end, key = _SHAPES[shape].get("end", ""), _SHAPES[shape].get("key", "id")
    item = f"/valves/{{{key}}}{end}"
    calls = [f"--call=POST /valves{end}", f"--call=PUT {item}", f"--call=DELETE {item}"]
    with small_device(*_things(_SHAPES[shape], fault)) as url:
        done = certified(url, tmp_path / "out", *calls)
    return {id_ for id_ in done.blamed if id_.startswith("description/")}, done


_LIVES = ("description/created-is-there", "description/written-is-read", "description/deleted-is-gone")


@pytest.mark.parametrize("shape", _SHAPES)
def test_a_right_device_is_not_blamed(shape, tmp_path):
    blamed, done = _blamed(shape, "", tmp_path)
    assert not blamed & set(_LIVES), done.text
    assert [done.requirement(id_)["verdict"] for id_ in _LIVES] == ["pass"] * 3


@pytest.mark.parametrize(("shape", "fault", "requirement"), _FAULTS)
def test_a_fault_is_found(shape, fault, requirement, tmp_path):
    blamed, done = _blamed(shape, fault, tmp_path)
    assert requirement in blamed, done.text


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
