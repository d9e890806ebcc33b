"""A simulated arm with two axes and a web API, right or with one fault."""

import json
import random
import time
from collections.abc import Callable
from typing import Any

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
_MOVE = {
    "type": "object",
    "properties": {
        **{name: {"type": "number", "minimum": least, "maximum": most} for name, (least, most) in LIMITS.items()},
        "seconds": {"type": "number", "exclusiveMinimum": 0, "maximum": 10},
    },
    "required": [*LIMITS, "seconds"],
}


def _content(schema: dict[str, Any]) -> dict[str, Any]:
    return {"content": {"application/json": {"schema": schema}}}


def _described(schema: dict[str, Any]) -> dict[str, Any]:
    return {"description": "", **_content(schema)}


_PROBLEM = _described({"type": "object", "properties": {"detail": {"type": "string"}}, "required": ["detail"]})
DESCRIPTION = {
    "openapi": "3.1.0",
    "info": {"title": "Arm", "version": "1"},
    "paths": {
        "/state": {"get": {"responses": {"200": _described(_STATE)}}},
        "/move": {
            "post": {
                "requestBody": {"required": True, **_content(_MOVE)},
                "responses": {"200": _described(_ID), "400": _PROBLEM, "422": _PROBLEM},
            }
        },
        "/stop": {
            "post": {
                "requestBody": {"required": True, **_content(_ID)},
                "responses": {"200": _described(_ID), "400": _PROBLEM, "422": _PROBLEM},
            }
        },
    },
}


