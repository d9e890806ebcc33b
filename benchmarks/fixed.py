"""The baselines: servers that give the robot's responses as fixed bytes, without any work."""

import http.client
import json
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from loader import Call
from programs import HERE, started

_START = 10.0  # seconds
_NO_CONTENT = 204
_NGINX = """
daemon off;
worker_processes 1;
pid {folder}/pid;
error_log {folder}/errors;
events {{}}
http {{
  access_log off;
  keepalive_requests 1000000000;
  client_body_temp_path {folder}/body;
  proxy_temp_path {folder}/proxy;
  fastcgi_temp_path {folder}/fastcgi;
  uwsgi_temp_path {folder}/uwsgi;
  scgi_temp_path {folder}/scgi;
  server {{
    listen 127.0.0.1:{port};
    {locations}
  }}
}}
"""


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


#: A pose, for the bare application alone.
_POSE = json.dumps({"pose": {"pose": {"position": {"x": 1.0, "y": 2.0, "z": 0.0}}}, "covariance": [0.0] * 36})
POSE = Answer("/robot/pose/", 200, [("content-type", "application/json"), ("content-length", str(len(_POSE)))], _POSE)


@contextmanager
def running_bare(answers: list[Answer], *options: str) -> Iterator[tuple[int, subprocess.Popen[str]]]:
    """Run a bare uvicorn application with fixed answers; yields its port and process."""
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        file.write(json.dumps({answer.target: asdict(answer) for answer in answers}))
        file.flush()
        with started(sys.executable, HERE / "bare.py", file.name, *options) as (process, port):
            yield int(port), process


@contextmanager
def running_nginx(answers: list[Answer]) -> Iterator[int | None]:
    """Run nginx with responses of the same status and length; yields its port, or None without nginx."""
    program = shutil.which("nginx")
    if program is None:
        yield None
        return
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    locations = "\n".join(
        f"location = {answer.target} {{ return {answer.status}"
        + ("; }" if answer.status == _NO_CONTENT else f" '{'x' * len(answer.body)}'; }}")
        for answer in answers
    )
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "conf").write_text(_NGINX.format(folder=folder, port=port, locations=locations))
        command = [program, "-p", folder, "-c", str(Path(folder, "conf")), "-e", str(Path(folder, "errors"))]
        with subprocess.Popen(command) as process:
            try:
                _await(port)
                yield port
            finally:
                process.terminate()


def _await(port: int) -> None:
    give_up = time.monotonic() + _START
    while True:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=1.0)
        try:
            connection.connect()
        except OSError as error:
            if time.monotonic() > give_up:
                raise SystemExit(f"nginx does not listen on port {port}: {error}") from error
            time.sleep(0.05)
        else:
            return
        finally:
            connection.close()
