"""Six devices that are right and unusual, each with faults that a name turns on."""

import asyncio
import itertools
import json
import shutil
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from aiohttp import web
from flask import Flask, Response, jsonify, request
from jsonschema import Draft202012Validator
from serving_apps import behind_nginx, described_app, description, responses, serving_app
from starlette.responses import JSONResponse, PlainTextResponse, StreamingResponse
from starlette.routing import Route
from toy_server import Handler, server_of
from uvicorn.middleware.wsgi import WSGIMiddleware

_NONE = {"description": "there is none"}
_TEXT, _INTEGER = {"type": "string"}, {"type": "integer"}
TOKEN = "open sesame".replace(" ", "-")


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
def openapi_3_0(faults: Collection[str], _: Path) -> Iterator[str]:
    """Tools with nullable, discriminator, readOnly, writeOnly and exclusiveMinimum as a boolean (aiohttp's router)."""
    kinds = ("gripper", "drill")
    base = {
        "type": "object",
        "required": ["id", "kind", "secret", "force"],
        "properties": {
            "id": {"type": "integer", "readOnly": True},
            "kind": {"type": "string"},
            "secret": {"type": "string", "writeOnly": True},
            "force": {"type": "number", "minimum": 0, "exclusiveMinimum": True},
            "owner": {"type": "string", "nullable": True},
        },
    }
    tool = {
        "oneOf": [{"$ref": f"#/components/schemas/{kind}"} for kind in kinds],
        "discriminator": {"propertyName": "kind"},
    }
    schemas = {kind: {"allOf": [base, {"properties": {"kind": {"enum": list(kinds)}}}]} for kind in kinds}
    body = {"required": True, "content": {"application/json": {"schema": tool}}}
    made = {"201": {"description": "", "content": {"application/json": {"schema": tool}}}, "422": _NONE}
    paths = {
        "/tools": {
            "get": {"responses": responses({"type": "array", "items": tool})},
            "post": {"requestBody": body, "responses": made},
        },
        "/tools/{id}": {
            "get": {"parameters": [_path("id", _INTEGER)], "responses": responses(tool, _404=_NONE, _422=_NONE)}
        },
    }
    document = description(paths, "3.0.3", components={"schemas": schemas})
    force = {"type": "number", "minimum" if "a bound that is taken" in faults else "exclusiveMinimum": 0}
    taken = {"kind": {"enum": list(kinds)}, "secret": _TEXT, "force": force, "owner": {"type": ["string", "null"]}}
    valid = Draft202012Validator({"type": "object", "required": ["kind", "secret", "force"], "properties": taken})
    tools: list[dict[str, Any]] = [{"id": 0, "kind": "drill", "force": 1.5, "owner": None}]
    if "null that is not allowed" in faults:
        tools[0]["kind"] = None

    async def add(asked: web.Request) -> web.Response:
        try:
            value = json.loads(await asked.read())
        except ValueError:
            return web.Response(status=422)
        if not valid.is_valid(value):
            return web.Response(status=422)
        kept = {name: value[name] for name in ("kind", "force", "owner") if name in value}
        tools.append({"id": len(tools), **kept})
        return web.json_response(tools[-1], status=201)

    async def one(asked: web.Request) -> web.Response:
        try:
            number = int(asked.match_info["id"])
        except ValueError:
            return web.Response(status=422)
        return web.json_response(tools[number]) if 0 <= number < len(tools) else web.Response(status=404)

    async def listed(_: web.Request) -> web.Response:
        return web.json_response(tools)

    async def told(_: web.Request) -> web.Response:
        return web.json_response(document)

    app = web.Application()
    app.add_routes(
        [
            web.get("/openapi.json", told),
            web.get("/tools", listed),
            web.post("/tools", add),
            web.get("/tools/{id}", one),
        ]
    )
    with _serving_aiohttp(app) as url:
        yield url


@contextmanager
def _serving_aiohttp(app: web.Application) -> Iterator[str]:
    loop = asyncio.new_event_loop()

    @web.middleware
    async def with_host(asked: web.Request, handler: Any) -> Any:
        # RFC 9112 3.2; aiohttp itself takes a request without one.
        if len(asked.headers.getall("Host", ())) != 1:
            return web.Response(status=400)
        return await handler(asked)

    app.middlewares.append(with_host)
    runner = web.AppRunner(app)
    loop.run_until_complete(runner.setup())
    site = web.TCPSite(runner, "127.0.0.1", 0)
    loop.run_until_complete(site.start())
    threading.Thread(target=loop.run_forever, daemon=True).start()
    yield f"http://127.0.0.1:{runner.addresses[0][1]}"
    asyncio.run_coroutine_threadsafe(runner.cleanup(), loop).result(10)
    loop.call_soon_threadsafe(loop.stop)


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


class _Guarded(Handler):
    """Serves a state to clients with a key in the query or with a bearer token (http.server)."""

    default_request_version = "HTTP/1.1"

    def answer(self) -> None:
        path, _, query = self.path.removeprefix(f"http://{self.headers.get('Host')}").partition("?")
        lengths, coding = self.headers.get_all("Content-Length", []), self.headers.get("Transfer-Encoding")
        if len(self.headers.get_all("Host", [])) != 1 or len(lengths) > 1 or coding or self.headers.defects:
            self.close_connection = True
            self.send(400)
        elif path == "/openapi.json":
            self.send(200, json.dumps(self.server.document).encode())
        elif path != "/state":
            self.send(404, b"{}")
        elif self.command not in {"GET", "HEAD"}:
            self._refuse(405, "Allow", "GET, HEAD")
        elif f"key={TOKEN}" in query.split("&") or self.headers.get("Authorization") == f"Bearer {TOKEN}":
            self.send(200, b'{"on": 1}' if "a number for a boolean" in self.server.faults else b'{"on": true}')
        else:
            self._refuse(401, "WWW-Authenticate", "Bearer")

    def _refuse(self, status: int, name: str, value: str) -> None:
        self.send_response(status)
        self.send_header(name, value)
        self.send_header("Content-Length", "0")
        self.end_headers()


@contextmanager
def guarded(faults: Collection[str], _: Path) -> Iterator[str]:
    """A state behind an API key in the query or a bearer token."""
    state = responses({"type": "object", "properties": {"on": {"type": "boolean"}}}, _401=_NONE)
    schemes = {"key": {"type": "apiKey", "in": "query", "name": "key"}, "token": {"type": "http", "scheme": "bearer"}}
    document = description({"/state": {"get": {"responses": state}}}, components={"securitySchemes": schemes})
    document["security"] = [{"key": []}, {"token": []}]
    with server_of(_Guarded, document=document, faults=faults) as server:
        yield server.url


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
