"""A right device that keeps state: modes, a lease, a queue that fills, things that stay, a counter with If-Match."""

import itertools
import json
from collections.abc import Mapping
from typing import Any

from aiohttp import web
from small_device import REFUSED, Handle, answers, body_of, described, error, object_of

_TEXT = {"type": "string"}
_MODE = object_of("mode", mode={"enum": ["idle", "running", "done", "home"]})
_JOB = object_of("id", id={"type": "integer"}, name=_TEXT)
_NAMED = object_of("name", name={"type": "string", "maxLength": 40})
_COUNT = object_of("count", count={"type": "integer"})
_LEASE = object_of("lease", lease={"type": "string"})
_LIMITS = object_of("speed", speed={"type": "number", "minimum": 0, "maximum": 2})


def _operation(statuses: Mapping[int, Any], *, body: Any = None, parameters: list[Any] | None = None) -> dict[str, Any]:
    responses = {str(code): answers(schema) if schema else {"description": "none"} for code, schema in statuses.items()}
    content = {"requestBody": body_of(body)} if body else {}
    return {"responses": {**responses, "4XX": REFUSED}, "parameters": parameters or [], **content}


_ID = {"name": "id", "in": "path", "required": True, "schema": {"type": "integer", "minimum": 1}}
_IF_MATCH = {"name": "If-Match", "in": "header", "schema": _TEXT}
_MINUTES = {"name": "minutes", "in": "query", "required": True, "schema": {"type": "integer", "minimum": 1}}
DESCRIPTION = described(
    {
        "/mode": {"get": _operation({200: _MODE})},
        "/start": {"post": _operation({200: _MODE})},
        "/stop": {"post": _operation({200: _MODE})},
        "/return-home": {"post": _operation({200: _MODE}, parameters=[_MINUTES])},
        "/lease": {"post": _operation({201: _LEASE})},
        "/queue": {
            "get": _operation({200: {"type": "array", "items": _JOB}}),
            "post": _operation({201: _JOB}, body=_NAMED),
        },
        "/jobs": {
            "get": _operation({200: {"type": "array", "items": _JOB}}),
            "post": _operation({201: _JOB}, body=_NAMED),
        },
        "/jobs/{id}": {"get": _operation({200: _JOB}, parameters=[_ID])},
        "/logs/{id}": {
            "get": _operation({200: _JOB}, parameters=[_ID]),
            "delete": _operation({204: None}, parameters=[_ID]),
        },
        "/logs": {"get": _operation({200: {"type": "array", "items": _JOB}})},
        "/counter": {
            "get": _operation({200: _COUNT}),
            "put": _operation({200: _COUNT}, body=_COUNT, parameters=[_IF_MATCH]),
        },
        "/limits": {"get": _operation({200: _LIMITS}), "put": _operation({200: _LIMITS}, body=_LIMITS)},
    }
)


async def _object(request: web.Request, members: Mapping[str, type | tuple[type, ...]]) -> dict[str, Any]:
    """Return the JSON object of a request.

    Raises:
        web.HTTPBadRequest, web.HTTPUnsupportedMediaType: it is none, or a member is missing or of another type.
    """
    if request.content_type != "application/json":
        raise web.HTTPUnsupportedMediaType
    try:
        value = json.loads(await request.read(), parse_constant=_refuse)
    except (ValueError, RecursionError) as raised:
        raise web.HTTPBadRequest from raised
    if not isinstance(value, dict):
        raise web.HTTPBadRequest
    for name, types in members.items():
        if isinstance(value.get(name), bool) or not isinstance(value.get(name), types):
            raise web.HTTPBadRequest
    return value


def _refuse(text: str) -> Any:
    raise ValueError(text)


def _shown(value: Any, status: int = 200, **headers: str) -> web.Response:
    return web.json_response(value, status=status, headers=headers)


