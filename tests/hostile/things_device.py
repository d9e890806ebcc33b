"""A device that keeps things, in many styles, with one fault or none; and one life of its things."""

import asyncio
import json
import time

from aiohttp import web
from driven_device import driven
from small_device import REFUSED, answers, body_of, described

from conformance.api.rest.references import collections_of
from conformance.api.rest.values import Values
from conformance.checkers.rest import RestCheckers
from conformance.documents.openapi import operations_of
from conformance.rules.description import test_lives as rules
from conformance.scenarios.lifecycles import lifecycles
from conformance.scenarios.other_exchanges import OtherExchanges

WRITTEN = {
    "label": {"type": "string", "minLength": 1, "maxLength": 20},
    "level": {"type": "integer", "minimum": 0, "maximum": 90},
    "mode": {"type": "string", "enum": ["slow", "fast"]},
}
_NUMBER, _TEXT = {"type": "integer"}, {"type": "string"}
_PAGING = {"offset": _NUMBER, "page": _NUMBER, "cursor": _TEXT, "state": _TEXT}
RULES = (rules.created_is_there, rules.written_is_read, rules.deleted_is_gone, rules.refused_keeps)


def _wrong(value, name):
    """Return whether a member of a body is not valid."""
    given = WRITTEN.get(name)
    if given is None:
        return name not in {"primary", "remaining"}
    if "enum" in given:
        return value not in given["enum"]
    if given["type"] == "string":
        return not isinstance(value, str) or not 1 <= len(value) <= 20
    return type(value) is not int or not 0 <= value <= 90


