"""A robot on Starlette behind hypercorn: h11's error pages, and Starlette's redirects for missing slashes."""

import asyncio
import threading
from collections.abc import Awaitable, Callable
from typing import Any
from urllib.parse import unquote_to_bytes, urlsplit

from hypercorn.asyncio import serve as serve_asgi
from hypercorn.config import Config
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from proof.table1.independent_robots.plain.rest import Handler
from proof.table1.independent_robots.plain.server import Answer
from proof.table1.independent_robots.routing import MAX_BODY, bound, call, message, problem, resources

_View = Callable[[Request], Awaitable[Response]]


def serve(rest_port: int, _soap_port: int) -> tuple[str, str, Callable[[], None]]:
    """Start the robot. Return REST's base URL, an empty WSDL address, and a function that stops the robot."""
    sock, rest = bound(rest_port)
    config = Config()
    config.bind = [f"fd://{sock.detach()}"]
    config.loglevel = "CRITICAL"
    ended = asyncio.Event()
    loop = asyncio.new_event_loop()
    application: Any = _OriginForm(_application())  # hypercorn's own words for ASGI's types are others than Starlette's

    def run() -> None:
        loop.run_until_complete(serve_asgi(application, config, shutdown_trigger=ended.wait))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()

    def stop() -> None:
        loop.call_soon_threadsafe(ended.set)
        thread.join(5)

    return rest, "", stop


class _OriginForm:
    """Takes targets in absolute form, which every server has to (RFC 9112 3.2.2) and hypercorn leaves to its robot."""

    def __init__(self, application: Any) -> None:
        self._application = application

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "http" and not scope["raw_path"].startswith(b"/"):
            path = urlsplit(scope["raw_path"]).path or b"/"
            scope = scope | {"raw_path": path, "path": unquote_to_bytes(path).decode()}
        await self._application(scope, receive, send)


def _application() -> Starlette:
    routes = []
    for path, methods in resources().items():
        allowed = [*methods, *(["HEAD"] if "GET" in methods else []), "OPTIONS"]
        routes.append(Route(path, _view(methods, ", ".join(allowed)), methods=allowed))
    return Starlette(routes=routes, exception_handlers={HTTPException: _refuse})


def _view(methods: dict[str, Handler], allowed: str) -> _View:
    async def view(request: Request) -> Response:
        if request.method == "OPTIONS":
            return Response(status_code=204, headers={"Allow": allowed})
        pieces, size = [], 0
        async for piece in request.stream():
            pieces.append(piece)
            size += len(piece)
            if size > MAX_BODY:
                raise HTTPException(413, f"more than {MAX_BODY} octets")
        target = f"{request.scope['raw_path'].decode()}?{request.url.query}"
        handler = methods["GET" if request.method == "HEAD" else request.method]
        return _response(call(handler, message(request.headers.items()), b"".join(pieces), target))

    return view


async def _refuse(request: Request, error: Exception) -> Response:
    """Turn Starlette's own errors into problems, and keep their header fields."""
    if not isinstance(error, HTTPException):
        raise error
    answer = problem(error.status_code, error.detail, message(request.headers.items()))
    answer.fields |= error.headers or {}
    return _response(answer)


def _response(answer: Answer) -> Response:
    fields = answer.fields | ({"Content-Type": answer.media_type} if answer.media_type else {})
    return Response(answer.body, answer.status, fields)
