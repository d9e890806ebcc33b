"""A device with items and settings that are written by PUT, merge patch and JSON patch, with one fault or none."""

import itertools
import json

from aiohttp import web
from driven_device import driven
from small_device import REFUSED, answers, described, error

from conformance.api.rest.patches import PatchError, merged, partly_patched, patched
from conformance.api.rest.references import collections_of
from conformance.api.rest.samples import fits
from conformance.api.rest.values import Values
from conformance.checkers.rest import RestCheckers
from conformance.documents.openapi import operations_of
from conformance.scenarios.own_things import own_things
from conformance.scenarios.survey import survey

_PARTS = {
    "code": {"type": "string", "pattern": "^[A-Z]{2}[0-9]{3}$", "examples": ["AB100"]},
    "kind": {"type": "string", "enum": ["belt", "roller", "chute"]},
    "speed": {"type": "number", "minimum": -40, "maximum": 90},
    "note": {"type": ["string", "null"], "maxLength": 80},
    "steps": {"type": "array", "items": {"type": "number", "maximum": 99}, "maxItems": 6},
    "loud": {"type": "boolean", "default": False},
    "lane": {"type": "integer", "minimum": 1, "maximum": 8, "default": 2},
    "box": {"type": "object", "properties": {"x": {"type": "integer"}, "y": {"type": "integer"}}},
}
_OWN = {
    "id": {"type": "integer", "readOnly": True},
    "built_at": {"type": "string", "format": "date-time", "readOnly": True},
    "maker": {"type": "string", "readOnly": True},
}
_EXAMPLE = {"code": "AB100", "kind": "belt", "speed": 3.5, "note": "a", "steps": [3, 1], "loud": True, "lane": 5}
_EXAMPLE |= {"box": {"x": 1, "y": 2}}
_SETTINGS = {name: one for name, one in _PARTS.items() if name != "code"}
_MERGE, _STEPS = "application/merge-patch+json", "application/json-patch+json"


def _object(parts, needed=(), **more):
    return {"type": "object", "properties": parts, "required": list(needed), "additionalProperties": False, **more}


def _body(kind, schema):
    return {"required": True, "content": {kind: {"schema": schema}}}


