"""A device of plants and lamps: what a refused request stores, and what a write changes beside its own thing."""

import itertools
import json
from datetime import datetime

import pytest
from aiohttp import web
from jsonschema import Draft202012Validator
from small_device import REFUSED, answers, body_of, certified, described, error, object_of, reading, small_device

_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "string"}}
_SENT = {
    "label": {"type": "string", "minLength": 1, "maxLength": 16},
    "note": {"type": "string", "maxLength": 60},
    "planted_at": {"type": "string", "format": "date-time"},
    "tags": {
        "type": "array",
        "items": {"type": "string", "minLength": 1, "maxLength": 12},
        "maxItems": 4,
        "description": "Kept as written.",
    },
}
_PLANT = object_of("id", *_SENT, id={"type": "string", "readOnly": True}, **_SENT)
_NEW = {**object_of("label", **_SENT), "additionalProperties": False}
_PATCH = {**object_of(**_SENT), "additionalProperties": False, "minProperties": 1}
_LEVEL = {"level": {"type": "number", "minimum": 0, "maximum": 100}}
_LAMP = object_of("id", "level", id={"type": "string", "readOnly": True}, **_LEVEL)
_PUT = {**object_of("level", **_LEVEL), "additionalProperties": False}
_TAKEN = {"409": {**REFUSED, "description": "another plant has the label"}, "4XX": REFUSED}
_FIRST = {"note": "", "planted_at": "2026-03-01T06:00:00Z", "tags": []}


def _done(status, schema=None):
    return {"responses": {status: answers(schema) if schema else {"description": "done"}, **_TAKEN}}


_DEVICE = described(
    {
        "/plants": {
            **reading({"type": "array", "items": _PLANT}),
            "post": {"requestBody": body_of(_NEW), **_done("201", _PLANT)},
        },
        "/plants/{id}": {
            "parameters": [_ID],
            **reading(_PLANT),
            "patch": {"requestBody": body_of(_PATCH), **_done("200", _PLANT)},
            "delete": {"summary": "Delete the plant", **_done("204")},
        },
        "/lamps": reading({"type": "array", "items": _LAMP}),
        "/lamps/{id}": {
            "parameters": [_ID],
            **reading(_LAMP),
            "put": {"requestBody": body_of(_PUT), **_done("200", _LAMP)},
        },
    },
    "3.1.0",
)
#: Faults, with the requirement and a word of what each is told by.
FAULTS = {
    "409 stores the rest": ("description/refused-keeps", "PATCH /plants/{id} with status 409"),
    "409 creates": ("description/refused-keeps", "POST /plants with status 409"),
    "the longest text is cut": ("description/written-is-read", "a+Z"),
    "the offset is lost": ("description/written-is-read", "as planted_at"),
    "tags in lower case": ("description/written-is-read", "as tags"),
    "the next lamp too": ("description/written-is-read", "as level"),
}


async def _sent(request, schema):
    """Return the JSON object of a request; None if it is not as described."""
    try:
        value = json.loads(await request.text()) if request.content_type == "application/json" else None
        json.dumps(value, ensure_ascii=False).encode()
        moment = datetime.fromisoformat(value.get("planted_at", "2026-03-01T06:00:00Z"))
    except (AttributeError, TypeError, ValueError, RecursionError):
        return None
    return value if moment.tzinfo is not None and Draft202012Validator(schema).is_valid(value) else None


class _House:
    """The plants and lamps; `faults`: what is wrong."""

    def __init__(self, faults):
        self.faults, self.plants, self.numbers = faults, {}, itertools.count(1)
        self.lamps = {f"l{number}": {"id": f"l{number}", "level": number} for number in (1, 2, 3)}
        for name in ("Tomato", "Basil"):
            self.make({"label": name})

    def make(self, value):
        id_ = f"p{next(self.numbers)}"
        self.plants[id_] = {**_FIRST, **value, "id": id_}
        return self.plants[id_]

    def kept(self, value):
        value = dict(value)
        if "the longest text is cut" in self.faults and "label" in value:
            value["label"] = value["label"][:15]
        if "the offset is lost" in self.faults and "planted_at" in value:
            value["planted_at"] = datetime.fromisoformat(value["planted_at"]).replace(tzinfo=None).isoformat() + "Z"
        if "tags in lower case" in self.faults and "tags" in value:
            value["tags"] = [tag.lower() for tag in value["tags"]]
        return value

    def is_taken(self, value, id_=""):
        return any(one["label"] == value.get("label") and one["id"] != id_ for one in self.plants.values())

    async def create(self, request):
        value = await _sent(request, _NEW)
        if value is None:
            return error(422, "not as described")
        value = self.kept(value)
        if self.is_taken(value):
            if "409 creates" in self.faults:
                self.make({**value, "label": f"other {next(self.numbers)}"})
            return error(409, "the label is taken")
        made = self.make(value)
        return web.json_response(made, status=201, headers={"Location": f"/plants/{made['id']}"})

    async def change(self, request):
        value, plant = await _sent(request, _PATCH), self.plants.get(request.match_info["id"])
        if plant is None or value is None:
            return error(404 if plant is None else 422, "refused")
        value = self.kept(value)
        if self.is_taken(value, plant["id"]):
            if "409 stores the rest" in self.faults:
                plant |= {name: one for name, one in value.items() if name != "label"}
            return error(409, "the label is taken")
        plant |= value
        return web.json_response(plant)

    async def delete(self, request):
        return web.Response(status=204) if self.plants.pop(request.match_info["id"], None) else error(404, "none")

    async def set_lamp(self, request):
        value, id_ = await _sent(request, _PUT), request.match_info["id"]
        if id_ not in self.lamps or value is None:
            return error(422 if id_ in self.lamps else 404, "refused")
        self.lamps[id_] |= value
        if "the next lamp too" in self.faults:
            self.lamps[f"l{int(id_[1:]) % len(self.lamps) + 1}"] |= value
        return web.json_response(self.lamps[id_])

    async def read(self, request):
        things = self.plants if request.path.startswith("/plants") else self.lamps
        if "id" not in request.match_info:
            return web.json_response(list(things.values()))
        found = things.get(request.match_info["id"])
        return web.json_response(found) if found else error(404, "none")


def _served(faults):
    house = _House(faults)
    routes = {
        "/plants": {"GET": house.read, "POST": house.create},
        "/plants/{id}": {"GET": house.read, "PATCH": house.change, "DELETE": house.delete},
        "/lamps": {"GET": house.read},
        "/lamps/{id}": {"GET": house.read, "PUT": house.set_lamp},
    }
    return small_device(_DEVICE, routes)


@pytest.mark.parametrize("seed", [0, 2])
def test_a_right_device_is_not_blamed(seed, tmp_path):
    with _served(set()) as url:
        assert certified(url, tmp_path, "--call", "*", seed=seed).blamed == {}


def test_each_fault_is_found(tmp_path):
    with _served(FAULTS) as url:
        done = certified(url, tmp_path, "--call", "*")
    said = {
        name: [one["message"] for one in done.requirement(id_)["failures"] if words in one["message"]]
        for name, (id_, words) in FAULTS.items()
    }
    assert {name for name, texts in said.items() if not texts} == set(), done.text
