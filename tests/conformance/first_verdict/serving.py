"""Start stock web servers with one right API; as a command, certify it on each that is installed.

`python tests/conformance/first_verdict/serving.py` prints a Markdown table: servers, verdicts, and rules not met.
It takes waitress, cheroot and others from the environment, Express and Fastify from NODE_PATH, Go from PATH.
"""

import contextlib
import json
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

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
_LISTENS_S = 30.0


@contextlib.contextmanager
def serving(server: str) -> Iterator[str]:
    """Start a server; yields its base URL.

    Raises:
        OSError: it is not installed, or does not listen.
    """
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [word.format(port=port) for word in COMMANDS[server]]
    with subprocess.Popen(command, cwd=FOLDER, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            until = time.monotonic() + _LISTENS_S
            while not _listens(port):
                if process.poll() is not None or time.monotonic() > until:
                    raise OSError(f"{server} does not listen")
                time.sleep(0.02)
            yield f"http://127.0.0.1:{port}"
        finally:
            process.terminate()


def _listens(port: int) -> bool:
    with socket.socket() as link:
        return link.connect_ex(("127.0.0.1", port)) == 0


def _row(server: str, out: Path) -> str:
    verdicts, not_met = set[str](), set[str]()
    with serving(server) as url:
        for effort in ("quick", "standard"):
            for seed in range(1, 4):
                command = [sys.executable, "-m", "roaas", "certify", f"{url}/openapi.json", "--out", str(out), "-q"]
                subprocess.run([*command, "--effort", effort, "--seed", str(seed)], check=False, capture_output=True)
                result = json.loads((out / "result.json").read_text(encoding="utf-8"))
                verdicts.add(result["verdict_line"])
                beside = result["web_server"]["requirements"]
                not_met |= {f"`{one['id']}` ({one['level']})" for one in beside if one["verdict"] in {"fail", "warn"}}
    return f"| {server} | {'; '.join(sorted(verdicts))} | {', '.join(sorted(not_met)) or 'none'} |"


if __name__ == "__main__":
    sys.stdout.write("| server | verdicts, quick and standard, three seeds each | rules not met |\n|---|---|---|\n")
    for name in COMMANDS:
        with contextlib.suppress(OSError), tempfile.TemporaryDirectory() as folder:
            sys.stdout.write(f"{_row(name, Path(folder))}\n")
