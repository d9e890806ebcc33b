"""A simulated rover on another framework than the arm: it drives at its speed, takes one move at a time, and clamps."""

import asyncio
import datetime as dt
import logging
import math
import random
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from aiohttp import web

LIMIT = 0.6
SPEED = 3.0
MAP = f"""
[motion.state]
read = "GET /pose"
stamp = "/time"
fresh_s = 0.4

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

[motion.stop]
send = "DELETE /goal"
rests_within_s = 0.3
"""
_NUMBER = {"type": "number"}
_POSE = {
    "type": "object",
    "properties": {
        "pose": {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2},
        "time": {"type": "string", "format": "date-time"},
    },
    "required": ["pose", "time"],
}


def _described(schema: dict[str, Any]) -> dict[str, Any]:
    return {"description": "", "content": {"application/json": {"schema": schema}}}


_DONE = {"200": _described({"type": "object"})}
_REFUSED = {"409": _described({"type": "object"}), "422": _described({"type": "object"})}
DESCRIPTION = {
    "openapi": "3.0.3",
    "info": {"title": "Rover", "version": "1"},
    "paths": {
        "/pose": {"get": {"responses": {"200": _described(_POSE)}}},
        "/goal/{x}/{y}": {
            "put": {
                "parameters": [{"name": name, "in": "path", "required": True, "schema": _NUMBER} for name in "xy"],
                "responses": {**_DONE, **_REFUSED},
            }
        },
        "/goal": {"delete": {"responses": _DONE}},
    },
}


class Rover:
    """The rover: each move is a straight line at its speed.

    Args:
        fault: name of what is wrong with it; empty: nothing.
        noise: standard deviation of what it says of its position, m.
        seed: of the noise.
    """

    def __init__(self, fault: str = "", noise: float = 0.0, seed: int = 0) -> None:
        self.fault, self.noise = fault, noise
        self.chance = random.Random(seed)  # noqa: S311 - no secret
        self.start = self.target = (0.0, 0.0)
        self.began = time.monotonic()
        self.speed = {"crawls": 0.2, "races": 4 * SPEED}.get(fault, SPEED * 0.9)

    def at(self, now: float) -> tuple[float, float]:
        """Return where it is."""
        way = math.dist(self.start, self.target)
        share = min(1.0, (now - self.began) * self.speed / way) if way else 1.0
        x, y = (begin + share * (end - begin) for begin, end in zip(self.start, self.target, strict=True))
        return x, y

    def go(self, target: tuple[float, float], now: float) -> None:
        """Set out to a target."""
        self.start, self.target, self.began = self.at(now), target, now

    def moving(self, now: float) -> bool:
        """Return whether it is on its way."""
        return (now - self.began) * self.speed < math.dist(self.start, self.target)

    async def description(self, _: web.Request) -> web.Response:
        """GET /openapi.json."""
        return web.json_response(DESCRIPTION)

    async def pose(self, _: web.Request) -> web.Response:
        """GET /pose."""
        x, y = self.at(time.monotonic())
        if self.noise:
            x, y = x + self.chance.gauss(0, self.noise), y + self.chance.gauss(0, self.noise)
        return web.json_response({"pose": [x, y], "time": dt.datetime.now(dt.UTC).isoformat()})

    async def goal(self, request: web.Request) -> web.Response:
        """PUT /goal/{x}/{y}."""
        now = time.monotonic()
        try:
            x, y = (float(request.match_info[name]) for name in "xy")
        except ValueError:
            return web.json_response({"detail": "no number"}, status=422)
        if not (math.isfinite(x) and math.isfinite(y)):
            return web.json_response({"detail": "no finite number"}, status=422)
        if self.moving(now) and self.fault != "takes-second":
            return web.json_response({"detail": "on its way"}, status=409)
        limit = 10.0 if self.fault == "does-not-clamp" else LIMIT
        target = max(-limit, min(limit, x)), max(-limit, min(limit, y))
        if self.fault == "wrong-sign":
            target = -target[0], target[1]
        self.go(target, now)
        return web.json_response({})

    async def stop(self, _: web.Request) -> web.Response:
        """DELETE /goal."""
        now = time.monotonic()
        if self.fault == "coasts":
            here = self.at(now)
            ahead = [one + 0.9 * (end - one) for one, end in zip(here, self.target, strict=True)]
            self.go((ahead[0], ahead[1]), now)
        elif self.fault != "no-stop":
            self.go(self.at(now), now)
        return web.json_response({})

    def app(self) -> web.Application:
        """Return the web application."""
        app = web.Application()
        app.add_routes(
            [
                web.get("/openapi.json", self.description),
                web.get("/pose", self.pose),
                web.put("/goal/{x}/{y}", self.goal),
                web.delete("/goal", self.stop),
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
    ready.wait(10)
    yield f"http://127.0.0.1:{address[0]}"
    asyncio.run_coroutine_threadsafe(runners[0].cleanup(), loop).result(10)
    loop.call_soon_threadsafe(loop.stop)
    thread.join(10)