class StatefulDevice:
    """Its handlers, and its state.

    Args:
        broken: whether POST /start, /jobs and /lease answer what is not declared when they succeed.
    """

    def __init__(self, *, broken: bool = False) -> None:
        self.broken = broken
        self.mode, self.leased, self.count, self.speed = "idle", False, 0, 1.0
        self.queue: list[dict[str, Any]] = []
        self.jobs: dict[int, dict[str, Any]] = {}
        self.logs = {number: {"id": number} for number in range(1, 4)}
        self._numbers = itertools.count(1)

    async def _mode(self, _: web.Request) -> web.Response:
        return _shown({"mode": self.mode})

    def _turn(self, before: str, after: str) -> Handle:
        async def handle(request: web.Request) -> web.Response:
            if after == "home":
                minutes = request.query.get("minutes", "")
                if not (minutes.isascii() and minutes.isdigit() and int(minutes[:9]) > 0):
                    return error(400, "minutes")
            if self.mode != before:
                return error(409, f"it is {self.mode}")
            self.mode = after
            return _shown({"mode": "wrong" if self.broken else after})

        return handle

    async def _lease(self, _: web.Request) -> web.Response:
        if self.leased:
            return error(423, "another client has it")
        self.leased = True
        return _shown({"lease": 5 if self.broken else "abc"}, 201)

    async def _queue(self, _: web.Request) -> web.Response:
        return _shown(self.queue)

    async def _enqueue(self, request: web.Request) -> web.Response:
        name = await _name(request)
        if len(self.queue) >= 5:
            return error(507, "full") if self.broken else error(409, "full")
        self.queue.append({"id": len(self.queue) + 1, "name": name})
        return _shown(self.queue[-1], 201)

    async def _jobs(self, _: web.Request) -> web.Response:
        return _shown(list(self.jobs.values()))

    async def _create(self, request: web.Request) -> web.Response:
        name, number = await _name(request), next(self._numbers)
        self.jobs[number] = {"id": number, "name": name}
        return _shown({"id": str(number) if self.broken else number, "name": name}, 201, Location=f"/jobs/{number}")

    def _item(self, things: dict[int, dict[str, Any]]) -> dict[str, Handle]:
        def found(request: web.Request) -> int:
            text = request.match_info["id"]
            if not (text.isascii() and text.isdigit() and not text.startswith("0")):
                raise web.HTTPBadRequest
            if len(text) > 9 or int(text) not in things:
                raise web.HTTPNotFound
            return int(text)

        async def get(request: web.Request) -> web.Response:
            return _shown(things[found(request)])

        async def delete(request: web.Request) -> web.Response:
            del things[found(request)]
            return web.Response(status=204)

        return {"GET": get, "DELETE": delete}

    async def _logs(self, _: web.Request) -> web.Response:
        return _shown(list(self.logs.values()))

    async def _counter(self, _: web.Request) -> web.Response:
        return _shown({"count": self.count}, ETag=f'"{self.count}"')

    async def _set_counter(self, request: web.Request) -> web.Response:
        given = (await _object(request, {"count": int}))["count"]
        wanted = request.headers.get("If-Match", "")
        if not wanted:
            return error(428, "If-Match")
        if not {"*", f'"{self.count}"'} & {one.strip() for one in wanted.split(",")}:
            return error(412, "the counter has changed")
        self.count = given
        return _shown({"count": self.count}, ETag=f'"{self.count}"')

    async def _limits(self, _: web.Request) -> web.Response:
        return _shown({"speed": self.speed})

    async def _set_limits(self, request: web.Request) -> web.Response:
        speed = (await _object(request, {"speed": (int, float)}))["speed"]
        if not 0 <= speed <= 2:
            return error(400, "speed")
        self.speed = speed
        return _shown({"speed": self.speed})

    @property
    def routes(self) -> dict[str, dict[str, Handle]]:
        """The handlers of each path."""
        jobs = self._item(self.jobs)
        return {
            "/mode": {"GET": self._mode},
            "/start": {"POST": self._turn("idle", "running")},
            "/stop": {"POST": self._turn("running", "done")},
            "/return-home": {"POST": self._turn("done", "home")},
            "/lease": {"POST": self._lease},
            "/queue": {"GET": self._queue, "POST": self._enqueue},
            "/jobs": {"GET": self._jobs, "POST": self._create},
            "/jobs/{id}": {"GET": jobs["GET"]},
            "/logs": {"GET": self._logs},
            "/logs/{id}": self._item(self.logs),
            "/counter": {"GET": self._counter, "PUT": self._set_counter},
            "/limits": {"GET": self._limits, "PUT": self._set_limits},
        }


async def _name(request: web.Request) -> str:
    name = (await _object(request, {"name": str}))["name"]
    if len(name) > 40:
        raise web.HTTPBadRequest
    return str(name)
