"""A simulated arm with two axes and a web API on Starlette: moves take the time that is asked for."""

import json
from typing import Any

from body import Body
from descriptions import answered, content, described, problem
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

LIMITS = {"pan": (-0.8, 0.8), "tilt": (-0.4, 0.6)}
MAP = """
[motion.state]
read = "GET /state"
stamp = "/stamp"
fresh_s = 0.3
agrees = { "GET /joints" = { pan = "/0", tilt = "/1" } }

[motion.state.axes]
pan = { at = "/joints/pan", unit = "rad", limits = [-0.8, 0.8], speed = 4 }
tilt = { at = "/joints/tilt", unit = "rad", limits = [-0.4, 0.6], speed = 4 }

[motion.goto]
send = "POST /move"
body = { pan = "{pan}", tilt = "{tilt}", seconds = "{seconds}" }
seconds = 0.5
settle_s = 0.3
tolerance = 0.02
beyond_limits = "refused"
while_moving = "displaces"

[motion.action]
read = "GET /moves/{goto:/id}"
at = "/state"
running = ["running"]
succeeded = ["done"]
canceled = ["stopped"]

[motion.stop]
send = "POST /stop"
body = { id = "{goto:/id}" }
rests_within_s = 0.2
"""
_NUMBER = {"type": "number"}
_STATE = {
    "type": "object",
    "properties": {
        "joints": {"type": "object", "properties": dict.fromkeys(LIMITS, _NUMBER), "required": list(LIMITS)},
        "stamp": _NUMBER,
    },
    "required": ["joints", "stamp"],
}
_ID = {"type": "object", "properties": {"id": {"type": "integer"}}, "required": ["id"]}
_SAID = {"type": "object", "properties": {"state": {"enum": ["running", "done", "stopped"]}}, "required": ["state"]}
_MOVE = {
    "type": "object",
    "properties": {
        **{name: {"type": "number", "minimum": least, "maximum": most} for name, (least, most) in LIMITS.items()},
        "seconds": {"type": "number", "exclusiveMinimum": 0, "maximum": 10},
    },
    "required": [*LIMITS, "seconds"],
}
_REFUSED = {"400": problem(), "422": problem()}
_WHICH = {"name": "id", "in": "path", "required": True, "schema": {"type": "integer", "minimum": 1}}
DESCRIPTION = described(
    "Arm",
    {
        "/state": {"get": {"responses": {"200": answered(_STATE)}}},
        "/joints": {"get": {"responses": {"200": answered({"type": "array", "items": _NUMBER})}}},
        "/moves/{id}": {
            "get": {"parameters": [_WHICH], "responses": {"200": answered(_SAID), "404": problem(), "422": problem()}}
        },
        "/move": {"post": {"requestBody": content(_MOVE), "responses": {"200": answered(_ID), **_REFUSED}}},
        "/stop": {"post": {"requestBody": content(_ID), "responses": {"200": answered(_ID), **_REFUSED}}},
    },
)


class Arm:
    """The arm's API before its body.

    Args:
        body: the mechanics; None: right ones.
        fault: what is wrong with the API: "mixes" clients' targets, or "incomplete-moves"; empty: nothing.
        relative: whether a move is the way from where it is; without limits then.
    """

    def __init__(self, body: Body | None = None, fault: str = "", *, relative: bool = False) -> None:
        self.body, self.fault, self.relative = body or Body(LIMITS), fault, relative

    def app(self) -> Starlette:
        """Return the web application."""
        post = ["POST"]
        return Starlette(
            routes=[
                Route("/openapi.json", self._description),
                *(Route(path, self._over_http) for path in ("/state", "/joints", "/moves/{id}")),
                *(Route(path, self._over_http, methods=post) for path in ("/move", "/stop")),
            ]
        )

    async def _description(self, _: Request) -> Response:
        return JSONResponse(DESCRIPTION)

    async def _over_http(self, request: Request) -> Response:
        try:
            octets = await request.body()
        except ClientDisconnect:
            if self.fault == "incomplete-moves":
                self.body.aim({"pan": 0.5, "tilt": 0.2}, 0.3, self.body.now())
            raise
        status, document = self.answer(request.method, request.url.path, octets)
        return JSONResponse(document, status)

    def answer(self, method: str, path: str, octets: bytes) -> tuple[int, Any]:
        """Return status and JSON of the response to a request."""
        if method in {"GET", "HEAD"}:
            return self._read(path)
        try:
            wanted = json.loads(octets)
        except ValueError:
            return 400, {"detail": "no JSON"}
        return self._move(wanted) if path == "/move" else self._stop(wanted)

    def _read(self, path: str) -> tuple[int, Any]:
        told = self.body.told()
        if path == "/state":
            return 200, {"joints": told, "stamp": self.body.stamp(self.body.now())}
        if path == "/joints":
            return 200, list(told.values())
        number = path.rpartition("/")[2]
        if not number.isdigit():
            return 422, {"detail": "no id"}
        if not 0 < int(number) <= self.body.moves:
            return 404, {"detail": "no such move"}
        return 200, {"state": self.body.action() if int(number) == self.body.moves else "stopped"}

    def _move(self, wanted: Any) -> tuple[int, dict[str, Any]]:
        wrong = _problem(wanted)
        if wrong and not self.relative:
            return 422, {"detail": wrong}
        target = {name: float(wanted[name]) for name in LIMITS}
        if self.relative:
            here = self.body.at(self.body.now())
            target = {name: here[name] + way for name, way in target.items()}
        if self.fault == "mixes" and self.body.moving(self.body.now()):
            target["tilt"] = self.body.target["tilt"]
        self.body.go(target, float(wanted["seconds"]))
        return 200, {"id": self.body.moves}

    def _stop(self, wanted: Any) -> tuple[int, dict[str, Any]]:
        number = wanted.get("id") if isinstance(wanted, dict) else None
        if isinstance(number, bool) or not isinstance(number, int):
            return 422, {"detail": "no id"}
        now = self.body.now()
        if self.body.moving(now):
            self.body.halt(now)
        return 200, {"id": number}


def _problem(wanted: Any) -> str:
    if not isinstance(wanted, dict):
        return "no object"
    for name, (least, most) in {**LIMITS, "seconds": (1e-9, 10.0)}.items():
        value = wanted.get(name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            return f"{name} is no number"
        if not least <= value <= most:
            return f"{name} is beyond its limits"
    return ""
