"""A robot on aiohttp, whose parser responds to malformed requests with its own error pages."""

import asyncio
import threading
from collections.abc import Awaitable, Callable

from aiohttp import web

from proof.table1.independent_robots.plain.rest import Handler
from proof.table1.independent_robots.plain.server import Answer
from proof.table1.independent_robots.routing import MAX_BODY, bound, call, message, problem, resources

_View = Callable[[web.Request], Awaitable[web.StreamResponse]]


def serve(rest_port: int, _soap_port: int) -> tuple[str, str, Callable[[], None]]:
    """Start the robot. Return REST's base URL, an empty WSDL address, and a function that stops the robot."""
    sock, rest = bound(rest_port)
    runner = web.AppRunner(_application(), access_log=None)
    loop = asyncio.new_event_loop()

    async def start() -> None:
        await runner.setup()
        await web.SockSite(runner, sock).start()

    loop.run_until_complete(start())
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()

    def stop() -> None:
        asyncio.run_coroutine_threadsafe(runner.cleanup(), loop).result()
        loop.call_soon_threadsafe(loop.stop)
        thread.join()

    return rest, "", stop


def _application() -> web.Application:
    application = web.Application(client_max_size=MAX_BODY, middlewares=[_problems])
    for path, methods in resources().items():
        route = application.router.add_resource(path)
        for method, handler in methods.items():
            route.add_route(method, _view(handler))
        if "GET" in methods:
            route.add_route("HEAD", _view(methods["GET"]))
        route.add_route("OPTIONS", _options(", ".join([*methods, *(["HEAD"] if "GET" in methods else []), "OPTIONS"])))
    return application


def _view(handler: Handler) -> _View:
    async def view(request: web.Request) -> web.StreamResponse:
        body = await request.read()
        return _response(call(handler, message(request.headers.items()), body, request.rel_url.raw_path_qs))

    return view


def _options(allowed: str) -> _View:
    async def view(_request: web.Request) -> web.StreamResponse:
        return web.Response(status=204, headers={"Allow": allowed})

    return view


@web.middleware
async def _problems(request: web.Request, handler: _View) -> web.StreamResponse:
    """Turn aiohttp's own errors into problems, and reject several Host fields, which aiohttp accepts (RFC 9112 3.2)."""
    headers = message(request.headers.items())
    if len(request.headers.getall("Host", [])) != 1:
        return _response(problem(400, "Host is not there once", headers))
    try:
        return await handler(request)
    except web.HTTPError as error:
        answer = problem(error.status, error.text, headers)
        if "Allow" in error.headers:
            answer.fields["Allow"] = error.headers["Allow"]
        return _response(answer)


def _response(answer: Answer) -> web.Response:
    fields = answer.fields | ({"Content-Type": answer.media_type} if answer.media_type else {})
    return web.Response(body=answer.body or None, status=answer.status, headers=fields)