class Arm:
    """The arm: each move goes from where it is to its target in a straight line and its time.

    Args:
        fault: name of what is wrong with it; empty: nothing.
        noise: standard deviation of what it says of its position, rad.
        seed: of the noise.
        now: returns the time, s.
    """

    def __init__(
        self, fault: str = "", noise: float = 0.0, seed: int = 0, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.fault, self.noise, self.now = fault, noise, now
        self.chance = random.Random(seed)  # noqa: S311 - no secret
        self.start = dict.fromkeys(LIMITS, 0.0)
        self.target = dict(self.start)
        self.began, self.seconds = now(), 0.01
        self.moves = 0
        self.later: list[tuple[float, dict[str, float], float]] = []
        self.said: tuple[float, dict[str, float]] | None = None

    def app(self) -> Starlette:
        """Return the web application."""
        return Starlette(
            routes=[
                Route("/openapi.json", self._description),
                Route("/state", self._over_http),
                Route("/move", self._over_http, methods=["POST"]),
                Route("/stop", self._over_http, methods=["POST"]),
            ]
        )

    def _at(self, now: float) -> dict[str, float]:
        """Return where the arm is."""
        while self.later and min(self.later, key=lambda one: one[0])[0] <= now:
            due, target, seconds = first = min(self.later, key=lambda one: one[0])
            self.later.remove(first)
            self._begin(target or self._at(due), seconds, due)
        share = min(1.0, max(0.0, (now - self.began) / self.seconds))
        here = {name: self.start[name] + share * (self.target[name] - self.start[name]) for name in LIMITS}
        if self.fault == "drifts" and share == 1.0:
            here["pan"] += 0.2 * min(1.0, now - self.began - self.seconds)
        if self.fault == "trembles" and share == 1.0:
            here["tilt"] += 0.1 if int(now * 8) % 2 else -0.1
        return here

    def _begin(self, target: dict[str, float], seconds: float, now: float) -> None:
        self.start = self._at(now)
        self.target, self.began, self.seconds = target, now, seconds

    async def _description(self, _: Request) -> Response:
        return JSONResponse(DESCRIPTION)

    async def _over_http(self, request: Request) -> Response:
        try:
            octets = await request.body()
        except ClientDisconnect:
            if self.fault == "incomplete-moves":
                self._begin({"pan": 0.5, "tilt": 0.2}, 0.3, self.now())
            raise
        status, document = self.answer(request.url.path, octets)
        return JSONResponse(document, status)

    def answer(self, path: str, octets: bytes) -> tuple[int, dict[str, Any]]:
        """Return status and JSON of the response to a request for a path."""
        if path == "/state":
            return 200, self._state()
        try:
            wanted = json.loads(octets)
        except ValueError:
            if self.fault == "malformed-moves":
                self._begin({"pan": 0.5, "tilt": 0.0}, 0.3, self.now())
            return 400, {"detail": "no JSON"}
        return self._move(wanted) if path == "/move" else self._stop(wanted)

    def _state(self) -> dict[str, Any]:
        now = self.now()
        here = self._at(now)
        if self.fault == "stale":
            if self.said is None or now - self.said[0] > 0.45:
                self.said = now, here
            here = self.said[1]
        if self.noise:
            here = {name: value + self.chance.gauss(0, self.noise) for name, value in here.items()}
        return {"joints": here, "stamp": {"stamp-stuck": 5.0, "stamp-back": -now}.get(self.fault, now)}

    def _move(self, wanted: Any) -> tuple[int, dict[str, Any]]:
        problem = self._problem(wanted)
        if not problem:
            return 200, self._accept({name: float(wanted[name]) for name in LIMITS}, float(wanted["seconds"]))
        if self.fault == "refused-moves" and isinstance(wanted, dict):
            self._begin({"pan": 0.5, "tilt": 0.0}, 0.3, self.now())
        return 422, {"detail": problem}

    def _problem(self, wanted: Any) -> str:
        if not isinstance(wanted, dict):
            return "no object"
        for name, (least, most) in {**LIMITS, "seconds": (1e-9, 10.0)}.items():
            value = wanted.get(name)
            if isinstance(value, bool) or not isinstance(value, int | float):
                return f"{name} is no number"
            if not least <= value <= most and not (
                self.fault in {"clamped-silently", "beyond-taken"} and name in LIMITS
            ):
                return f"{name} is beyond its limits"
        return ""

    def _accept(self, target: dict[str, float], seconds: float) -> dict[str, Any]:
        now, fault = self.now(), self.fault
        self.moves += 1
        moving = now < self.began + self.seconds
        here = self._at(now)
        if fault == "queues" and moving:
            self.later.append((self.began + self.seconds, target, seconds))
        elif not (fault == "ignores-second" and moving) and not (fault == "loses-tenth" and self.moves % 10 == 0):
            if fault == "goes-back" and moving:
                self.later.append((now + seconds + 0.2, dict(self.target), seconds))
            seconds *= {"late": 2.5, "too-fast": 0.1}.get(fault, 1.0)
            self._begin(self._wrong(target, here, fresh=moving and now - self.began < 0.05), seconds, now)
        return {"id": self.moves}

    def _wrong(self, target: dict[str, float], here: dict[str, float], *, fresh: bool) -> dict[str, float]:
        """Return where the arm goes in place of a target; ``fresh``: the last one came just before."""
        pan, tilt = target["pan"], target["tilt"]
        places = {
            "short": {name: here[name] + 0.9 * (value - here[name]) for name, value in target.items()},
            "beyond": {"pan": 1.1 * pan, "tilt": 1.1 * tilt},
            "other-sign": {"pan": abs(pan), "tilt": abs(tilt)},
            "one-axis": {"pan": pan, "tilt": here["tilt"]},
            "swapped": {"pan": tilt, "tilt": pan},
            "offset": {"pan": pan + 0.05, "tilt": tilt},
            "clamped-silently": {
                name: min(max(value, LIMITS[name][0]), LIMITS[name][1]) for name, value in target.items()
            },
        }
        if self.fault == "mixes" and fresh:
            return {"pan": pan, "tilt": self.target["tilt"]}
        if self.fault == "adds-repeated" and fresh and target == self.target:
            return {"pan": 1.2 * pan, "tilt": 1.2 * tilt}
        return places.get(self.fault, target)

    def _stop(self, wanted: Any) -> tuple[int, dict[str, Any]]:
        number = wanted.get("id") if isinstance(wanted, dict) else None
        if isinstance(number, bool) or not isinstance(number, int):
            return 422, {"detail": "no id"}
        now, fault = self.now(), self.fault
        here, target = self._at(now), dict(self.target)
        if fault == "no-stop" or self.began + self.seconds <= now:
            return 200, {"id": number}
        if fault == "stops-late":
            self.later.append((now + 0.4, {}, 0.01))
        elif fault == "creeps-on":
            self._begin({name: here[name] + 0.1 * (target[name] - here[name]) for name in LIMITS}, 2.0, now)
        else:
            self._begin(here, 0.01, now)
        if fault == "resumes":
            self.later.append((now + 0.8, target, 0.5))
        if fault == "goes-home":
            self.later.append((now + 0.3, dict.fromkeys(LIMITS, 0.0), 0.5))
        return 200, {"id": number}
