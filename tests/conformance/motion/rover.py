"""A simulated rover on aiohttp: it drives at its speed or a given one, takes one move at a time, and clamps."""

import asyncio
import datetime as dt
import json
import logging
import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from aiohttp import web
from body import Body
from descriptions import answered, content, described, problem

LIMIT, SPEED, FASTEST, HOLD_S = 0.6, 3.0, 0.5, 0.4
LIMITS = {"x": (-LIMIT, LIMIT), "y": (-LIMIT, LIMIT)}
MAP = f"""
[motion.state]
read = "GET /pose"
stamp = "/time"
fresh_s = 0.4
agrees = {{ "GET /velocity" = {{ left = "/left" }} }}

[motion.state.axes]
x = {{ at = "/pose/0", unit = "m", limits = [-{LIMIT}, {LIMIT}], speed = {SPEED} }}
y = {{ at = "/pose/1", unit = "m", limits = [-{LIMIT}, {LIMIT}], speed = {SPEED} }}

[motion.goto]
send = "PUT /goal/{{x}}/{{y}}"
within_s = 1.0
settle_s = 0.3
tolerance = 0.03
beyond_limits = "clamped"
while_moving = "refused"

[motion.velocity]
send = "PUT /velocity"
body = {{ ahead = "{{ahead}}", left = "{{left}}" }}
tolerance = 0.08
settle_s = 0.2
hold_s = {HOLD_S}
beyond_limits = "refused"

[motion.velocity.axes]
ahead = {{ limits = [-{FASTEST}, {FASTEST}], of = "x" }}
left = {{ limits = [-{FASTEST}, {FASTEST}], at = "/velocity/1" }}

[motion.switches.gripper]
send = "PUT /gripper/{{value}}"
at = "/gripper"
values = ["open", "closed"]
shows = {{ open = "OPEN", closed = "CLOSED" }}
within_s = 0.5

[motion.stop]
send = "DELETE /goal"
rests_within_s = 0.3
"""
_NUMBER = {"type": "number"}
_TWO = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}
_SPEED = {"type": "number", "minimum": -FASTEST, "maximum": FASTEST}
_VELOCITY = {"type": "object", "properties": {"ahead": _SPEED, "left": _SPEED}, "required": ["ahead", "left"]}
_POSE = {
    "type": "object",
    "properties": {
        "pose": _TWO,
        "velocity": _TWO,
        "gripper": {"enum": ["OPEN", "CLOSED"]},
        "time": {"type": "string", "format": "date-time"},
    },
    "required": ["pose", "velocity", "gripper", "time"],
}


def _in_path(name: str, schema: dict[str, Any]) -> dict[str, Any]:
    return {"name": name, "in": "path", "required": True, "schema": schema}


_DONE = {"200": answered({"type": "object"})}
_REFUSED = {"409": problem(), "422": problem()}
DESCRIPTION = described(
    "Rover",
    {
        "/pose": {"get": {"responses": {"200": answered(_POSE)}}},
        "/goal/{x}/{y}": {
            "put": {"parameters": [_in_path(name, _NUMBER) for name in "xy"], "responses": {**_DONE, **_REFUSED}}
        },
        "/goal": {"delete": {"responses": _DONE}},
        "/velocity": {
            "get": {"responses": {"200": answered(_VELOCITY)}},
            "put": {"requestBody": content(_VELOCITY), "responses": {**_DONE, "400": problem(), "422": problem()}},
        },
        "/gripper/{state}": {
            "put": {
                "parameters": [_in_path("state", {"enum": ["open", "closed"]})],
                "responses": {**_DONE, "422": problem()},
            }
        },
    },
)


