"""What the figures depend on besides the robot: machine, kernel, versions, command lines."""

from __future__ import annotations

import ipaddress
import os
import platform
import re
import shlex
import socket
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil

from loadtests.clients.endpoint import Endpoint
from loadtests.measuring.command_line import without_folders

if TYPE_CHECKING:
    from loadtests.clients.robot import Robot
    from loadtests.settings.settings import Output

_SECRET = re.compile(r"^-.*(token|password|secret|key)\b(?!-file)", re.IGNORECASE)
_PACKAGES = ("roaas", "locust", "gevent", "httptools", "zeep", "requests", "urllib3", "lxml", "numpy", "hdrhistogram")


def describe(robot: Robot, output: Output, servers: dict[str, str | None]) -> dict[str, Any]:
    """The `environment` of latency.json.

    Args:
        robot: addresses.
        output: the robot's name, vendor and version as the statement gives them, and our command line.
        servers: Server header by interface.
    """
    addresses = [address for address in (robot.rest, robot.publishers, robot.subscribers) if address]
    here = bool(addresses) and all(_is_here(Endpoint.parse(address).host) for address in addresses)
    return {
        "cpu": _cpu_model(),
        "cpus": os.cpu_count() or 1,
        "memory_mb": psutil.virtual_memory().total // 2**20,
        "kernel": platform.release(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": _versions(),
        "command": output.command,
        "robot_command": _listener(addresses[0]) if here else None,
        "robot": {
            "name": output.about.get("name"),
            "vendor": output.about.get("vendor"),
            "version": output.about.get("version"),
            "rest": robot.rest,
            "publishers": robot.publishers,
            "subscribers": robot.subscribers,
            **({"rosbridge": robot.rosbridge} if robot.rosbridge else {}),
            "servers": servers,
            "same_machine": here,
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


def _is_here(host: str) -> bool:
    """Whether a host is this machine, as far as can be told without asking anybody."""
    if host == "localhost":
        return True
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host == socket.gethostname()
    own = {entry.address.split("%")[0] for entries in psutil.net_if_addrs().values() for entry in entries}
    return address.is_loopback or host in own


def _listener(url: str) -> str | None:
    """The command line of who listens on a local port, where the system lets us see it."""
    port = Endpoint.parse(url).port
    try:
        for connection in psutil.net_connections("tcp"):
            here = connection.laddr
            if connection.status == psutil.CONN_LISTEN and here and here.port == port and connection.pid:
                words = psutil.Process(connection.pid).cmdline()
                return _shown(words) if words else None
    except (psutil.Error, OSError):
        return None
    return None


def _shown(words: list[str]) -> str:
    """A command line without what is nobody's business: the folders of this machine, and secrets."""
    found = []
    for before, word in zip(["", *words], words, strict=False):
        if _SECRET.search(before) and "=" not in before:
            found.append("***")
        elif _SECRET.search(word) and "=" in word:
            found.append(word.split("=", 1)[0] + "=***")
        else:
            found.append(without_folders(word))
    return shlex.join(found)
