"""The process that listens at the robot's address, if it is on this machine: its command line and processor time.

The robot's other processes, such as a simulation behind its web services, are not included.
"""

import ipaddress
import re
import shlex
import socket
import time
from dataclasses import dataclass
from typing import Self

import psutil

from conformance.commandline.without_folders import without_folders
from loadtests.clients.endpoint import Endpoint
from loadtests.clients.robot import Robot

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
                    return cls(process, _shown(process.cmdline()), _cpu_s(process), time.monotonic())
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


def _shown(words: list[str]) -> str:
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
