"""A dimmable lamp with a web API: ``python lamp.py [PORT]``. The lamp fades to each brightness it receives."""

import json
import logging
import socket
import sys
import time
from pathlib import Path

import yaml
from aiohttp import web

FADE_PER_S = 4.0
OPENAPI = yaml.safe_load((Path(__file__).parent / "openapi.yaml").read_text(encoding="utf-8"))


class Lamp:
    """A lamp that fades from one brightness to another; 0 is off, 1 is full brightness."""

    def __init__(self) -> None:
        self.start = self.target = 0.0
        self.since = time.monotonic()

    @property
    def brightness(self) -> float:
        """The present brightness, 0 to 1, calculated from the time since the fade began."""
        way = FADE_PER_S * (time.monotonic() - self.since)
        return min(self.target, self.start + way) if self.target > self.start else max(self.target, self.start - way)

    def fade(self, target: float) -> None:
        """Begin to fade from the present brightness to ``target``."""
        self.start, self.target, self.since = self.brightness, target, time.monotonic()


LAMP = Lamp()


def refused(status: int, detail: str) -> web.Response:
    """Return an error response as application/problem+json (RFC 9457)."""
    return web.json_response(
        {"status": status, "detail": detail}, status=status, content_type="application/problem+json"
    )


async def get_lamp(_: web.Request) -> web.Response:
    """Return the response to ``GET /lamp``: brightness and target as JSON."""
    return web.json_response({"brightness": LAMP.brightness, "target": LAMP.target})


async def put_lamp(request: web.Request) -> web.Response:
    """Set the target brightness from a ``PUT /lamp`` request; return the lamp's state, or 400, 415 or 422."""
    if request.content_type != "application/json":
        return refused(415, "the request body must be application/json")
    try:
        brightness = json.loads(await request.read())["brightness"]
    except (ValueError, TypeError, KeyError, RecursionError):
        return refused(400, "the request body must be an object with a brightness")
    if isinstance(brightness, bool) or not isinstance(brightness, int | float) or not 0 <= brightness <= 1:
        return refused(422, "brightness must be a number from 0 to 1")
    LAMP.fade(float(brightness))
    return await get_lamp(request)


async def get_openapi(_: web.Request) -> web.Response:
    """Return the lamp's OpenAPI description as JSON."""
    return web.json_response(OPENAPI)


if __name__ == "__main__":
    port = int(sys.argv[1]) if len(sys.argv) > 1 else 7100
    app = web.Application()
    app.add_routes([web.get("/lamp", get_lamp), web.put("/lamp", put_lamp), web.get("/openapi.json", get_openapi)])
    logging.getLogger("aiohttp.server").disabled = True
    listening = socket.create_server(("127.0.0.1", port))
    ready = f"ready rest=http://127.0.0.1:{listening.getsockname()[1]}"
    web.run_app(app, sock=listening, print=lambda _: print(ready, flush=True))