class Written:
    """The device.

    Args:
        style: what a right device may do in its own way.
        fault: what is wrong with it, in words, of which a part may be the member or the method.
    """

    def __init__(self, style=(), fault=""):
        self.style, self.fault, self.numbers = set(style), fault, itertools.count(3)
        self.items = {n: {"id": n, **_EXAMPLE, "code": f"AB10{n}", **self._made()} for n in (1, 2)}
        self.deleted = {}
        self.settings = {name: one for name, one in _EXAMPLE.items() if name != "code"}

    @staticmethod
    def _made():
        return {"built_at": "2026-01-01T00:00:00Z", "maker": "acme"}

    def description(self):
        """Return the OpenAPI description and the routes."""
        own = _OWN if "marked" in self.style else {}
        write = _object({**_PARTS, **own}, ("code", "kind", "speed"), example=_EXAMPLE)
        patch = _object({**{k: {**one, "type": list({*_types(one), "null"})} for k, one in _PARTS.items()}, **own})
        patch["properties"]["kind"] = {"enum": [*_PARTS["kind"]["enum"], None]}
        shown = {"200": answers(_object({**_PARTS, **_OWN}, ("id", "code", "kind", "speed"))), "4XX": REFUSED}
        told = {"200": answers(_object(_SETTINGS)), "4XX": REFUSED}
        many = {"200": answers({"type": "array", "items": _object({**_PARTS, **_OWN})}), "4XX": REFUSED}
        id_ = {"in": "path", "name": "id", "required": True, "schema": {"type": "integer", "minimum": 1}}
        query = [{"in": "query", "name": name, "schema": _PARTS[name]} for name in ("kind", "loud")]
        steps = {"type": "array", "items": {"type": "object", "required": ["op", "path"]}}
        merge, listed = _body(_MERGE, _object(_SETTINGS)), _body(_STEPS, steps)
        paths = {
            "/items": {
                "get": {"parameters": query, "responses": many},
                "post": {"requestBody": _body("application/json", write), "responses": {**shown, "201": shown["200"]}},
            },
            "/items/{id}": {
                "parameters": [id_],
                "get": {"responses": shown},
                "put": {"requestBody": _body("application/json", write), "responses": shown},
                "patch": {"requestBody": _body(_MERGE, patch), "responses": shown},
                "delete": {"responses": {"204": {"description": "gone"}, "4XX": REFUSED}},
            },
            "/settings": {
                "get": {"responses": told},
                "put": {"requestBody": _body("application/json", _object(_SETTINGS, ("speed",))), "responses": told},
                "patch": {"requestBody": {"content": {**merge["content"], **listed["content"]}}, "responses": told},
            },
        }
        self.write, self.change, self.whole = write, patch, _object(_SETTINGS, ("speed",))
        self.part = _object(_SETTINGS)
        item = {"GET": self.get, "PUT": self.put, "PATCH": self.patch, "DELETE": self.delete}
        routes = {"/items": {"GET": self.list, "POST": self.post}, "/items/{id}": item}
        return described(paths, "3.1.0"), {
            **routes, "/settings": {"GET": self.told, "PUT": self.set, "PATCH": self.step},
        }  # fmt: skip

    def lost(self, value, before):
        """Return what the device keeps of values, by its fault."""
        kept = dict(value)
        for name, one in value.items():
            if self.fault == f"{name} cut off" and isinstance(one, float):
                kept[name] = int(one)
            if self.fault == f"{name} sorted" and isinstance(one, list):
                kept[name] = sorted(one)
            if self.fault == f"{name} added" and isinstance(one, list) and isinstance(before.get(name), list):
                kept[name] = [*before[name], *one]
            if self.fault == f"{name} escaped" and isinstance(one, str):
                kept[name] = one.replace("&", "&amp;")
        return kept

    def owned(self, thing, value, method):
        """Return a thing with what the device takes of what is its own."""
        is_taken = self.fault == f"built_at by {method}" and "built_at" in value
        return thing | ({"built_at": value["built_at"]} if is_taken else {})

    def filled(self, value, before, where):
        """Return what PUT or POST makes of a body."""
        defaults = {name: one["default"] for name, one in _PARTS.items() if "default" in one}
        for name in list(defaults):
            if self.fault == f"default of {name} by {where}":
                defaults[name] = before.get(name, not defaults[name])
        return {**defaults, **value}

    async def body(self, request):
        """Return the JSON of a request; None where it is none."""
        try:
            return json.loads(await request.read())
        except ValueError:
            return None

    def refused(self, value, schema, thing):
        """Return a refusal, or None where the schema allows the value; the fault applies a part of it."""
        if isinstance(value, dict) and fits(schema, value):
            return None
        parts = _PARTS.items() if isinstance(value, dict) and thing is not None else ()
        right = {name: value[name] for name, one in parts if name in value and fits(one, value[name])}
        if self.fault == "refused in part":
            thing.update(right)
        return error(422, "not valid")

    def taken(self, code, but=None):
        """Return whether another item has a code."""
        return any(one["code"] == code for key, one in self.items.items() if key != but)

    def of(self, request):
        """Return the item of a request, or None."""
        text = request.match_info["id"]
        return self.items.get(int(text)) if text.isascii() and text.isdecimal() and len(text) < 9 else None

    async def list(self, request):
        """List the items."""
        query = {name: text for name, text in request.query.items() if name in {"kind", "loud"}}
        if not all(
            text in {"true", "false"} if name == "loud" else fits(_PARTS[name], text) for name, text in query.items()
        ):
            return error(400, "not valid")
        kept = self.deleted.values() if self.fault in {f"lists the deleted by {name}" for name in query} else ()
        every = [*self.items.values(), *kept]
        wanted = {name: text == "true" if name == "loud" else text for name, text in query.items()}
        return web.json_response([one for one in every if all(one.get(k) == v for k, v in wanted.items())])

    async def post(self, request):
        """Create an item."""
        value = await self.body(request)
        if refusal := self.refused(value, self.write, None):
            return refusal
        if self.taken(value["code"]):
            return error(409, "the code is taken")
        number, own = next(self.numbers), {name: one for name, one in value.items() if name not in _OWN}
        thing = {"id": number, **self.filled(self.lost(own, {}), {}, "POST"), **self._made()}
        self.items[number] = self.owned(thing, value, "POST")
        return web.json_response(self.items[number], status=201, headers={"Location": f"/items/{number}"})

    async def get(self, request):
        """Read an item."""
        thing = self.of(request)
        return web.json_response(thing) if thing else error(404, "no such item")

    async def put(self, request):
        """Replace an item."""
        thing, value = self.of(request), await self.body(request)
        if thing is None:
            return error(404, "no such item")
        if refusal := self.refused(value, self.write, thing):
            return refusal
        if self.taken(value["code"], thing["id"]):
            return error(409, "the code is taken")
        own = self.lost({name: one for name, one in value.items() if name not in _OWN}, thing)
        kept = {name: thing[name] for name in _OWN}
        self.items[thing["id"]] = self.owned({**self.filled(own, thing, "PUT"), **kept}, value, "PUT")
        return web.json_response(self.items[thing["id"]])

    async def patch(self, request):
        """Change an item by a merge patch."""
        thing, value = self.of(request), await self.body(request)
        if thing is None:
            return error(404, "no such item")
        if refusal := self.refused(value, self.change, thing):
            return refusal
        own = self.lost({name: one for name, one in value.items() if name not in _OWN}, thing)
        if self.fault == "null keeps":
            own = {name: one for name, one in own.items() if one is not None}
        new = {**merged(thing, own)}
        if self.fault == "objects replaced":
            new |= {name: one for name, one in own.items() if isinstance(one, dict)}
        missing = [name for name in ("code", "kind", "speed") if name not in new]
        if missing or (self.taken(new["code"], thing["id"]) and self.fault != "code twice by PATCH"):
            return error(409, "not possible")
        self.items[thing["id"]] = self.owned(new, value, "PATCH")
        return web.json_response(self.items[thing["id"]])

    async def delete(self, request):
        """Delete an item."""
        if (thing := self.of(request)) is None:
            return error(404, "no such item")
        self.deleted[thing["id"]] = self.items.pop(thing["id"])
        return web.Response(status=204)

    async def told(self, _):
        """Read the settings."""
        return web.json_response(self.settings)

    async def set(self, request):
        """Replace the settings."""
        value = await self.body(request)
        if refusal := self.refused(value, self.whole, self.settings):
            return refusal
        self.settings = self.filled(self.lost(value, self.settings), self.settings, "PUT")
        return web.json_response(self.settings)

    async def step(self, request):
        """Change the settings by a merge patch, or by a JSON patch."""
        operations, made = await self.body(request), list[dict]()
        if request.content_type == _MERGE:
            if refusal := self.refused(operations, self.part, self.settings):
                return refusal
            self.settings = merged(self.settings, self.lost(operations, self.settings))
            return web.json_response(self.settings)
        if not isinstance(operations, list) or not all(isinstance(one, dict) for one in operations):
            return error(422, "not valid")
        tests = [one for one in operations if one.get("op") == "test"]
        if self.fault == "last test ignored" and operations[-1:] == tests[-1:]:
            operations = [one for one in operations if one not in tests]
        try:
            made = [patched(self.settings, operations)]
        except PatchError:
            if self.fault == "applied in part":
                made = list(partly_patched(self.settings, operations))[-1:]
            self.settings = made[0] if made and fits(self.whole, made[0]) else self.settings
            return error(409, "an operation fails")
        if not made or not fits(self.whole, made[0]):
            return error(422, "not valid")
        self.settings = self.settings if self.fault == "patch without effect" else made[0]
        return web.json_response(made[0])


def _types(schema):
    return schema["type"] if isinstance(schema["type"], list) else [schema["type"]]


def blamed(device, folder):
    """Return what is wrong in a device by the survey and the things that the run has created: texts by requirement."""
    with driven(*device.description(), folder) as (api, contract, kept):
        values = Values({}, collections_of(operations_of(contract)))
        survey.play(api, values)
        own_things.play(api, values)
    checkers = RestCheckers(contract, api.client.base_url)
    cases = [one for exchange in kept.exchanges for one in checkers(exchange) if not one.holds]
    return {one.requirement: f"{one.expected}: {one.observed}" for one in cases if one.requirement[:5] != "http/"}
