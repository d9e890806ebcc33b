"""A simulated winch: a lease with a heartbeat, enabled and homed before it moves, speeds without a sign."""

import json
from typing import Any

from body import Body
from descriptions import answered, content, described, problem
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

LIMITS = {"rope": (-0.6, 0.6), "trolley": (-0.6, 0.6)}
FASTEST, HOLD_S, LEASE_S = 0.5, 0.4, 2.0
MAP = f"""
[motion]
before = [
    {{ send = "POST /enable" }},
    {{ send = "POST /home", read = "GET /state", at = "/mode", shows = "ready", within_s = 5 }},
]
after = [{{ send = "POST /disable" }}]

[motion.lease]
acquire = "POST /lease"
body = {{ owner = "roaas" }}
token = "/token"
header = "X-Lease"
renew = "PUT /lease/{{lease}}"
every_s = {LEASE_S}
release = "DELETE /lease/{{lease}}"

[motion.state]
read = "GET /state"

[motion.state.axes]
rope = {{ at = "/rope", unit = "m", limits = [-0.6, 0.6], tolerance = 0.03 }}

[motion.velocity]
send = "PUT /speed"
body = {{ speed = "{{speed}}" }}
direction = {{ at = "/direction", positive = "down", negative = "up" }}
tolerance = 0.08
settle_s = 0.2
hold_s = {HOLD_S}
beyond_limits = "refused"

[motion.velocity.axes]
speed = {{ limits = [-{FASTEST}, {FASTEST}], of = "rope" }}
"""
_TOKEN = {"type": "object", "properties": {"token": {"type": "string"}}, "required": ["token"]}
_STATE = {"type": "object", "properties": {"rope": {"type": "number"}, "mode": {"type": "string"}}}
_SPEED = {
    "type": "object",
    "properties": {
        "speed": {"type": "number", "minimum": 0, "maximum": FASTEST},
        "direction": {"enum": ["up", "down"]},
    },
    "required": ["speed", "direction"],
}
_DONE = {"200": answered({"type": "object"}), "409": problem(), "422": problem(), "423": problem()}
_KEY = [{"name": "token", "in": "path", "required": True, "schema": {"type": "string"}}]
DESCRIPTION = described(
    "Winch",
    {
        "/state": {"get": {"responses": {"200": answered(_STATE)}}},
        "/lease": {
            "post": {
                "requestBody": content({"type": "object", "properties": {"owner": {"type": "string"}}}),
                "responses": {"200": answered(_TOKEN), "409": problem()},
            }
        },
        "/lease/{token}": {
            "put": {"parameters": _KEY, "responses": {**_DONE, "404": problem()}},
            "delete": {"parameters": _KEY, "responses": {**_DONE, "404": problem()}},
        },
        **{f"/{name}": {"post": {"responses": _DONE}} for name in ("enable", "home", "disable")},
        "/speed": {"put": {"requestBody": content(_SPEED), "responses": _DONE}},
    },
)


class Winch:
    """The winch's API before its body.

    Attributes:
        told: what was asked of it, in order: acquire, renew, release, enable, home, disable.
        mode: off, enabled, or ready.
    """

    def __init__(self, body: Body | None = None) -> None:
        self.body = body or Body(LIMITS)
        self.told: list[str] = []
        self.mode, self._token, self._until, self._count = "off", "", 0.0, 0

    def app(self) -> Starlette:
        """Return the web application."""
        return Starlette(
            routes=[
                Route("/openapi.json", self._description),
                Route("/{path:path}", self._over_http, methods=["GET", "PUT", "POST", "DELETE"]),
            ]
        )

    @property
    def is_leased(self) -> bool:
        """Whether somebody holds the lease."""
        return bool(self._token) and self.body.now() < self._until

    async def _description(self, _: Request) -> Response:
        return JSONResponse(DESCRIPTION)

    async def _over_http(self, request: Request) -> Response:
        octets = await request.body()
        what, _, token = request.path_params["path"].partition("/")
        if (request.method, what) == ("GET", "state"):
            return JSONResponse({"rope": self.body.told()["rope"], "mode": self.mode})
        if what == "lease":
            return self._lease(request.method, token)
        if not self.is_leased or request.headers.get("x-lease") != self._token:
            return JSONResponse({"detail": "no lease"}, 423)
        if request.method == "POST" and what in {"enable", "home", "disable"}:
            self.told.append(what)
            self.mode = {"enable": "enabled", "home": "ready", "disable": "off"}[what]
            return JSONResponse({})
        if (request.method, what) != ("PUT", "speed"):
            return JSONResponse({"detail": "nothing there"}, 404)
        return self._drive(octets)

    def _lease(self, method: str, token: str) -> Response:
        if method == "POST" and not token:
            if self.is_leased:
                return JSONResponse({"detail": "somebody has it"}, 409)
            self._count += 1
            self._token = f"lease-{self._count}"
            self.told.append("acquire")
        elif token != self._token or not self.is_leased:
            return JSONResponse({"detail": "no such lease"}, 404)
        elif method == "DELETE":
            self.told.append("release")
            self._token = ""
            return JSONResponse({})
        else:
            self.told.append("renew")
        self._until = self.body.now() + LEASE_S
        return JSONResponse({"token": self._token})

    def _drive(self, octets: bytes) -> Response:
        if self.mode != "ready":
            return JSONResponse({"detail": "not ready"}, 409)
        try:
            wanted: Any = json.loads(octets)
            speed, direction = wanted["speed"], wanted["direction"]
        except (ValueError, TypeError, KeyError):
            return JSONResponse({"detail": "speed and direction"}, 422)
        right = isinstance(speed, int | float) and not isinstance(speed, bool) and 0 <= speed <= FASTEST
        if not right or direction not in ("up", "down"):
            return JSONResponse({"detail": "no such speed"}, 422)
        signed = float(speed) if direction == "down" else -float(speed)
        self.body.drive({"rope": signed, "trolley": 0.0}, HOLD_S, self.body.now())
        return JSONResponse({})
