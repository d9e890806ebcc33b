"""Conditions of a measurement besides the robot; and the robot's process, if it is on this machine.

The process has a command line and processor time, and can be restarted. Other processes of the robot, such as a
simulation behind its web services, are not included.
"""

import ipaddress
import os
import platform
import re
import shlex
import socket
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Self

import gevent
import psutil

from conformance.commandline.out_folder import without_folders
from loadtests.clients.endpoint import Endpoint
from loadtests.clients.robot import Robot
from loadtests.measuring.errors import GeneratorError
from loadtests.measuring.preflight import Findings
from loadtests.settings.settings import Output
from loadtests.statistics.figures import rounded

_SECRET = re.compile(r"^-.*(token|password|secret|key)\b(?!-file)", re.IGNORECASE)


@dataclass(frozen=True)
class RobotProcess:
    """The process that listens at the robot's address.

    Attributes:
        command: its command line, without this machine's folders and without secrets.
        cpu_s: the processor time that it had used at `at_s`, a moment of the monotonic clock.
    """

    process: psutil.Process
    command: str
    cpu_s: float
    at_s: float

    @classmethod
    def find(cls, robot: Robot) -> Self | None:
        """Find the robot's process; return None if the robot is on another machine, or permission is missing."""
        if not same_machine(robot):
            return None
        port = Endpoint.parse(robot.addresses[0]).port
        try:
            for connection in psutil.net_connections("tcp"):
                here = connection.laddr
                if connection.status == psutil.CONN_LISTEN and here and here.port == port and connection.pid:
                    process = psutil.Process(connection.pid)
                    return cls(process, _masked_command(process.cmdline()), _cpu_s(process), time.monotonic())
        except (psutil.Error, OSError):
            return None
        return None

    def cpu_share(self) -> float | None:
        """Return the share of one processor that the process has used since it was found; None if it has ended."""
        try:
            if not self.process.is_running():
                return None
            return (_cpu_s(self.process) - self.cpu_s) / max(time.monotonic() - self.at_s, 1e-9)
        except psutil.Error:
            return None


def _cpu_s(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def same_machine(robot: Robot) -> bool:
    """Return whether all of a robot's addresses are this machine's, as far as can be known without DNS."""
    return bool(robot.addresses) and all(is_here(Endpoint.parse(address).host) for address in robot.addresses)


def is_here(host: str) -> bool:
    """Return whether a host is this machine, as far as can be known without DNS."""
    if host == "localhost":
        return True
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host == socket.gethostname()
    own = {entry.address.split("%")[0] for entries in psutil.net_if_addrs().values() for entry in entries}
    return address.is_loopback or host in own


def _masked_command(words: list[str]) -> str:
    """Return a command line without secrets and without this machine's folders."""
    found = []
    for before, word in zip(["", *words], words, strict=False):
        if _SECRET.search(before) and "=" not in before:
            found.append("***")
        elif _SECRET.search(word) and "=" in word:
            found.append(word.split("=", 1)[0] + "=***")
        else:
            found.append(without_folders(word))
    return shlex.join(found)


_COMMAND_S = 60.0
_READY_S = 60.0
_LOOK_S = 0.2
_SHOWN = 300


def start_anew(command: str, look: Callable[[], Findings], stopped: Callable[[], bool]) -> None:
    """Run the restart command, and wait until everything that `look` calls responds.

    Raises:
        GeneratorError: the robot did not come back; the message says why.
    """
    _run(command)
    _until_ready(look, stopped)


def _run(command: str) -> None:
    """Run a command without a shell, and wait until it ends."""
    words = shlex.split(command)
    try:
        done = subprocess.run(  # noqa: S603 -- the user's own command, given for this
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=_COMMAND_S,
            check=False,
        )
    except OSError as error:
        raise GeneratorError(f"--restart-command {command!r}: {error.strerror or error}") from None
    except subprocess.TimeoutExpired:
        raise GeneratorError(
            f"--restart-command {command!r} did not end within {_COMMAND_S:g} s: it must leave the robot running "
            "in the background"
        ) from None
    if done.returncode:
        told = done.stderr.decode("utf-8", "replace").strip()[-_SHOWN:]
        raise GeneratorError(f"--restart-command {command!r} ended with exit code {done.returncode}: {told}")


def _until_ready(look: Callable[[], Findings], stopped: Callable[[], bool]) -> None:
    """Repeat the calls before a run until all succeed, or `stopped` returns True."""
    deadline = time.monotonic() + _READY_S
    while True:
        findings = look()
        if not findings.failures or stopped():
            return
        if time.monotonic() > deadline:
            raise GeneratorError(
                f"the robot did not come back within {_READY_S:g} s of its restart: {'; '.join(findings.messages())}"
            )
        gevent.sleep(_LOOK_S)


_PACKAGES = ("roaas", "locust", "gevent", "httptools", "zeep", "requests", "urllib3", "lxml", "numpy", "hdrhistogram")


def describe(
    robot: Robot, output: Output, servers: dict[str, str | None], process: RobotProcess | None
) -> dict[str, Any]:
    """Return the `environment` of latency.json.

    Args:
        robot: addresses.
        output: the robot's name, vendor and version as the statement gives them, and our command line.
        servers: Server header by interface.
        process: the process at the robot's address, where that is known.
    """
    return {
        "cpu": _cpu_model(),
        "cpus": os.cpu_count() or 1,
        "memory_mb": psutil.virtual_memory().total // 2**20,
        "kernel": platform.release(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": _versions(),
        "command": output.command,
        "robot_command": process.command or None if process is not None else None,
        "robot_cpu_share": rounded(process.cpu_share()) if process is not None else None,
        "robot": {
            "name": output.about.get("name"),
            "vendor": output.about.get("vendor"),
            "version": output.about.get("version"),
            **robot.addresses_by_name,
            **({"rosbridge": robot.rosbridge} if robot.rosbridge else {}),
            "servers": servers,
            "same_machine": same_machine(robot),
        },
    }


def _versions() -> dict[str, str]:
    found = {}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def _cpu_model() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
