"""A device with settings, in many styles, with one fault or none; and one life of them."""

import asyncio
import json

from aiohttp import web
from driven_device import driven
from small_device import REFUSED, answers, described

from conformance.api.rest.references import collections_of
from conformance.api.rest.values import Values
from conformance.documents.openapi import operations_of
from conformance.rules.description.test_lives import written_is_read
from conformance.scenarios.lifecycles import lifecycles
from conformance.scenarios.scenario import NotPossibleError

_MEMBERS = {
    "volume": {"type": "integer", "minimum": 0, "maximum": 10},
    "lights": {"type": "boolean"},
    "profile": {"type": "string", "enum": ["gentle", "normal", "sport"]},
    "zones": {"type": "array", "items": {"type": "string"}, "maxItems": 4},
    "ssid": {"type": "string"},
}
FIRST = {"volume": 3, "lights": True, "profile": "normal", "zones": ["hall"], "ssid": "home"}


class Settings:
    """The settings of a device.

    Args:
        style: what a right device may do in its own way.
        fault: what is wrong with it.
    """

    def __init__(self, style=(), fault=""):
        self.style, self.fault = set(style), fault
        self.now, self.old, self.writer, self.written = dict(FIRST), dict(FIRST), None, list[dict]()
        self.path = "/gripper" if "acting" in self.style else "/settings"

    def description(self):
        """Return the OpenAPI description and the routes."""
        schema = {"type": "object", "properties": _MEMBERS}
        whole = {**schema, "required": list(_MEMBERS)}
        method = "patch" if "patch" in self.style else "put"
        body = {"required": True, "content": {"application/json": {"schema": schema if method == "patch" else whole}}}
        bad = {"4XX": REFUSED}
        shown = {"200": answers(schema), **bad}
        paths = {self.path: {"get": {"responses": shown}, method: {"requestBody": body, "responses": shown}}}
        return described(paths), {self.path: {"GET": self.get, method.upper(): self.write}}

    async def get(self, request):
        """Read the settings."""
        is_other = request.transport is not self.writer
        shown = self.old if self.fault == "another connection reads the old" and is_other else self.now
        shown = {**shown, **({"uptime": asyncio.get_running_loop().time()} if "sensors" in self.style else {})}
        tag = {"ETag": self.tag()} if "locking" in self.style else {}
        return web.json_response({"settings": shown} if "wrapped" in self.style else shown, headers=tag)

    def tag(self):
        """Return the entity tag."""
        return f'"{abs(hash(json.dumps(self.now)))}"'

    async def write(self, request):
        """Write the settings."""
        if "locking" in self.style and request.headers.get("If-Match") != self.tag():
            return web.json_response({"error": "If-Match"}, status=412 if "If-Match" in request.headers else 428)
        value = {k: v for k, v in (await request.json()).items() if k in _MEMBERS}
        if "strict" in self.style and value.get("volume") == 10 and value.get("lights", self.now["lights"]):
            return web.json_response({"error": "too loud for this light"}, status=409)
        self.written.append(value)
        self.old, self.writer = dict(self.now), request.transport
        value = {k: v for k, v in value.items() if not self.loses(k, v)}
        if "acting" in self.style:
            asyncio.get_running_loop().call_later(5, self.now.update, value)
        elif "later" in self.style:
            asyncio.get_running_loop().call_later(0.3, self.now.update, value)
        else:
            self.now.update(value)
        return web.json_response(self.now)

    def loses(self, name, value):
        """Return whether the fault loses a value."""
        return {
            "zero": name == "volume" and value == 0,
            "false": value is False,
            "empty list": value == [],
            "maximum": name == "volume" and value == 10,
            "one of an enumeration": value == "sport",
            "every write": True,
        }.get(self.fault, False)


def lived(device, folder):
    """Return what of a device's settings reads otherwise than it was written."""
    with driven(*device.description(), folder) as (api, contract, _):
        try:
            trace = lifecycles.play(api, Values({}, collections_of(operations_of(contract))))
        except NotPossibleError:
            trace = ()  # nothing keeps what is written
    return [case.observed for case in written_is_read.judge(trace) if not case.holds]
