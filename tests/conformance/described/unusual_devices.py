"""Four devices that are right and unusual, each with faults that a name turns on."""

import asyncio
import itertools
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flask import Flask, Response, jsonify, request
from serving_apps import behind_nginx, described_app, description, responses, serving_app
from starlette.responses import JSONResponse, PlainTextResponse, StreamingResponse
from starlette.routing import Route
from uvicorn.middleware.wsgi import WSGIMiddleware

_NONE = {"description": "there is none"}
_TEXT, _INTEGER = {"type": "string"}, {"type": "integer"}


def _path(name: str, schema: Any) -> dict[str, Any]:
    return {"name": name, "in": "path", "required": True, "schema": schema}


@contextmanager
def unions(faults: Collection[str], _: Path) -> Iterator[str]:
    """Cameras by number or name; no operationId, no examples, additionalProperties everywhere (Starlette)."""
    camera = {"type": "object", "required": ["camera"], "properties": {"camera": {"type": "integer"}}}
    parameters = [_path("camera", {"anyOf": [_INTEGER, _TEXT]})]
    found = responses({**camera, "additionalProperties": True}, _404=_NONE)
    names = responses({"type": "object", "additionalProperties": _INTEGER})
    paths = {
        "/video/{camera}": {"get": {"parameters": parameters, "responses": found}},
        "/names": {"get": {"responses": names}},
    }

    def one(asked: Any) -> Any:
        name = asked.path_params["camera"]
        if "500 for a name" in faults:
            name = str(int(name))
        if name not in {"1", "front"}:
            return PlainTextResponse("no such camera", 404)
        return JSONResponse({"camera": "1" if "a text for a number" in faults else 1, "more": {"fps": 30}})

    turns = itertools.count(1)

    def named(_: Any) -> Any:
        if "500 now and then" in faults and next(turns) % 7 == 0:
            return PlainTextResponse("out of memory", 500)
        return JSONResponse({"front": 1})

    routes = [Route("/video/{camera}", one), Route("/names", named)]
    with serving_app(described_app(description(paths), routes)) as url:
        yield url


@contextmanager
def swagger(faults: Collection[str], _: Path) -> Iterator[str]:
    """Speech and joints below a basePath, by forms and piped lists (Flask)."""
    joints = {
        "name": "joints",
        "in": "query",
        "required": True,
        "type": "array",
        "items": {**_TEXT, "enum": ["a", "b"]},
    }
    joints |= {"collectionFormat": "pipes", "minItems": 1, "x-example": ["a", "b"]}
    form = [
        {"name": "text", "in": "formData", "required": True, **_TEXT},
        {"name": "times", "in": "formData", **_INTEGER},
    ]
    angles = {"description": "", "schema": {"type": "object", "additionalProperties": {"type": "number"}}}
    bad = {"400": {"description": "a bad request"}}
    say = {
        "consumes": ["application/x-www-form-urlencoded"],
        "parameters": form,
        "responses": {"204": {"description": ""}, **bad},
    }
    document = {
        "swagger": "2.0",
        "info": {"title": "A device", "version": "1"},
        "basePath": "/v3" if "another basePath" in faults else "/v2",
        "produces": ["application/json"],
        "paths": {
            "/joints": {"get": {"parameters": [joints], "responses": {"200": angles, **bad}}},
            "/say": {"post": say},
        },
    }
    app = Flask("device")

    @app.get("/swagger.json")
    def told() -> Response:
        return jsonify(document)

    @app.get("/v2/joints")
    def read() -> Response:
        names = request.args.get("joints", "").split("," if "another separator" in faults else "|")
        if not set(names) <= {"a", "b"}:
            return Response(status=400)
        return jsonify(dict.fromkeys(names, 0.5))

    @app.post("/v2/say")
    def said() -> Response:
        try:
            int(request.form.get("times", "1"))
        except ValueError:
            return Response(status=400)
        missing = "text" not in request.form and "a form without its field" not in faults
        return Response(status=400 if missing else 204)

    with serving_app(WSGIMiddleware(app)) as url:
        yield url


async def _dripping(piece: bytes) -> Any:
    while True:
        yield piece
        await asyncio.sleep(0.05)


async def _poll(_: Any) -> Any:
    await asyncio.sleep(60)
    return PlainTextResponse("", 204)


@contextmanager
def streams(faults: Collection[str], _: Path) -> Iterator[str]:
    """Streams that never end, declared and not, a long poll, a websocket, a large file (Starlette)."""
    frames = "image/jpeg" if "frames of another type" in faults else "multipart/x-mixed-replace"
    paths = {
        "/events": {"get": {"responses": responses(_TEXT, "text/event-stream")}},
        "/changes": {"get": {"responses": responses()}},
        "/camera": {"get": {"responses": responses(_TEXT, frames)}},
        "/poll": {"get": {"responses": {"204": {"description": ""}}}},
        "/socket": {"get": {"responses": {"101": {"description": ""}, "426": {"description": ""}}}},
        "/log": {"get": {"responses": responses(_TEXT, "application/octet-stream")}},
        "/state": {"get": {"responses": responses({"type": "object", "required": ["on"]})}},
    }
    if faults:  # Its long poll only takes time then.
        del paths["/poll"]
    state = {} if "a member left out" in faults else {"on": True}

    def stream(media_type: str, piece: bytes) -> Any:
        return lambda _: StreamingResponse(_dripping(piece), media_type=media_type)

    routes = [
        Route("/events", stream("text/event-stream", b"data: 1\n\n")),
        Route("/changes", stream("text/event-stream", b"data: 2\n\n")),
        Route("/camera", stream("multipart/x-mixed-replace; boundary=x", b"--x\r\n\r\n" + b"." * 9000)),
        Route("/poll", _poll),
        Route("/socket", lambda _: PlainTextResponse("", 426, {"Upgrade": "websocket", "Connection": "Upgrade"})),
        Route("/log", lambda _: PlainTextResponse(b"." * 50_000_000, media_type="application/octet-stream")),
        Route("/state", lambda _: JSONResponse(state)),
    ]
    with serving_app(described_app(description(paths), routes)) as url:
        yield url


@contextmanager
def behind_a_proxy(faults: Collection[str], folder: Path) -> Iterator[str]:
    """A state below /robot/api behind nginx; the app itself knows nothing of the path (Starlette, nginx)."""
    servers = {} if "no servers" in faults else {"servers": [{"url": "/robot/api"}]}
    paths = {
        "/state": {"get": {"responses": responses({"type": "object"})}},
        "/items/{id}": {"get": {"parameters": [_path("id", _INTEGER)], "responses": responses(_INTEGER, _404=_NONE)}},
    }

    def item(asked: Any) -> Any:
        number = asked.path_params["id"]
        if number == "1":
            return JSONResponse(1, 203 if "a status that is not declared" in faults else 200)
        return PlainTextResponse("", 404)

    routes = [Route("/state", lambda _: JSONResponse({"on": True})), Route("/items/{id}", item)]
    app = described_app(description(paths, **servers), routes)
    with serving_app(app) as upstream, behind_nginx(upstream, "/robot/api", folder) as url:
        yield f"{url}/robot/api/openapi.json"


HAS_NGINX = shutil.which("nginx") is not None
