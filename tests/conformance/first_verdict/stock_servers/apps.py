"""One right API as ASGI and WSGI apps and on servers of the standard library; `apps.py SERVER PORT`.

GET /state reads a state {"x": NUMBER}; POST /distance takes one and answers with its distance from zero.
"""

import json
import sys
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from wsgiref.simple_server import make_server

import flask
from aiohttp import web
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

SPEC = json.loads(Path(__file__).with_name("spec.json").read_text(encoding="utf-8"))
CONTENT = {"/state": json.dumps({"x": 1.5}), "/openapi.json": json.dumps(SPEC)}
_POST, _JSON, _MOST = "/distance", "application/json", 10


def distance(body: bytes, content_type: str) -> tuple[int, str]:
    """Return status and body of the response to POST /distance."""
    if content_type.partition(";")[0].strip().lower() != _JSON:
        return 415, ""
    try:
        value = json.loads(body.decode(), parse_constant=lambda _: None)
    except (ValueError, RecursionError):
        return 400, ""
    x = value.get("x") if isinstance(value, dict) and len(value) == 1 else None
    fits = isinstance(x, int | float) and not isinstance(x, bool) and -_MOST <= x <= _MOST
    return (200, json.dumps({"x": abs(x)})) if fits else (400, "")


async def _asgi_get(request: Request) -> Response:
    return Response(CONTENT[request.url.path], media_type=_JSON)


async def _asgi_post(request: Request) -> Response:
    status, text = distance(await request.body(), request.headers.get("content-type", ""))
    return Response(text, status, media_type=_JSON if text else None)


asgi = Starlette(routes=[*(Route(path, _asgi_get) for path in CONTENT), Route(_POST, _asgi_post, methods=["POST"])])

wsgi = flask.Flask(__name__)
for path, text in CONTENT.items():
    wsgi.add_url_rule(path, path, lambda text=text: flask.Response(text, mimetype=_JSON))


@wsgi.post(_POST)
def _wsgi_post() -> flask.Response:
    status, text = distance(flask.request.get_data(), flask.request.content_type or "")
    return flask.Response(text, status, mimetype=_JSON)


class Handler(BaseHTTPRequestHandler):
    """Answer GET, HEAD and POST, and 405 to other methods."""

    protocol_version = "HTTP/1.1"

    def handle_one_request(self) -> None:
        """Answer a request whatever its method."""
        self.raw_requestline = self.rfile.readline(65537)
        if not self.raw_requestline:
            self.close_connection = True
        elif self.parse_request():
            path = self.path.partition("?")[0]
            allowed = "GET, HEAD" if path in CONTENT else "POST" if path == _POST else ""
            if not allowed:
                self._send(404, "")
            elif self.command not in allowed.split(", "):
                self._send(405, "", ("Allow", allowed), ("Connection", "close"))
            elif self.command == "POST":
                self._post()
            else:
                self._send(200, CONTENT[path])
            self.wfile.flush()

    def _post(self) -> None:
        if "Transfer-Encoding" in self.headers:
            self._send(411, "", ("Connection", "close"))
        else:
            body = self.rfile.read(int(self.headers.get("Content-Length", "0")))
            self._send(*distance(body, self.headers.get("Content-Type", "")))

    def _send(self, status: int, text: str, *fields: tuple[str, str]) -> None:
        self.send_response(status)
        typed = (("Content-Type", _JSON),) if text else ()
        for name, value in (*fields, *typed, ("Content-Length", str(len(text)))):
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(text.encode())

    def log_message(self, *_: object) -> None:
        """Log nothing."""


def _aiohttp(port: int) -> None:
    async def get(request: web.Request) -> web.Response:
        return web.json_response(text=CONTENT[request.path])

    async def post(request: web.Request) -> web.Response:
        status, text = distance(await request.read(), request.headers.get("Content-Type", ""))
        return web.Response(text=text, status=status, content_type=_JSON)

    app = web.Application()
    app.add_routes([*(web.get(path, get) for path in CONTENT), web.post(_POST, post)])
    web.run_app(app, host="127.0.0.1", port=port, print=None)


SERVERS: dict[str, Callable[[int], object]] = {
    "aiohttp": _aiohttp,
    "werkzeug": lambda port: wsgi.run(port=port),
    "wsgiref": lambda port: make_server("127.0.0.1", port, wsgi).serve_forever(),
    "http.server": lambda port: ThreadingHTTPServer(("127.0.0.1", port), Handler).serve_forever(),
}

if __name__ == "__main__":
    SERVERS[sys.argv[1]](int(sys.argv[2]))
