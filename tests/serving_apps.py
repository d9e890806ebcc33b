"""Serve ASGI and WSGI apps on loopback, alone or behind nginx, with a server that keeps HTTP to the letter."""

import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.responses import JSONResponse
from starlette.routing import BaseRoute, Route


@contextmanager
def serving_app(app: Any, **settings: Any) -> Iterator[str]:
    """Serve an app with uvicorn on h11, which refuses a request without Host; yields the base URL."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        app = _to_the_letter(app)
        config = uvicorn.Config(app, http="h11", log_level="critical", timeout_graceful_shutdown=1, **settings)
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
        thread.start()
        while not server.started:
            time.sleep(0.01)
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        server.should_exit = True
        thread.join(10)


def _to_the_letter(app: Any) -> Any:
    """Return an app that does what uvicorn does not: absolute targets, closing at two lengths (RFC 9112 3.2.2, 6.1)."""

    async def wrapped(scope: Any, receive: Any, send: Any) -> None:
        async def closing(message: Any) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", ()), (b"connection", b"close")]}
            await send(message)

        if scope["type"] == "http" and scope["path"].startswith("http://"):
            path = urlsplit(scope["path"]).path or "/"
            scope = {**scope, "path": path, "raw_path": path.encode()}
        both = {b"content-length", b"transfer-encoding"} <= {name for name, _ in scope.get("headers", ())}
        await app(scope, receive, closing if both else send)

    return wrapped


@contextmanager
def behind_nginx(upstream: str, prefix: str, folder: Path) -> Iterator[str]:
    """Serve an upstream server below a path; yields the base URL without that path."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    names = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    temporary = "".join(f"{name}_temp_path {folder}/{name};" for name in names)
    place = f"location {prefix}/ {{ proxy_pass {upstream}/; proxy_set_header Host $http_host; }}"
    (folder / "nginx.conf").write_text(
        f"daemon off; pid {folder}/pid; error_log {folder}/log; events {{}}\n"
        f"http {{ access_log off; {temporary} server {{ listen 127.0.0.1:{port}; {place} }} }}"
    )
    command = ["nginx", "-c", f"{folder}/nginx.conf", "-e", f"{folder}/log"]
    with subprocess.Popen(command) as process:
        for _ in range(500):
            if process.poll() is not None or _listens(port):
                break
            time.sleep(0.01)
        yield f"http://127.0.0.1:{port}"
        process.terminate()


def _listens(port: int) -> bool:
    with socket.socket() as link:
        return link.connect_ex(("127.0.0.1", port)) == 0


def described_app(document: dict[str, Any], routes: list[BaseRoute], **settings: Any) -> Starlette:
    """Return an app that serves its description at /openapi.json."""
    return Starlette(routes=[Route("/openapi.json", lambda _: JSONResponse(document)), *routes], **settings)


def description(paths: dict[str, Any], version: str = "3.1.0", **more: Any) -> dict[str, Any]:
    """Return an OpenAPI description."""
    return {"openapi": version, "info": {"title": "A device", "version": "1"}, "paths": paths, **more}


def responses(schema: Any = None, media_type: str = "application/json", **more: Any) -> dict[str, Any]:
    """Return responses with a declared 200 and further statuses of the form _404={...}."""
    well = {"description": "", **({"content": {media_type: {"schema": schema}}} if schema is not None else {})}
    return {"200": well, **{key[1:]: value for key, value in more.items()}}
