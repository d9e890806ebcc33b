"""A small right device on aiohttp, and one certification of it by the command."""

import asyncio
import json
import re
import ssl
import sys
import threading
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes

from aiohttp import web
from processes import ended

from conformance.contract.described import write_described_pack
from conformance.contract.pack import Contract

Handle = Callable[[web.Request], Awaitable[web.StreamResponse]]
_KNOWN = {"GET", "HEAD", "PUT", "POST", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT"}
REFUSED = {
    "description": "refused",
    "content": {
        "application/json": {
            "schema": {"type": "object", "required": ["error"], "properties": {"error": {"type": "string"}}}
        }
    },
}


def described(paths: Mapping[str, Any], version: str = "3.0.3", **members: Any) -> dict[str, Any]:
    """Return an OpenAPI description of these paths."""
    return {"openapi": version, "info": {"title": "device", "version": "1"}, "paths": dict(paths), **members}


def contract_of(folder: Path, description: dict[str, Any]) -> Contract:
    """Return the contract of a description, which is written into a folder."""
    return Contract.load(write_described_pack(folder, description, description))


def answers(schema: Any, media_type: str = "application/json") -> dict[str, Any]:
    """Return a response object whose content has this schema."""
    return {"description": "ok", "content": {media_type: {"schema": schema}}}


def reading(schema: Any, **members: Any) -> dict[str, Any]:
    """Return a path item with a GET that answers 200 by this schema, or 4XX."""
    return {"get": {"responses": {"200": answers(schema), "4XX": REFUSED}, **members}}


def object_of(*required: str, **properties: Any) -> dict[str, Any]:
    """Return the schema of an object with these properties, of which some are required."""
    return {"type": "object", "properties": properties} | ({"required": list(required)} if required else {})


def body_of(schema: Any, media_type: str = "application/json") -> dict[str, Any]:
    """Return a required request body whose content has this schema."""
    return {"required": True, "content": {media_type: {"schema": schema}}}


def constant(value: Any) -> dict[str, Handle]:
    """Return the handlers of a path whose GET answers the same JSON each time."""

    async def handle(_: web.Request) -> web.Response:
        return web.json_response(value)

    return {"GET": handle}


def error(status: int, text: str, **headers: str) -> web.Response:
    """Return a JSON error, as the schema of `REFUSED` has it."""
    return web.json_response({"error": text}, status=status, headers=headers)


def _resource(methods: Mapping[str, Handle]) -> Handle:
    allow = ", ".join(sorted({*methods, "OPTIONS"} | ({"HEAD"} if "GET" in methods else set())))

    async def handle(request: web.Request) -> web.StreamResponse:
        method = "GET" if request.method == "HEAD" and "HEAD" not in methods else request.method
        if method == "OPTIONS" and method not in methods:
            return web.Response(status=204, headers={"Allow": allow})
        if method not in methods:
            return error(405 if method in _KNOWN else 501, "no such method", Allow=allow)
        try:
            unquote_to_bytes(request.rel_url.raw_query_string.replace("+", " ")).decode()
        except UnicodeDecodeError:
            return error(400, "the query is no UTF-8")
        return await methods[method](request)

    return handle


@web.middleware
async def _errors_as_json(request: web.Request, handler: Handle) -> web.StreamResponse:
    try:
        return await handler(request)
    except web.HTTPException as raised:
        return error(raised.status, raised.reason)
    except RecursionError:
        return error(400, "the JSON is nested too deeply")


def application(description: Any, routes: Mapping[str, Mapping[str, Handle]]) -> web.Application:
    """Return an application with HEAD, OPTIONS, Allow, 405 and 404; its description is at /openapi.json."""
    app = web.Application(client_max_size=1 << 22, middlewares=[_errors_as_json])
    for path, methods in {"/openapi.json": constant(description), **routes}.items():
        app.router.add_route("*", path, _resource(methods))
    return app


@contextmanager
def small_device(
    description: Any, routes: Mapping[str, Mapping[str, Handle]], tls: ssl.SSLContext | None = None
) -> Iterator[str]:
    """Serve a device in a thread; yields its base URL.

    Args:
        description: the document that GET /openapi.json answers.
        routes: for each path as aiohttp writes it, the handler of each method.
        tls: for HTTPS.
    """
    loop, started, ports = asyncio.new_event_loop(), threading.Event(), list[int]()

    async def start() -> web.AppRunner:
        runner = web.AppRunner(application(description, routes), access_log=None)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", 0, ssl_context=tls).start()
        ports.append(runner.addresses[0][1])
        return runner

    def run() -> None:
        runner = loop.run_until_complete(start())
        started.set()
        loop.run_forever()
        loop.run_until_complete(runner.cleanup())
        loop.close()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    assert started.wait(60)
    yield f"{'https' if tls else 'http'}://127.0.0.1:{ports[0]}"
    loop.call_soon_threadsafe(loop.stop)
    thread.join(10)


@dataclass(frozen=True)
class Outcome:
    """What one certification said.

    Attributes:
        exit_code: of the command.
        text: what it printed, stdout and stderr.
        result: the content of result.json; empty if there is none.
    """

    exit_code: int
    text: str
    result: dict[str, Any]

    @property
    def blamed(self) -> dict[str, str]:
        """The verdict of each requirement that failed, warned or could not be judged because of the suite."""
        verdicts = {one["id"]: one["verdict"] for one in self.result["requirements"]}
        return {id_: verdict for id_, verdict in verdicts.items() if verdict in {"fail", "warn", "error"}}

    def requirement(self, id_: str) -> dict[str, Any]:
        """Return what the result has of one requirement."""
        return next(one for one in self.result["requirements"] if one["id"] == id_)


def certified(
    target: object, out: Path, *more: object, effort: str = "quick", seed: int = 1, peak_mb: Path | None = None
) -> Outcome:
    """Certify a device by the command, in a process of its own, and assert that it printed no traceback."""
    command = (sys.executable, "-m", "roaas", "certify", target, "--effort", effort, "--seed", seed, "--out", out)
    done = ended(*command, *more, peak_mb=peak_mb)
    text = done.stdout + done.stderr
    assert not re.search(r"^Traceback", text, re.MULTILINE), text
    path = out / "result.json"
    result = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return Outcome(done.returncode, text, result)
