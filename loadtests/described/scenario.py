"""What a scenario may call: the operations of a device's description, by the rules of `roaas certify`."""

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from conformance.documents.openapi import Operation, operations_of
from loadtests.clients.described import Described
from loadtests.clients.robot import Robot
from loadtests.described.device import Device
from loadtests.described.operations import refused
from loadtests.described.requests import declared_good, robot_at
from loadtests.settings.errors import SettingsError
from loadtests.settings.settings import Scenario
from loadtests.statistics.recorder import MOST_OPERATIONS

#: What a scenario decides by itself, or what needs requests at set times; by name in Python, with the value by default.
_OTHERWISE = {
    "operations": (), "rate": None, "arrivals": "constant", "steps": False, "step_rates": (), "knee": False,
    "connections": (), "against": None, "restart_command": None,
}  # fmt: skip


def scenario_of(file: str, options: Mapping[str, Any]) -> Scenario:
    """Return the scenario of a run.

    Raises:
        SettingsError: an option does not go with it, or the file cannot be read.
    """
    alien = next((name for name, usual in _OTHERWISE.items() if options[name] != usual), None)
    if alien is not None:
        option = {"operations": "operation"}.get(alien, alien.replace("_", "-"))
        raise SettingsError(f"--{option} does not go with --scenario, whose users decide what is sent, and when")
    try:
        return Scenario(file, sha256(Path(file).read_bytes()).hexdigest())
    except OSError as error:
        raise SettingsError(f"--scenario {file!r}: {error.strerror or error}") from None


def callable_robot(device: Device) -> tuple[list[Operation], Robot]:
    """Return the operations that may be called, and the robot with all, and why the others may not. Nothing is sent.

    Raises:
        SettingsError: there are too many operations, or none may be called.
    """
    base, known = device.api.client.base_url, operations_of(device.contract)
    found = tuple(
        Described(each.label, each.method, base, (), declared_good(each), refused=refused(device, each))
        for each in known
    )
    allowed = [each for each, told in zip(known, found, strict=True) if not told.refused]
    if not 0 < len(allowed) <= MOST_OPERATIONS:
        raise SettingsError(
            f"of the description's {len(found)} operations, --scenario needs 1 to {MOST_OPERATIONS} that may be called"
        )
    return allowed, robot_at(device, found)
