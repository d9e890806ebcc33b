"""Start stock web servers with one right API; as a command, certify it on each that is installed.

`python tests/conformance/first_verdict/serving.py` prints a Markdown table: servers, verdicts, and rules not met.
It takes waitress, cheroot and others from the environment, Express and Fastify from NODE_PATH, Go from PATH.
"""

import contextlib
import itertools
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2]))
from processes import free_port
from serving_apps import behind_nginx

FOLDER = Path(__file__).with_name("stock_servers")
_PYTHON = (sys.executable, "-m")
_GUNICORN = (*_PYTHON, "gunicorn", "--no-control-socket", "-b", "127.0.0.1:{port}", "apps:wsgi")
_UVICORN = (*_PYTHON, "uvicorn", "--log-level", "critical", "--port", "{port}", "apps:asgi")
#: The command of each server, with {port}.
COMMANDS: dict[str, tuple[str, ...]] = {
    "uvicorn, h11": (*_UVICORN, "--http", "h11"),
    "uvicorn, httptools": (*_UVICORN, "--http", "httptools"),
    "uvicorn, no Server field": (*_UVICORN, "--no-server-header"),
    "hypercorn": (*_PYTHON, "hypercorn", "-b", "127.0.0.1:{port}", "apps:asgi"),
    "gunicorn, sync": _GUNICORN,
    "gunicorn, gthread": (*_GUNICORN, "-k", "gthread", "--threads", "4"),
    "Werkzeug": (sys.executable, "apps.py", "werkzeug", "{port}"),
    "aiohttp": (sys.executable, "apps.py", "aiohttp", "{port}"),
    "http.server": (sys.executable, "apps.py", "http.server", "{port}"),
    "wsgiref": (sys.executable, "apps.py", "wsgiref", "{port}"),
    "waitress": (*_PYTHON, "waitress", "--listen", "127.0.0.1:{port}", "apps:wsgi"),
    "cheroot": (*_PYTHON, "cheroot", "--bind", "127.0.0.1:{port}", "apps:wsgi"),
    "daphne": (*_PYTHON, "daphne", "-b", "127.0.0.1", "-p", "{port}", "apps:asgi"),
    "granian": (*_PYTHON, "granian", "--interface", "asgi", "--port", "{port}", "apps:asgi"),
    "Node http": ("node", "server.js", "http", "{port}"),
    "Express": ("node", "server.js", "express", "{port}"),
    "Fastify": ("node", "server.js", "fastify", "{port}"),
    "Go net/http": ("go", "run", "server.go", "{port}"),
}
#: Those that stand behind nginx as well.
BEHIND = ("uvicorn, h11", "gunicorn, sync", "http.server")
_BEHIND = "nginx before "
#: Lets a run send POST /distance, which changes nothing.
CALL = ("--call", "POST /distance")
_EFFORTS, _SEEDS = ("quick", "standard"), (1, 2, 3)
_LISTENS_S = 60.0


@contextlib.contextmanager
def serving(server: str, *more: str) -> Iterator[str]:
    """Start a server with more options, or "nginx before SERVER"; yields its base URL.

    Raises:
        OSError: it is not installed, or does not listen.
    """
    if server.startswith(_BEHIND):
        with serving(server.removeprefix(_BEHIND)) as upstream, tempfile.TemporaryDirectory() as folder:
            place = f"location / {{ proxy_pass {upstream}; proxy_set_header Host $http_host; }}"
            with behind_nginx(upstream, "", Path(folder), place) as url:
                yield url
        return
    port = free_port()
    command = [word.format(port=port) for word in (*COMMANDS[server], *more)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, cwd=FOLDER, start_new_session=True, **quiet) as process:
        try:
            until = time.monotonic() + _LISTENS_S
            while not _listens(port):
                if process.poll() is not None or time.monotonic() > until:
                    raise OSError(f"{server} does not listen")
                time.sleep(0.02)
            yield f"http://127.0.0.1:{port}"
        finally:
            # `go run` ends without the program that it started.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM)


def _listens(port: int) -> bool:
    with socket.socket() as link:
        return link.connect_ex(("127.0.0.1", port)) == 0


def _row(server: str, out: Path) -> str:
    """Certify the API on a server at each effort with each seed; return the row of the table."""
    verdicts, blamed, not_met = dict[str, list[str]](), set[str](), set[str]()
    with serving(server) as url:
        for effort, seed in itertools.product(_EFFORTS, _SEEDS):
            command = [sys.executable, "-m", "roaas", "certify", f"{url}/openapi.json", "--out", str(out), "-q", *CALL]
            done = subprocess.run([*command, "--effort", effort, "--seed", str(seed)], check=False, capture_output=True)
            result = json.loads((out / "result.json").read_text(encoding="utf-8"))
            verdicts.setdefault(effort, []).append(str(done.returncode))
            blamed |= _failed(result["requirements"])
            not_met |= _failed(result["web_server"]["requirements"])
            server_field = result["web_server"]["server"]
    exits = " / ".join(" ".join(codes) for codes in verdicts.values())
    cells = (server, server_field or "none", exits, ", ".join(sorted(blamed)) or "none", ", ".join(sorted(not_met)))
    return f"| {' | '.join(cells)} |"


def _failed(requirements: list[dict[str, str]]) -> set[str]:
    """Return the requirements that are not met; those of the class web-server without the name of the class."""
    return {
        f"{one['id'].removeprefix('web-server/')}{' (SHOULD)' if one['verdict'] == 'warn' else ''}"
        for one in requirements
        if one["verdict"] in {"fail", "warn", "error"}
    }


if __name__ == "__main__":
    sys.stdout.write(
        "| server | Server field | exit codes at quick / standard, seeds 1 2 3 | not met in other classes "
        "| web-server rules not met |\n|---|---|---|---|---|\n"
    )
    for name in (*COMMANDS, *(f"{_BEHIND}{one}" for one in BEHIND)):
        with tempfile.TemporaryDirectory() as folder:
            try:
                row = _row(name, Path(folder))
            except OSError:
                row = f"| {name} | not installed | | | |"
        sys.stdout.write(f"{row}\n")
        sys.stdout.flush()
