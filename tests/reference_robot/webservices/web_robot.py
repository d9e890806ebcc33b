"""The real server in front of real ROS, and a robot that is not ours behind it."""

import json
import os
import queue
import socket
import ssl
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self
from urllib.parse import urlsplit

import httpx
import pytest
from click.testing import CliRunner

from reference_robot.cli import robot

_PATIENCE = 60.0  # seconds


@dataclass
class Served:
    """A running robot."""

    rest: str
    publishers: str
    process: subprocess.Popen
    client: httpx.Client

    @property
    def subscribers(self) -> str:
        return self.publishers.replace("publisher", "subscriber")

    def call(self, method: str, path: str, **named: Any) -> httpx.Response:
        return self.client.request(method, self.rest + path, **named)

    def soap(self, body: str | bytes, *, url: str | None = None, **headers: str) -> httpx.Response:
        fields = {"Content-Type": "text/xml; charset=utf-8"} | {
            name.replace("_", "-"): value for name, value in headers.items()
        }
        return self.client.post(url or self.publishers, content=body, headers=fields)

    def raw(self, octets: bytes, *, soap: bool = False) -> bytes:
        """Send octets on a connection of their own; return all that comes back until it closes or falls silent."""
        with self.connection(soap=soap) as connection:
            connection.sendall(octets)
            answer = b""
            try:
                while received := connection.recv(65536):
                    answer += received
            except (TimeoutError, ConnectionResetError):
                pass
            return answer

    def connection(self, *, soap: bool = False) -> socket.socket:
        where = urlsplit(self.publishers if soap else self.rest)
        return socket.create_connection((where.hostname, where.port), timeout=20)


class RosProcess:
    """Another process: what it has seen over ROS, and what it is to do."""

    def __init__(self, script: str, *arguments: str, **environment: str) -> None:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        command = [sys.executable, str(Path(__file__).with_name(script)), *arguments]
        self.process = subprocess.Popen(command, env=ros_environment() | environment, **pipes)
        self._events: queue.Queue[dict[str, Any]] = queue.Queue()
        self._obeyed = threading.Semaphore(0)
        threading.Thread(target=self._read, daemon=True).start()
        self.next("ready")

    def _read(self) -> None:
        for line in self.process.stdout:
            event = json.loads(line)
            if "obeyed" in event:
                self._obeyed.release()
            else:
                self._events.put(event)

    def next(self, kind: str) -> Any:
        """Return what comes next, which must be of this kind."""
        event = self._events.get(timeout=_PATIENCE)
        assert kind in event, event
        return event[kind]

    def forget(self) -> None:
        """Drop what has come so far."""
        while not self._events.empty():
            self._events.get_nowait()

    def forget_until(self, kind: str) -> None:
        """Drop what comes, up to the next event of this kind."""
        while kind not in self._events.get(timeout=_PATIENCE):
            pass

    def heard_nothing(self) -> bool:
        """Tell whether all is quiet: nothing is waiting, and nothing comes within a moment."""
        try:
            self._events.get(timeout=0.2)
        except queue.Empty:
            return True
        return False

    def do(self, **command: Any) -> None:
        """Let it obey, and wait until it has."""
        self.process.stdin.write(json.dumps(command) + "\n")
        self.process.stdin.flush()
        assert self._obeyed.acquire(timeout=_PATIENCE), command

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End it whatever the test came to: what stays on a domain is seen by the next test that takes its id."""
        self.close()

    def close(self) -> None:
        self.process.stdin.close()
        self.process.wait(_PATIENCE)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait(_PATIENCE)


class ForeignRobot(RosProcess):
    """A robot that is one node (foreign_robot.py)."""

    def __init__(self, domain_id: int, *arguments: str) -> None:
        super().__init__("foreign_robot.py", str(domain_id), *arguments)


def ros_environment() -> dict[str, str]:
    return os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def usage_error(*options: str) -> str:
    """Run the command in this process, as far as the first error; return what it says."""
    done = CliRunner().invoke(robot, ["--attach", "--rest-port=0", "--soap-port=0", *options])
    assert done.exit_code == 2, done.output
    return " ".join(done.output.split())


@contextmanager
def running_robot(domain_id: int, *options: str, verify: ssl.SSLContext | bool = True) -> Iterator[Served]:
    command = [sys.executable, "-m", "reference_robot", f"--domain-id={domain_id}", "--rest-port=0", "--soap-port=0"]
    with subprocess.Popen(
        [*command, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ros_environment()
    ) as process:
        try:
            words = process.stdout.readline().split()
            assert words, process.stderr.read()
            assert words[0] == "ready"
            told = dict(word.split("=", 1) for word in words[1:])
            with httpx.Client(timeout=_PATIENCE, verify=verify) as client:
                yield Served(told["rest"], told["soap"].removesuffix("?wsdl"), process, client)
        finally:
            process.terminate()
            process.communicate(timeout=_PATIENCE)


def problem(answer: httpx.Response, status: int) -> str:
    """Assert that a response is a problem with this status, and when to try again after a 503; return its detail."""
    assert answer.status_code == status, answer.text
    assert (answer.headers["Content-Type"], answer.json()["status"]) == ("application/problem+json", status)
    assert status != 503 or int(answer.headers["Retry-After"]) > 0
    return answer.json()["detail"]


def eventually(condition: Callable[[], Any]) -> Any:
    """Return the first true value of a condition; fail if it does not come."""
    give_up = time.monotonic() + _PATIENCE
    while time.monotonic() < give_up:
        if value := condition():
            return value
        time.sleep(0.02)
    return pytest.fail("waited in vain")
