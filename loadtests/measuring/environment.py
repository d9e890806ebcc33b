"""What the figures depend on besides the robot: machine, kernel, versions, command lines."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import psutil

from loadtests.clients.robot import Robot
from loadtests.measuring.robot_process import RobotProcess, same_machine
from loadtests.settings.settings import Output
from loadtests.statistics.figures import rounded

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
            **robot.shown,
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
