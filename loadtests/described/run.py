"""A run on a device with a description: its settings, and the stop at its end."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from conformance.api.rest.stops import send_stops
from conformance.documents.description import is_url
from conformance.documents.openapi import operations_of
from conformance.packs.table1.statement import Load, Statement
from conformance.statement.load import ServiceLevel
from loadtests.described.device import DESCRIBED_ONLY, Device, Named
from loadtests.described.operations import chosen, named_alike
from loadtests.described.requests import robot_of
from loadtests.described.scenario import callable_robot, scenario_of
from loadtests.described.streams import streams_to_hear
from loadtests.settings.cli_options import CliOptions
from loadtests.settings.errors import SettingsError
from loadtests.settings.settings import Selection, Settings
from loadtests.settings.settle import settle
from loadtests.settings.target import Target

_PAPERS_ONLY = (
    "publishers_wsdl", "subscribers_wsdl", "publishers_endpoint", "subscribers_endpoint", "rosbridge", "end_to_end",
    "ros_domain_id", "thresholds", "against_publishers_wsdl", "against_subscribers_wsdl",
    "against_publishers_endpoint", "against_subscribers_endpoint",
)  # fmt: skip
_DESCRIPTIONS = (".json", ".yaml", ".yml")


@dataclass
class Described:
    """A run on a device with a description.

    Attributes:
        source: URL or file of the description.
        options: of the command.
        device: the device.
        other: the device to compare with, or None.
    """

    source: str
    options: Mapping[str, Any]
    device: Device
    other: Device | None = None
    _acts: bool = False

    @classmethod
    def of(cls, named: Named, options: Mapping[str, Any]) -> Self:
        """Read the descriptions of the device, and of the device to compare with.

        Raises:
            SettingsError: an option is for the paper's robot, or a file cannot be used.
            CallError: a device does not respond.
        """
        alien = [name for name in _PAPERS_ONLY if options[name] not in {None, False}]
        if alien:
            hint = "; its service levels are in the statement's [slo]" if alien[0] == "thresholds" else ""
            raise SettingsError(
                f"--{alien[0].replace('_', '-')} is for the paper's robot, not for a device with a description{hint}"
            )
        if set(options["interfaces"]) - {"rest"} or set(options["clients"]) - {"wire"}:
            raise SettingsError("a device with a description is measured over REST, with the client wire")
        device, against = Device.at(named, options), options["against"]
        return cls(named.source or "", options, device, _other(named, options, against) if against else None)

    def settings(self, command: str) -> Settings:
        """Return the settings of the run, after finding values that the device accepts.

        Raises:
            SettingsError: the operations or options do not make a run.
            CallError: the device does not respond.
        """
        options, scenario = self.options, self.options["scenario"]
        target = self._target() if scenario is None else self._of_scenario(scenario)
        taken = {
            name: value for name, value in options.items() if name not in {*DESCRIBED_ONLY, *_PAPERS_ONLY, "against"}
        }
        if scenario is not None:
            taken["users"] = options["users"] or 1
        other = None if self.other is None else _statement(self.other)
        return settle(CliOptions.of(**taken, against=other, command=command), _statement(self.device), target)

    def _target(self) -> Target:
        """Return the operations that the options name."""
        options, device = self.options, self.device
        operations = chosen(device, options["operations"])
        names, weights = [each.label for each in operations.weights], tuple(operations.weights.values())
        changing = [each.label for each in operations.weights if not each.safe or each.motion]
        self._acts = bool(changing)
        robot = robot_of(device, operations.weights)
        slo, unmeasured = self._levels(names)
        return Target(
            robot,
            Selection(tuple(names), ("rest",), ("wire",), weights if len(set(weights)) > 1 else ()),
            moves=bool(changing),
            steps_move=names[0] in changing,
            other=None if self.other is None else robot_of(self.other, _same(self.other, operations.weights)),
            description=self._description,
            slo=slo,
            notes=(*device.remarks, *operations.notes, *unmeasured),
            streams=streams_to_hear(device, options),
        )

    def _levels(self, names: list[str]) -> tuple[dict[str, ServiceLevel], list[str]]:
        """Return the service levels of operations, and a note on those of others."""
        levels = {named_alike(name, self.device): level for name, level in self.device.statement.slo.items()}
        others = [name for name in levels if name not in names]
        notes = [f"not measured, so not judged: [slo] {', '.join(others)}"] if others else []
        return {name: level for name, level in levels.items() if name in names}, notes

    def _of_scenario(self, file: str) -> Target:
        """Return the operations that a scenario may call."""
        options, device = self.options, self.device
        scenario = scenario_of(file, options)
        robot = callable_robot(device)
        names = [each.name for each in robot.described if not each.refused]
        slo, unmeasured = self._levels(names)
        moves = self._acts = any(
            each.label in names and (not each.safe or each.motion) for each in operations_of(device.contract)
        )
        return Target(
            robot,
            Selection(tuple(names), ("rest",), ("wire",)),
            moves=moves,
            steps_move=moves,
            description=self._description,
            slo=slo,
            notes=(*device.remarks, *unmeasured),
            streams=streams_to_hear(device, options),
            scenario=scenario,
        )

    @property
    def _description(self) -> str:
        """Return the description's URL, or the name of its file."""
        return self.source if is_url(self.source) else Path(self.source).name

    def stop(self) -> None:
        """Send what the description marks as a stop (x-roaas-stop), if the run called what may change something."""
        for device in (self.device, self.other):
            if device is not None and self._acts:
                device.api.client.connection.note("POST")  # the run sent it, over connections of its own
                send_stops(device.api)


def _other(named: Named, options: Mapping[str, Any], against: str) -> Device:
    """Return the device to compare with: at another URL, or with its own statement or description."""
    if against.endswith(_DESCRIPTIONS):
        return Device.at(Named(against, named.statement), {**options, "base_url": None, "rest": None})
    if is_url(against):
        return Device.at(named, {**options, "base_url": against, "rest": None})
    own = Named.of((against,), {"openapi": None, "wsdl": None})
    return Device.at(Named(own.source or named.source, own.statement), {**options, "base_url": None, "rest": None})


def _same(other: Device, weights: Mapping[Any, int]) -> dict[Any, int]:
    """Return the other device's operations of the same names.

    Raises:
        SettingsError: it lacks one, or does not allow it.
    """
    try:
        return chosen(other, [f"{each.label}={weight}" for each, weight in weights.items()]).weights
    except SettingsError as error:
        raise SettingsError(f"--against: {error}") from None


def _statement(device: Device) -> Statement:
    """Return a device's statement as the load test reads it."""
    said, limits = device.statement, device.statement.load
    load = Load(max_rate=limits.max_rate, max_duration_s=limits.max_duration_s)
    return Statement(robot=said.robot, endpoints=said.endpoints, load=load)
