"""One right API, GET /state, as ASGI and WSGI apps and on servers of the standard library; `apps.py SERVER PORT`."""

import json
import sys
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from wsgiref.simple_server import make_server

from aiohttp import web
from flask import Flask, Response
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.routing import Route

SPEC = json.loads(Path(__file__).with_name("spec.json").read_text(encoding="utf-8"))
CONTENT = {"/state": {"x": 1.5}, "/openapi.json": SPEC}


async def _asgi_get(request: Request) -> JSONResponse:
    return JSONResponse(CONTENT[request.url.path])


asgi = Starlette(routes=[Route(path, _asgi_get) for path in CONTENT])

wsgi = Flask(__name__)
for path, value in CONTENT.items():
    text = json.dumps(value)
    wsgi.add_url_rule(path, path, lambda text=text: Response(text, mimetype="application/json"))


class Handler(BaseHTTPRequestHandler):
    """Answer GET and HEAD of each path, and 405 to other methods."""

    protocol_version = "HTTP/1.1"

    def handle_one_request(self) -> None:
        """Answer a request whatever its method."""
        self.raw_requestline = self.rfile.readline(65537)
        if not self.raw_requestline:
            self.close_connection = True
        elif self.parse_request():
            value = CONTENT.get(self.path.partition("?")[0])
            body = json.dumps(value).encode()
            if self.command not in {"GET", "HEAD"}:
                self._send(405, b"", ("Allow", "GET, HEAD"), ("Connection", "close"))
            elif value is None:
                self._send(404, b"")
            else:
                self._send(200, body, ("Content-Type", "application/json"))
            self.wfile.flush()

    def _send(self, status: int, body: bytes, *fields: tuple[str, str]) -> None:
        self.send_response(status)
        for name, value in (*fields, ("Content-Length", str(len(body)))):
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Log nothing."""


def _aiohttp(port: int) -> None:
    async def get(request: web.Request) -> web.Response:
        return web.json_response(CONTENT[request.path])

    app = web.Application()
    app.add_routes([web.get(path, get) for path in CONTENT])
    web.run_app(app, host="127.0.0.1", port=port, print=None)


SERVERS: dict[str, Callable[[int], object]] = {
    "aiohttp": _aiohttp,
    "werkzeug": lambda port: wsgi.run(port=port),
    "wsgiref": lambda port: make_server("127.0.0.1", port, wsgi).serve_forever(),
    "http.server": lambda port: ThreadingHTTPServer(("127.0.0.1", port), Handler).serve_forever(),
}

if __name__ == "__main__":
    SERVERS[sys.argv[1]](int(sys.argv[2]))