class Things:
    """The things of a device.

    Args:
        style: what a right device may do in its own way.
        fault: what is wrong with it.
    """

    def __init__(self, style=(), fault=""):
        self.style, self.fault = set(style), fault
        first = {"id": 1, "label": "first", "level": 3, "mode": "slow", "state": "idle"}
        self.there = {} if self.style & {"ring", "named"} else {1: first}
        if self.style & {"newest", "oldest"}:
            self.there = {number: {**first, "id": number} for number in range(1, 14)}
        self.deleted, self.refused, self.lists, self.last_id = {}, 0, 0, max(self.there, default=1)
        self.now = time.monotonic

    def description(self):
        """Return the OpenAPI description and the routes."""
        named = "named" in self.style
        more = {"primary": {"type": "boolean"}} if "primary" in self.style else {}
        more |= {"remaining": {"type": "integer", "minimum": 1000}} if "timers" in self.style else {}
        schema = {"type": "object", "required": ["label", "level"], "properties": {**WRITTEN, **more}}
        thing = {
            "type": "object",
            "properties": {"id": {"readOnly": True}, "state": {"readOnly": True}, **WRITTEN, **more},
        }
        body = body_of(schema)
        part = body_of({k: v for k, v in schema.items() if k != "required"})
        bad, key = {"4XX": REFUSED}, {"type": "string"} if named else {"type": "integer"}
        every = {"type": "array", "items": thing}
        shown, listed = (
            {"200": answers(thing), **bad},
            answers({"properties": {"items": every}} if "paged" in self.style else every),
        )
        paging = [name for name in ("offset", "page", "cursor", "state") if name in self.style]
        item = {
            "parameters": [{"in": "path", "name": "id", "required": True, "schema": key}],
            "get": {"responses": shown},
            "put": {"requestBody": body, "responses": {"200": answers(thing), "201": answers(thing), **bad}},
            "patch": {"requestBody": part, "responses": shown},
            "delete": {"responses": {"204": {"description": "gone"}, **bad}},
        }
        collection = {
            "get": {
                "parameters": [{"in": "query", "name": name, "schema": _PAGING[name]} for name in paging],
                "responses": {"200": listed, **bad},
            }
        }
        if not named:
            collection["post"] = {"requestBody": body, "responses": {"201": answers(thing), **bad}}
        paths = {"/things": collection, "/things/{id}": item}
        routes = {"/things": {"GET": self.list, "POST": self.post}}
        routes["/things/{id}"] = {"GET": self.get, "PUT": self.put, "PATCH": self.patch, "DELETE": self.delete}
        if "actions" in self.style:
            path = "/things/{id}/cancel"
            paths[path] = {"parameters": item["parameters"], "post": {"responses": shown}}
            routes[path] = {"POST": self.cancel}
        return described(paths), routes

    def later(self, act, *values):
        """Do something now, or a little later."""
        if "later" in self.style:
            asyncio.get_running_loop().call_later(0.4, act, *values)
        else:
            act(*values)

    def refuse(self, status, text="no"):
        """Return a refusal."""
        self.refused += status in {400, 412, 415, 422}
        return web.json_response({"error": text}, status=status)

    def key(self, request):
        """Return the identifier in a path, or None."""
        text = request.match_info["id"]
        if "named" in self.style:
            return text
        return int(text) if text.isascii() and text.isdigit() and len(text) < 18 else None

    def answer(self, thing, status=200):
        """Return a thing as the device shows it."""
        headers = {"ETag": self.tag(thing)} if "tags" in self.style else {}
        shown = {
            **thing,
            **({"battery": int(self.now() * 1000), "updated_at": str(self.now())} if "sensors" in self.style else {}),
        }
        if "timers" in self.style and "remaining" in thing:
            shown["remaining"] = max(0, thing["remaining"] - int(5 * (self.now() - thing["_made"])))
        return web.json_response({k: v for k, v in shown.items() if k[0] != "_"}, status=status, headers=headers)

    @staticmethod
    def tag(thing):
        """Return the entity tag of a thing."""
        return f'"{abs(hash(json.dumps(thing, sort_keys=True)))}"'

    async def given(self, request, thing, names=()):
        """Return the members of a body, or a refusal; a fault may apply some before."""
        try:
            value = json.loads(await request.text())
        except ValueError:
            return self.refuse(400)
        if not isinstance(value, dict):
            return self.refuse(400)
        if request.content_type != "application/json":
            if self.fault == "415 applies":
                thing.update(value)
            return self.refuse(415)
        bad = [name for name in value if _wrong(value[name], name)] + [name for name in names if name not in value]
        if bad:
            if self.fault == "invalid applies the valid" and request.method == "PATCH":
                thing.update({k: v for k, v in value.items() if k not in bad})
            if self.fault == "invalid creates" and request.method == "POST":
                self.store({k: v for k, v in value.items() if k not in bad})
            if self.fault == "invalid clears" and request.method == "PUT":
                thing["label"] = ""
            return self.refuse(422)
        if "normal" in self.style and "label" in value:
            value["label"] = value["label"].strip().upper()
        return value

    def condition(self, request, thing):
        """Return a refusal if a condition does not hold, or is missing."""
        tag = request.headers.get("If-Match")
        if "tags" not in self.style or tag in {"*", self.tag(thing)}:
            return None
        return self.refuse(412) if tag is not None else self.refuse(428) if "locking" in self.style else None

    def store(self, value):
        """Create a thing; return it."""
        self.last_id += 0 if self.fault == "an identifier twice" and self.last_id > 2 else 1
        thing = {"id": self.last_id, "state": "idle", "mode": "slow", **value, "_made": self.now()}
        if self.fault == "creation overwrites" and self.there:
            self.there[max(self.there)]["label"] = value["label"]
        if self.fault == "creation restores" and self.last_id - 2 in self.there:
            self.there[self.last_id - 2] = {**self.there[self.last_id - 2], "label": "roaas"}
        if value.get("primary"):
            for one in self.there.values():
                one["primary"] = False
        self.later(self.there.__setitem__, self.last_id, thing)
        if "ring" in self.style and len(self.there) > 3:
            del self.there[min(self.there)]
        return thing

    async def post(self, request):
        """Create a thing."""
        value = await self.given(request, {}, ("label", "level"))
        if isinstance(value, web.Response):
            return value
        if self.fault == "lost after a refusal" and self.refused:
            self.refused = 0
            self.last_id += 1
            return self.answer({"id": self.last_id, "state": "idle", **value}, 201)
        return self.answer(self.store(value), 201)

    async def get(self, request):
        """Read a thing."""
        key = self.key(request)
        if "jobs" in self.style and key in self.there and self.now() - self.there[key].get("_made", self.now()) > 0.5:
            del self.there[key]
        if key not in self.there:
            return self.refuse(404)
        thing = self.there[key]
        if self.fault == "GET mixes up after a DELETE" and self.deleted:
            thing = self.there[max(self.there)]
        if self.fault == "GET after a refusal is the last read" and self.refused:
            thing, self.refused = getattr(self, "shown", thing), 0
        self.shown = thing
        return self.answer(thing)

    async def put(self, request):
        """Replace a thing, or create one of this name."""
        key = self.key(request)
        old = self.there.get(key)
        if old is None and "named" not in self.style:
            return self.refuse(404)
        value = await self.given(request, old if old is not None else {}, ("label", "level"))
        if isinstance(value, web.Response):
            return value
        kept = old if "merging" in self.style and old else {}
        new = {"mode": "slow", **{k: v for k, v in kept.items() if k[0] != "_"}, **value, "id": key, "state": "idle"}
        new["_made"] = self.now()
        if old is not None and (refusal := self.condition(request, old)):
            return refusal
        if self.fault == "PUT writes all":
            for one in self.there.values():
                one["level"] = value["level"]
        if value.get("primary"):
            for one in self.there.values():
                one["primary"] = False
        self.later(self.there.__setitem__, key, new)
        known = old is not None or (self.fault == "created again with 200" and key in self.deleted)
        return self.answer(new, 200 if known else 201)

    async def patch(self, request):
        """Change a thing."""
        key = self.key(request)
        if key not in self.there:
            return self.refuse(404)
        thing = self.there[key]
        value = await self.given(request, thing)
        if isinstance(value, web.Response):
            return value
        if refusal := self.condition(request, thing):
            return refusal
        if self.fault == "PATCH the last one too":
            self.there[max(self.there)].update(label=value.get("label", "x"))
        self.later(thing.update, value)
        return self.answer({**thing, **value})

    async def delete(self, request):
        """Delete a thing."""
        key = self.key(request)
        if key not in self.there:
            if self.fault == "second DELETE fails":
                return web.json_response({"error": "KeyError"}, status=500)
            if self.fault == "unknown DELETE deletes the last":
                self.there.pop(max(self.there), None)
            return self.refuse(404)
        if refusal := self.condition(request, self.there[key]):
            return refusal
        if self.fault == "DELETE takes the neighbour":
            self.there.pop(key + 1, None)
        if self.fault == "DELETE revives":
            self.there.update(self.deleted)
        self.deleted[key] = self.there[key]
        self.later(self.there.pop, key, None)
        return web.Response(status=204)

    async def cancel(self, request):
        """Cancel a thing."""
        key = self.key(request)
        if key not in self.there:
            return self.refuse(404)
        thing = self.there[key]
        said = {**thing, "state": "cancelled"}
        if self.fault == "cancel resets the others":
            for one in self.there.values():
                one["level"] = 1
        if self.fault != "cancel without effect":
            self.later(thing.update, {"state": "cancelled"})
        if "passing" in self.style:
            asyncio.get_running_loop().call_later(0.05, thing.update, {"state": "archived"})
        return self.answer(said)

    async def list(self, request):  # noqa: C901 - one list in many styles
        """List the things."""
        self.lists += 1
        if "crowd" in self.style:
            self.store({"label": f"other {self.lists}", "level": 1})
        found = [{k: v for k, v in one.items() if k[0] != "_"} for one in self.there.values()]
        if self.fault == "list without the third" and len(found) > 2:
            del found[2]
        if self.fault == "list keeps the deleted":
            found += [one for key, one in self.deleted.items() if key not in self.there]
        if self.fault == "list stale after a refusal":
            self.kept = found = getattr(self, "kept", found) if self.refused else found
        if "state" in self.style:
            found = [one for one in found if one["state"] == "running"]
        # A limit of which nobody is told.
        found = found[-12:] if "newest" in self.style else found[:12] if "oldest" in self.style else found
        if "paged" not in self.style:
            return web.json_response(found)
        begin = int(request.query.get("offset") or request.query.get("cursor") or 0)
        begin = 2 * (int(request.query.get("page") or 1) - 1) if "page" in self.style else begin
        more = begin + 2 < len(found)
        body = {"items": found[begin : begin + 2]}
        headers = {}
        if "total" in self.style:
            body["total"] = len(found)
        if "cursor" in self.style and more:
            body["next_cursor"] = str(begin + 2)
        if "link" in self.style and more:
            headers["Link"] = f'</things?cursor={begin + 2}>; rel="next"'
        if self.style & {"offset", "page"}:
            body["limit"] = 2
        return web.json_response(body, headers=headers)


def blamed(description, routes, folder):
    """Return the requirements by which the lives of a device's things fail, with what was found."""
    with driven(description, routes, folder) as (api, contract, kept):
        operations = operations_of(contract)
        api.working.update(dict.fromkeys(one.label for one in operations))
        api.client.connection.listeners.insert(0, OtherExchanges(api))
        trace = lifecycles.play(api, Values({}, collections_of(operations)))
    cases = [(one.requirement, case) for one in RULES for case in one.judge(trace)]
    checkers = RestCheckers(contract, api.client.base_url)
    cases += [(case.requirement, case) for exchange in kept.exchanges for case in checkers(exchange)]
    wrong = {id_: f"{case.expected}: {case.observed}" for id_, case in cases if not case.holds}
    return {id_: text for id_, text in wrong.items() if id_.startswith(("description/", "robustness/"))}
