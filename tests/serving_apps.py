"""Serve ASGI and WSGI apps on loopback, alone or behind nginx."""

import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import uvicorn
from processes import free_port
from starlette.applications import Starlette
from starlette.responses import JSONResponse
from starlette.routing import BaseRoute, Route


@contextmanager
def serving_app(app: Any, **settings: Any) -> Iterator[str]:
    """Serve an app with uvicorn on h11; yields the base URL."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        config = uvicorn.Config(app, http="h11", log_level="critical", timeout_graceful_shutdown=1, **settings)
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
        thread.start()
        while not server.started:
            time.sleep(0.01)
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        server.should_exit = True
        thread.join(10)


@contextmanager
def behind_nginx(upstream: str, prefix: str, folder: Path, place: str = "") -> Iterator[str]:
    """Serve an upstream server below a path, or by another location block; yields the base URL without that path."""
    port = free_port()
    names = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    temporary = "".join(f"{name}_temp_path {folder}/{name};" for name in names)
    place = place or f"location {prefix}/ {{ proxy_pass {upstream}/; proxy_set_header Host $http_host; }}"
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
