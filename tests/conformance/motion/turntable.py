"""A simulated observatory device: ids in its paths, forms as bodies, a GET for each axis, and errors inside a 200."""

import math
from typing import Any
from urllib.parse import parse_qs

from body import Body
from descriptions import answered, described
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

LIMITS = {"azimuth": (-0.8, 0.8), "altitude": (-0.4, 0.6)}
NUMBER = 3
MAP = """
[values]
device_number = [3]

[motion]
failed = { at = "/ErrorNumber", not = 0 }

[motion.state]
read = "GET /telescope/{device_number}/azimuth"

[motion.state.axes]
azimuth = { at = "/Value", limits = [-0.8, 0.8] }
altitude = { at = "/Value", read = "GET /telescope/3/altitude", limits = [-0.4, 0.6] }

[motion.goto]
send = "PUT /telescope/3/slew"
body = { Azimuth = "{azimuth}", Altitude = "{altitude}", ClientID = 1 }
within_s = 1
settle_s = 0.3
tolerance = 0.03
beyond_limits = "refused"
while_moving = "displaces"

[motion.stop]
send = "PUT /telescope/{device_number}/abort"
rests_within_s = 0.3
"""
_NUMBER = {"type": "number"}
_VALUE = {
    "type": "object",
    "properties": {"Value": _NUMBER, "ErrorNumber": {"type": "integer"}, "ErrorMessage": {"type": "string"}},
    "required": ["ErrorNumber"],
}
_FORM = {
    "required": True,
    "content": {
        "application/x-www-form-urlencoded": {
            "schema": {
                "type": "object",
                "properties": {"Azimuth": _NUMBER, "Altitude": _NUMBER, "ClientID": {"type": "integer"}},
                "required": ["Azimuth", "Altitude"],
            }
        }
    },
}
_WHICH = {"name": "device_number", "in": "path", "required": True, "schema": {"type": "integer", "minimum": 0}}
_ANSWERS = {"200": answered(_VALUE), "400": {"description": "", "content": {"text/plain": {"schema": {}}}}}
_ONE = {"parameters": [_WHICH], "responses": _ANSWERS}
DESCRIPTION = described(
    "Turntable",
    {
        "/telescope/{device_number}/azimuth": {"get": _ONE},
        "/telescope/{device_number}/altitude": {"get": _ONE},
        "/telescope/{device_number}/slew": {"put": {**_ONE, "requestBody": _FORM}},
        "/telescope/{device_number}/abort": {"put": _ONE},
    },
)
_INVALID = 1025


class Turntable:
    """The device's API before its body."""

    def __init__(self, body: Body | None = None) -> None:
        self.body = body or Body(LIMITS)
        self.media_types: set[str] = set()

    def app(self) -> Starlette:
        """Return the web application."""
        return Starlette(
            routes=[
                Route("/openapi.json", self._description),
                Route("/telescope/{number}/{what}", self._over_http, methods=["GET", "PUT"]),
            ]
        )

    async def _description(self, _: Request) -> Response:
        return JSONResponse(DESCRIPTION)

    async def _over_http(self, request: Request) -> Response:
        if request.path_params["number"] != str(NUMBER):
            return Response("no such device", 400, media_type="text/plain")
        octets, what = await request.body(), request.path_params["what"]
        if what in LIMITS and request.method == "GET":
            return self._value({"Value": self.body.told()[what]})
        if what == "abort" and request.method == "PUT":
            self.body.halt(self.body.now())
            return self._value()
        if what != "slew" or request.method != "PUT":
            return Response("no such thing", 404, media_type="text/plain")
        return self.slew(request.headers.get("content-type", ""), octets)

    def slew(self, media_type: str, octets: bytes) -> Response:
        """Return the response to a move."""
        self.media_types.add(media_type.partition(";")[0])
        try:
            form = parse_qs(octets.decode(), strict_parsing=True)
            target = {name: float(form[name.capitalize()][0]) for name in LIMITS}
        except (ValueError, KeyError):
            return Response("not the form that is declared", 400, media_type="text/plain")
        if not all(least <= target[name] <= most for name, (least, most) in LIMITS.items()):
            return self._value({"ErrorNumber": _INVALID, "ErrorMessage": "beyond its limits"})
        here = self.body.at(self.body.now())
        self.body.go(target, math.dist(list(here.values()), list(target.values())) / 2.7)
        return self._value()

    @staticmethod
    def _value(more: dict[str, Any] | None = None) -> Response:
        return JSONResponse({"ErrorNumber": 0, "ErrorMessage": "", **(more or {})})
