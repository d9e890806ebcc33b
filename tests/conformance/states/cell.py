"""A robot cell with a safety state machine: right, or with one fault."""

import json
import time

from aiohttp import web
from small_device import REFUSED, described, error, reading

#: Its states, as a statement has them. It stops by itself once a program is over, and starts for a moment.
MAP = """
[states]
read = "GET /cell"
at = "/state"
pattern = "^([a-z ]+)$"
within_s = 2

[states.operations]
"POST /start" = { from = ["ready"], via = ["starting"], to = "running" }
"POST /pause" = { from = ["running"], to = "paused" }
go-on = { send = "POST /resume", to = { paused = "running" } }
"POST /stop" = { from = ["ready", "starting", "running", "paused"], to = "ready" }
"POST /estop" = { not_in = ["paused"], to = "protective stop" }
"POST /reset" = { from = ["protective stop"], to = "ready", refusal = [409] }
"PUT /speed" = { from = ["ready", "paused"], body = { percent = 20 } }

[states.changes]
starting = { to = ["running"], within_s = 1 }
"""
_STARTS_S = 0.12
_TO = {
    "start": "starting", "pause": "paused", "resume": "running", "stop": "ready", "estop": "protective stop",
    "reset": "ready",
}  # fmt: skip
_FROM = {
    "start": {"ready"},
    "pause": {"running"},
    "resume": {"paused"},
    "stop": {"ready", "starting", "running", "paused"},
    "estop": {"ready", "starting", "running", "paused", "protective stop"},
    "reset": {"protective stop"},
    "speed": {"ready", "paused"},
}
_STATE = {"type": "string", "enum": ["ready", "starting", "running", "paused", "protective stop"]}


class Cell:
    """One cell.

    Args:
        fault: its fault; empty: it is right.
        program_s: how long a program runs, s; None: until it is stopped.
        over_s: after which part of that it has ended when a command comes, though the read before it came in time, s.
    """

    def __init__(self, fault: str = "", program_s: float | None = None, over_s: float = 60.0) -> None:
        self.fault, self.program_s, self.over_s = fault, program_s, over_s
        self._state, self._since, self.sent = "ready", time.monotonic(), list[str]()
        ok = {"responses": {"204": {"description": "done"}, "409": REFUSED, "4XX": REFUSED}}
        body = {"type": "object", "required": ["percent"], "properties": {"percent": {"type": "integer"}}}
        put = {**ok, "requestBody": {"required": True, "content": {"application/json": {"schema": body}}}}
        cell = {"type": "object", "required": ["state"], "properties": {"state": _STATE}}
        self.description = described(
            {"/cell": reading(cell), "/speed": {"put": put}, **{f"/{name}": {"post": ok} for name in _TO}}
        )
        self.routes = {"/cell": {"GET": self._read}, "/speed": {"PUT": self._act}} | {
            f"/{name}": {"POST": self._act} for name in _TO
        }

    @property
    def state(self) -> str:
        """The state now."""
        past = time.monotonic() - self._since
        if self._state == "starting" and past > _STARTS_S and self.fault != "never-runs":
            self._to("running")
        elif self._state == "running" and self.program_s is not None and past > self.program_s:
            self._to("ready")
        elif self._state == "paused" and self.fault == "resumes-by-itself" and past > _STARTS_S:
            self._to("running")
        return self._state

    def _to(self, state: str) -> None:
        self._state, self._since = state, time.monotonic()

    async def _read(self, _: web.Request) -> web.Response:
        state = self.state
        if self.fault == "ready-while-starting" and state == "starting" and time.monotonic() - self._since > 0.06:
            state = "ready"
        elif self.fault == "paused-on-the-way" and state == "starting":
            state = "paused"
        return web.json_response({"state": state})

    async def _act(self, request: web.Request) -> web.Response:
        if self.state == "running" and time.monotonic() - self._since > self.over_s:
            self._to("ready")
        name, before = request.path[1:], self.state
        self.sent.append(name)
        if name == "speed" and not isinstance(json.loads(await request.read() or b"null"), dict):
            return error(400, "a body is wanted")
        allowed = before in _FROM[name] or (self.fault, name, before) in {
            ("resets-while-running", "reset", "running"),
            ("starts-when-paused", "start", "paused"),
            ("speed-while-running", "speed", "running"),
        }
        if (self.fault, name, before) == ("stop-refused-when-paused", "stop", "paused"):
            allowed = False
        if not allowed:
            if self.fault == "refusal-pauses" and before == "running":
                self._to("paused")
            return error(423 if self.fault == "other-refusal" else 409, f"not in the state {before}")
        if self.fault == "speed-stops" and name == "speed" and before == "paused":
            self._to("ready")
        if name in _TO and (self.fault, name) not in {("pause-without-effect", "pause"), ("latch-lost", "estop")}:
            self._to(_TO[name])
        return web.Response(status=204)


#: The faults, and the requirements that must notice each, the first one at least.
FAULTS = {
    "resets-while-running": "refused", "starts-when-paused": "refused", "speed-while-running": "refused",
    "other-refusal": "refused", "stop-refused-when-paused": "taken", "refusal-pauses": "keeps", "speed-stops": "leads",
    "pause-without-effect": "leads", "latch-lost": "leads", "never-runs": "leads", "resumes-by-itself": "leads",
    "ready-while-starting": "order", "paused-on-the-way": "order",
}  # fmt: skip
