"""Programs that the benchmarks start, measurements of a process, and the lines that the benchmarks print.

As a program, this module is the baseline: ``python programs.py ANSWERS.json`` serves a robot's responses as fixed bytes
with a bare uvicorn ASGI application, and prints its port.
"""

import contextlib
import http.client
import json
import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import uvicorn
from loader import Call

HERE = Path(__file__).parent


@contextmanager
def started(*command: Any, **options: Any) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run a program until the block ends; yields its process and the first line that it prints."""
    with subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, text=True, **options) as process:
        try:
            assert process.stdout is not None  # noqa: S101 - tells mypy what PIPE means
            yield process, process.stdout.readline().strip()
        finally:
            process.terminate()


@dataclass(frozen=True)
class Robot:
    """A running reference robot: its REST and SOAP addresses, and its processes."""

    rest: Call
    soap: Call
    pids: tuple[int, ...]


@contextmanager
def running_robot(*options: str, **popen: Any) -> Iterator[Robot]:
    """Run the reference robot on free ports."""
    command = [sys.executable, "-m", "reference_robot", "--rest-port=0", "--soap-port=0", *options]
    with started(*command, **popen) as (process, line):
        words = dict(word.split("=", 1) for word in line.split()[1:])
        rest, soap = urlsplit(words["rest"]), urlsplit(words["soap"])
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        yield Robot(
            Call(rest.hostname, rest.port, "GET", "/"),
            Call(soap.hostname, soap.port, "POST", soap.path),
            (process.pid, *map(int, children)),
        )


@dataclass(frozen=True)
class Answer:
    """A response without its Date, which each server adds by itself."""

    target: str
    status: int
    headers: list[tuple[str, str]]
    body: str


def answers_to(calls: list[Call]) -> list[Answer]:
    """Return the robot's response to each call."""
    answers = []
    for call in calls:
        connection = http.client.HTTPConnection(call.host, call.port)
        connection.request(call.method, call.target, call.body or None, {"Content-Type": call.content_type})
        answer = connection.getresponse()
        headers = [pair for pair in answer.getheaders() if pair[0].lower() != "date"]
        answers.append(Answer(call.target, answer.status, headers, answer.read().decode()))
        connection.close()
    return answers


@contextmanager
def running_bare(answers: list[Answer]) -> Iterator[tuple[int, subprocess.Popen[str]]]:
    """Run the bare application with fixed answers; yields its port and process."""
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        file.write(json.dumps({answer.target: asdict(answer) for answer in answers}))
        file.flush()
        with started(sys.executable, __file__, file.name) as (process, port):
            yield int(port), process


def bare_application(answers: dict[str, Any]) -> Any:
    """Return an ASGI application that looks up the path and sends the fixed response."""
    messages = {
        path: (
            {
                "type": "http.response.start",
                "status": answer["status"],
                "headers": [(name.encode(), value.encode()) for name, value in answer["headers"]],
            },
            {"type": "http.response.body", "body": answer["body"].encode()},
        )
        for path, answer in answers.items()
    }

    async def bare(scope: Any, _receive: Any, send: Any) -> None:
        start, body = messages[scope["path"]]
        await send(start)
        await send(body)

    return bare


def serve(path: str) -> None:
    """Serve the answers in a file until killed."""
    listener = socket.create_server(("127.0.0.1", 0))
    print(listener.getsockname()[1], flush=True)
    config = uvicorn.Config(
        bare_application(json.loads(Path(path).read_text())),
        loop="uvloop",
        http="httptools",
        ws="none",
        lifespan="off",
        interface="asgi3",
        access_log=False,
        log_config=None,
        server_header=False,
    )
    with contextlib.suppress(KeyboardInterrupt):
        uvicorn.Server(config).run(sockets=[listener])


def roaas_load(*options: Any) -> dict[str, Any]:
    """Run `roaas load` with the wire client; returns its latency.json."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", "from loadtests.cli import load; load()", "--client", "wire", "--out", folder]
        done = subprocess.run([*command, *map(str, options)], check=False, capture_output=True, text=True)
        file = Path(folder) / "latency.json"
        if not file.exists():
            raise RuntimeError(done.stderr)
        found: dict[str, Any] = json.loads(file.read_text())
    return found


def report(text: str, *, met: bool) -> bool:
    """Print one line of the result."""
    print(f"{'ok    ' if met else 'MISSED'} {text}", flush=True)
    return met


def machine() -> str:
    """Return a text on the load of the machine, for the beginning or the end of a result."""
    return f"{os.cpu_count()} processors, load average {os.getloadavg()[0]:.1f}"


@dataclass
class Footprint:
    """A process's resident memory in MB (with shared pages), and processor time in s."""

    megabytes: float
    processor: float

    @classmethod
    def of(cls, pid: int) -> "Footprint":
        """Return the footprint of a process, as Linux reports it."""
        proc = Path(f"/proc/{pid}")
        pages = int((proc / "statm").read_text().split()[1])
        fields = (proc / "stat").read_text().rpartition(")")[2].split()
        return cls(
            pages * os.sysconf("SC_PAGE_SIZE") / 1e6, (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        )


if __name__ == "__main__":
    serve(sys.argv[1])
