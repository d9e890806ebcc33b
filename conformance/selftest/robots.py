"""The good robots of a self-test: started as processes of their own, and stopped again."""

import contextlib
import os
import re
import selectors
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import IO

from conformance.selftest.servers.programs import built, check_installed, program

_HERE = Path(__file__).parent
_PACK = _HERE.parent / "packs" / "table1"
_READY = re.compile(r"ready rest=(\S+) soap=(\S*)")
_START_S, _STOP_S = 90.0, 10.0
# Ids up to 101 leave DDS's ports below Linux's ephemeral range.
_DOMAINS = 102
INDEPENDENT_ROBOTS = ("plain", "baroque", "legacy")
# Those whose web server answers much by itself; of most there are fewer resources.
_FRAMEWORKS = {"flask": ("flask", "gunicorn"), "aiohttp": ("aiohttp",), "hypercorn": ("hypercorn", "starlette")}
ON_SERVERS = ("node", "golang", *_FRAMEWORKS)
REFERENCE = "reference"
#: The reference robot with odometry, wheels and delays like those of a real one; each seed is another robot.
REALISTIC = "realistic"
ON_ROS = (REFERENCE, REALISTIC)


class RobotError(Exception):
    """A robot that does not start; the message says what to do."""


@dataclass(frozen=True)
class Robot:
    """A robot that runs.

    Attributes:
        kind: "reference", "realistic" or an independent robot's name.
        rest: REST's base URL.
        soap: the publishers' WSDL, or empty.
        domain_id: its ROS domain, or None.
    """

    kind: str
    rest: str
    soap: str
    domain_id: int | None = None


def statement_of(kind: str) -> Path:
    """The implementation conformance statement of a robot."""
    if kind == REALISTIC:
        return _HERE.parents[1] / "reference_robot" / "realistic.toml"
    return _HERE / "reference.toml" if kind == REFERENCE else _PACK / "independent_robots" / kind / f"{kind}.toml"


def check_available(kind: str) -> None:
    """See whether a robot can be started here.

    Raises:
        RobotError: it cannot.
    """
    if kind in ON_ROS and find_spec("rclpy") is None:
        raise RobotError(
            "the reference robot needs ROS 2 (pip install 'roaas[robot,ros]', or source /opt/ros/jazzy/setup.bash); "
            "without it, take an independent robot in its place: roaas selftest --target baroque"
        )


@contextlib.contextmanager
def running(kind: str, domain_id: int = 0, seed: int = 0, fault: str = "") -> Iterator[Robot]:
    """Start a robot on free ports, and stop it in the end.

    Args:
        kind: "reference", "realistic" or an independent robot's name.
        domain_id: first ROS domain to try for a robot on ROS.
        seed: which realistic robot.
        fault: which fault in the body of the robot "baroque".

    Raises:
        RobotError: it does not start.
        NotInstalledError: what it runs on is not there.
    """
    check_available(kind)
    if kind in ON_ROS:
        with _own_domain(domain_id) as own, _started(kind, own, _command(kind, own, seed)) as robot:
            yield robot
    else:
        faulty = ["--fault", fault] if fault else []
        with _started(kind, None, [*_command(kind, domain_id, seed), *faulty]) as robot:
            yield robot


@contextlib.contextmanager
def _own_domain(first: int) -> Iterator[int]:
    """A ROS domain that no other run on this machine holds, from ``first`` on.

    Raises:
        RobotError: all are taken.
    """
    # Only where there is ROS, and so never on Windows, which lacks it.
    import fcntl  # noqa: PLC0415

    for domain in range(first, _DOMAINS):
        with Path(tempfile.gettempdir(), f"roaas-domain-{domain}.lock").open("w", encoding="utf-8") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            yield domain
            return
    raise RobotError(f"all ROS domains from {first} to {_DOMAINS - 1} are taken; --domain-id names another first one")


@contextlib.contextmanager
def _started(kind: str, domain_id: int | None, command: list[str]) -> Iterator[Robot]:
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    # The command is this interpreter with arguments made above.
    process = subprocess.Popen(  # noqa: S603
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment
    )
    try:
        rest, soap = _ready(process, kind)
        yield Robot(kind, rest, soap, domain_id)
    finally:
        process.terminate()
        try:
            process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout is not None:
            process.stdout.close()


def _command(kind: str, domain_id: int, seed: int) -> list[str]:
    """What starts a robot on free ports.

    Raises:
        NotInstalledError: what it runs on is not there.
    """
    ports = ["--rest-port", "0", "--soap-port", "0"]
    if kind in ON_ROS:
        realistic = ["--realistic", "--seed", str(seed)] if kind == REALISTIC else []
        return [sys.executable, "-m", "roaas", "robot", *ports, "--domain-id", str(domain_id), *realistic]
    folder = _PACK / "independent_robots" / kind
    if kind == "node":
        return [program("node", "nodejs"), str(folder / "robot.js")]
    if kind == "golang":
        return [str(built(*sorted(folder.glob("*.go")))), str(_PACK)]
    check_installed(*_FRAMEWORKS.get(kind, ()))
    return [sys.executable, "-m", "conformance.packs.table1.independent_robots", kind, *ports]


def _ready(process: subprocess.Popen[str], kind: str) -> tuple[str, str]:
    """The two addresses in the line that a robot prints when it is ready."""
    until = time.monotonic() + _START_S
    output: IO[str] | None = process.stdout
    with selectors.DefaultSelector() as selector:
        if output is not None:
            selector.register(output, selectors.EVENT_READ)
        while output is not None and process.poll() is None and (left := until - time.monotonic()) > 0:
            if not selector.select(left):
                break
            found = _READY.search(output.readline())
            if found:
                return found[1], found[2]
    why = (
        f"it ended with exit code {process.poll()}" if process.poll() is not None else f"not ready after {_START_S:g} s"
    )
    raise RobotError(f"the robot {kind!r} does not start: {why}")
