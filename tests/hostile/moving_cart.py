"""A cart with a velocity and a stop in a process of its own, which is lost while it moves.

``python moving_cart.py PORT FAULT`` serves it, over REST and over SOAP.
"""

import asyncio
import json
import os
import signal
import sys
import time
from typing import Final

from aiohttp import web
from small_device import REFUSED, answers, body_of, described, object_of

FASTEST: Final = 0.5
_NUMBER: Final = {"type": "number"}
_STATE: Final = object_of("x", x=_NUMBER)
_VELOCITY: Final = object_of("ahead", ahead={"type": "number", "minimum": -0.5, "maximum": 0.5})
_ANSWER: Final = {"200": answers({"type": "object"}), "4XX": REFUSED}
PATHS: Final = {
    "/state": {"get": {"responses": {"200": answers(_STATE), "4XX": REFUSED}}},
    "/velocity": {"put": {"requestBody": body_of(_VELOCITY), "responses": _ANSWER}},
    "/stop": {"post": {"responses": _ANSWER}},
}
MAP: Final = """
[motion.state]
read = "GET /state"
[motion.state.axes]
x = { at = "/x", limits = [-1000, 1000], tolerance = 0.01 }
[motion.velocity]
send = "PUT /velocity"
body = { ahead = "{ahead}" }
tolerance = 0.08
[motion.velocity.axes]
ahead = { limits = [-0.5, 0.5], of = "x" }
[motion.stop]
send = "POST /stop"
"""


class Cart:
    """One cart.

    Args:
        fault: what it does once it moves, a key of test_lost_robot.FAULTS, or a status with which it answers the stop.
    """

    def __init__(self, fault: str) -> None:
        self.fault, self.speed, self.x, self.since, self.moved_at = fault, 0.0, 0.0, time.monotonic(), 0.0

    def where(self) -> float:
        """Return where it is now."""
        now = time.monotonic()
        self.x, self.since = self.x + self.speed * (now - self.since), now
        return self.x

    def drive(self, speed: float) -> None:
        """Take a velocity."""
        self.where()
        if self.moved_at and (self.fault.isdigit() or self.fault in {"ignores", "closes"}):
            return  # whatever it is told, it goes on
        self.speed = speed
        if speed and not self.moved_at:
            self.moved_at = time.monotonic()
            if self.fault == "crash":
                os._exit(1)
            if self.fault == "hang":
                os.kill(os.getpid(), signal.SIGSTOP)

    async def silence(self) -> None:
        """Be lost for a while, or for good, where that is the fault."""
        if self.moved_at and (self.fault == "silent" or (self.fault == "pause" and not self._is_back)):
            await asyncio.sleep(3600 if self.fault == "silent" else 1.5)

    @property
    def _is_back(self) -> bool:
        return time.monotonic() > self.moved_at + 1.5

    def stop(self, request: web.Request) -> int:
        """Stop, unless the fault is that it does not; return the status."""
        if not self.moved_at:
            self.drive(0.0)
            return 200
        if self.fault == "closes" and request.transport is not None:
            request.transport.abort()
        if self.fault.isdigit():
            return int(self.fault)
        if self.fault == "late" and not self._is_back:
            return 503
        self.drive(0.0)
        return 200


def application(cart: Cart) -> web.Application:
    """Return the cart's web API."""

    async def state(_: web.Request) -> web.Response:
        await cart.silence()
        return web.json_response({"x": cart.where()})

    async def velocity(request: web.Request) -> web.Response:
        await cart.silence()
        try:
            ahead = json.loads(await request.read())["ahead"]
            is_valid = not isinstance(ahead, bool) and abs(ahead) <= FASTEST
        except (ValueError, KeyError, TypeError):
            is_valid = False
        if not is_valid:
            return web.json_response({"error": "no velocity"}, status=422)
        cart.drive(ahead)
        return web.json_response({})

    async def stop(request: web.Request) -> web.Response:
        await cart.silence()
        status = cart.stop(request)
        return web.json_response({} if status < 400 else {"error": "no"}, status=status)

    async def description(_: web.Request) -> web.Response:
        return web.json_response(described(PATHS))

    app = web.Application()
    app.router.add_get("/openapi.json", description)
    app.router.add_get("/state", state)
    app.router.add_put("/velocity", velocity)
    app.router.add_post("/stop", stop)
    return app


async def main(port: int, fault: str) -> None:
    """Serve a cart until the process is ended."""
    runner = web.AppRunner(application(Cart(fault)), access_log=None)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", port).start()
    print("ready", flush=True)  # noqa: T201 - the test waits for it
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1]), sys.argv[2]))
