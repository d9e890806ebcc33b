"""A device that drives at the last velocity it was given until it gets another one; its state is read from the test."""

import json
import subprocess
import threading
import time
from collections.abc import Callable
from typing import Any

from aiohttp import web
from small_device import REFUSED, answers, body_of, described, error, object_of, reading

LIMIT, FASTEST = 50.0, 0.5
MAP = f"""
[motion.state]
read = "GET /state"

[motion.state.axes]
x = {{ at = "/x", unit = "m", limits = [-{LIMIT}, {LIMIT}], tolerance = 0.05 }}

[motion.velocity]
send = "PUT /velocity"
body = {{ ahead = "{{ahead}}" }}
tolerance = 0.05
settle_s = 0.1

[motion.velocity.axes]
ahead = {{ limits = [-{FASTEST}, {FASTEST}], of = "x" }}
"""
_STATE = object_of("x", x={"type": "number"})
_VELOCITY = object_of("ahead", ahead={"type": "number", "minimum": -FASTEST, "maximum": FASTEST})
DESCRIPTION = described(
    {
        "/state": reading(_STATE),
        "/velocity": {
            "put": {
                "requestBody": body_of(_VELOCITY),
                "responses": {"200": answers({"type": "object"}), "4XX": REFUSED},
            }
        },
    }
)


class Mover:
    """The device.

    Attributes:
        velocity: m/s.
        received: how many requests it got.
        commands: how many velocities other than 0 it took.
    """

    def __init__(self) -> None:
        self.velocity, self.received, self.commands = 0.0, 0, 0
        self._x, self._at = 0.0, time.monotonic()
        self._changed = threading.Condition()

    @property
    def routes(self) -> dict[str, dict[str, Any]]:
        """The handlers by path and method."""
        return {"/state": {"GET": self._state}, "/velocity": {"PUT": self._drive}}

    def await_that(self, holds: Callable[["Mover"], bool], process: subprocess.Popen[str] | None = None) -> bool:
        """Wait for a state, as long as a process runs and at most two minutes; return whether it came."""
        until = time.monotonic() + 120
        with self._changed:
            while time.monotonic() < until and (process is None or process.poll() is None):
                if self._changed.wait_for(lambda: holds(self), 0.5):
                    return True
            return holds(self)

    def _received(self) -> None:
        with self._changed:
            now = time.monotonic()
            self._x, self._at = self._x + self.velocity * (now - self._at), now
            self.received += 1
            self._changed.notify_all()

    async def _state(self, _: web.Request) -> web.Response:
        self._received()
        return web.json_response({"x": self._x})

    async def _drive(self, request: web.Request) -> web.Response:
        self._received()
        try:
            ahead = json.loads(await request.read())["ahead"]
        except (ValueError, KeyError, TypeError):
            return error(400, "no velocity")
        if not isinstance(ahead, int | float) or isinstance(ahead, bool) or not abs(ahead) <= FASTEST:
            return error(422, "too fast")
        with self._changed:
            self.velocity = float(ahead)
            self.commands += self.velocity != 0
            self._changed.notify_all()
        return web.json_response({})