class Rover:
    """The rover's API before its body; ``body``: the mechanics, None: right ones."""

    def __init__(self, body: Body | None = None) -> None:
        self.body = body or Body(LIMITS)

    def answer(self, method: str, path: str, octets: bytes) -> tuple[int, Any]:
        """Return status and JSON of the response to a request."""
        what, *values = path.strip("/").split("/")
        if what == "pose":
            return 200, self._pose()
        if what == "gripper":
            return self._grip(values[0])
        if what == "velocity":
            told = self.body.velocity_elsewhere(self.body.now())
            return (200, {"ahead": told["x"], "left": told["y"]}) if method == "GET" else self._drive(octets)
        if method == "DELETE":
            self.body.halt(self.body.now())
            return 200, {}
        return self._go(values)

    def _pose(self) -> dict[str, Any]:
        now = self.body.now()
        time = dt.datetime.fromtimestamp(self.body.stamp(now), dt.UTC).isoformat()
        return {
            "pose": list(self.body.told().values()),
            "velocity": list(self.body.velocity(now).values()),
            "gripper": self.body.gripper(now).upper(),
            "time": time,
        }

    def _go(self, values: list[str]) -> tuple[int, dict[str, Any]]:
        try:
            numbers = [float(one) for one in values]
        except ValueError:
            return 422, {"detail": "no number"}
        if not all(map(math.isfinite, numbers)):
            return 422, {"detail": "no finite number"}
        if self.body.moving(self.body.now()) and not self.body.takes_second:
            return 409, {"detail": "on its way"}
        target = {name: max(-LIMIT, min(LIMIT, one)) for name, one in zip("xy", numbers, strict=True)}
        here = self.body.at(self.body.now())
        self.body.go(target, math.dist(list(here.values()), list(target.values())) / (0.9 * SPEED))
        return 200, {}

    def _drive(self, octets: bytes) -> tuple[int, dict[str, Any]]:
        try:
            wanted = json.loads(octets)
        except ValueError:
            return 400, {"detail": "no JSON"}
        found = [wanted.get(name) for name in ("ahead", "left")] if isinstance(wanted, dict) else [None]
        speeds = [one for one in found if isinstance(one, int | float) and not isinstance(one, bool)]
        integral = self.body.refuses_integers and all(isinstance(one, int) for one in speeds)
        if len(speeds) < len(LIMITS) or integral or not all(abs(one) <= FASTEST for one in speeds):
            self.body.refused(self.body.now())
            return 422, {"detail": "no velocity, or too fast"}
        self.body.drive(dict(zip("xy", map(float, speeds), strict=True)), HOLD_S, self.body.now())
        return 200, {}

    def _grip(self, state: str) -> tuple[int, dict[str, Any]]:
        if state not in {"open", "closed"}:
            return 422, {"detail": "open or closed"}
        self.body.grip(state, self.body.now())
        return 200, {}

    async def _over_http(self, request: web.Request) -> web.Response:
        status, document = self.answer(request.method, request.path, await request.read())
        return web.json_response(document, status=status)

    async def _description(self, _: web.Request) -> web.Response:
        return web.json_response(DESCRIPTION)

    def app(self) -> web.Application:
        """Return the web application."""
        app = web.Application()
        app.add_routes(
            [
                web.get("/openapi.json", self._description),
                web.get("/pose", self._over_http),
                web.put("/goal/{x}/{y}", self._over_http),
                web.delete("/goal", self._over_http),
                web.get("/velocity", self._over_http),
                web.put("/velocity", self._over_http),
                web.put("/gripper/{state}", self._over_http),
            ]
        )
        return app


@contextmanager
def serving_rover(rover: Rover) -> Iterator[str]:
    """Serve a rover on loopback; yields its base URL."""
    logging.getLogger("aiohttp.server").setLevel(logging.CRITICAL)  # it tells each malformed request
    loop, ready, address = asyncio.new_event_loop(), threading.Event(), []
    runners: list[web.AppRunner] = []

    async def begin() -> None:
        runner = web.AppRunner(rover.app(), access_log=None)
        await runner.setup()
        runners.append(runner)
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        address.append(runner.addresses[0][1])
        ready.set()

    def run() -> None:
        loop.run_until_complete(begin())
        loop.run_forever()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    ready.wait(60)
    yield f"http://127.0.0.1:{address[0]}"
    asyncio.run_coroutine_threadsafe(runners[0].cleanup(), loop).result(10)
    loop.call_soon_threadsafe(loop.stop)
    thread.join(10)
