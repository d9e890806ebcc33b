"""A run on a device with a description: its settings, its operations, alone or in pairs, and the stop at its end."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, Self
from urllib.parse import urldefrag

import click
from jsonpath import JSONPointer
from jsonpath.exceptions import JSONPointerError

from conformance.api.rest.values import Values
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.result_command import CommandResult
from conformance.documents.description import is_url
from conformance.documents.openapi import Operation
from conformance.papers_robot.statement import RobotStatement
from conformance.scenarios.survey import Surveyor
from conformance.statement.load import ServiceLevel
from conformance.target.describing import is_wsdl
from loadtests.clients.endpoint import EndpointError
from loadtests.clients.robot import Robot, Stream
from loadtests.clients.rosbridge import bridge_endpoint
from loadtests.described.device import DESCRIBED_ONLY, Device, Named
from loadtests.described.operations import (
    callable_robot,
    choose,
    named_alike,
    octets_of,
    robot_of,
    scenario_of,
    wanted_of,
)
from loadtests.described.operators import Stopping, stops_beside
from loadtests.result.files import with_operators
from loadtests.schedule.plan import step_operation
from loadtests.settings.settings import CliOptions, Selection, Settings, SettingsError, Streams, Target
from loadtests.settings.settle import settle

_HOW = 'declare it in the statement, as in [load.pairs] pose = { rest = "GET /robot/pose/", soap = "GetPose" }'
_ALONE = "to measure one interface alone, add --interface rest or --interface soap"


@dataclass(frozen=True)
class Choice:
    """The operations to measure.

    Attributes:
        devices: the device by each of its descriptions.
        weights: how often each operation is called, by the name that the result has for it.
        operations: the operation of each of the devices, by that name.
        notes: which of those named are not called, and why; what each pair is.
    """

    devices: tuple[Device, ...]
    weights: dict[str, int]
    operations: dict[str, tuple[Operation, ...]]
    notes: tuple[str, ...]

    @classmethod
    def of(cls, devices: tuple[Device, ...], named: Iterable[str]) -> Self:
        """Return the operations that the options name, or else the statement; with two descriptions, pairs.

        Raises:
            SettingsError: a name means nothing, an operation may not be called, or the statement has no pair.
        """
        if len(devices) == 1:
            (device,) = devices
            found = choose(device, named)
            names = {device.name_of(each): each for each in found.weights}
            weights = {name: found.weights[each] for name, each in names.items()}
            return cls(devices, weights, {name: (each,) for name, each in names.items()}, found.notes)
        statement = devices[0].statement
        pairs = statement.load.pairs
        if not pairs:
            raise SettingsError(f"no operation is declared that both descriptions have: {_HOW}; {_ALONE}")
        levels = {name: level for name, level in statement.slo.items() if name in pairs}
        weights = wanted_of(named, statement.load.operations, levels) or dict.fromkeys(pairs, 1)
        for name in weights:
            if name not in pairs:
                near = get_close_matches(name, pairs, 1, 0) or [*pairs]
                raise SettingsError(f"{name!r} is no pair; did you mean {near[0]!r}? To add it, {_HOW}; {_ALONE}")
        operations = {name: tuple(_only(device, name) for device in devices) for name in weights}
        notes = []
        for name, halves in operations.items():
            told = (
                f"{device.name_of(half)} over {device.interface.upper()}"
                for device, half in zip(devices, halves, strict=True)
            )
            notes.append(f"the pair {name} is {' and '.join(told)}")
        return cls(devices, weights, operations, tuple(notes))

    @property
    def changing(self) -> list[str]:
        """Return the names of operations that may change something or move the device."""
        return [
            name
            for name, halves in self.operations.items()
            if any(
                not each.safe or each.motion or device.is_moved_by(each)
                for device, each in zip(self.devices, halves, strict=True)
            )
        ]

    def levels(self, *, partial: bool) -> dict[str, ServiceLevel]:
        """Return the service levels of the statement, by the names that the result has for the operations.

        Args:
            partial: whether the device has a description more, whose operations may have levels as well.

        Raises:
            SettingsError: a name means nothing, or several operations.
        """
        found = dict[str, ServiceLevel]()
        for name, level in self.devices[0].statement.slo.items():
            try:
                found[name if name in self.weights else named_alike(name, self.devices[0])] = level
            except SettingsError:
                if not partial:
                    raise
                found[name] = level
        return found

    def robot(self) -> Robot:
        """Return the robot to measure, after finding values that it accepts.

        Raises:
            SettingsError, CallError: see robot_of().
        """
        robots = [
            robot_of(device, [halves[place] for halves in self.operations.values()])
            for place, device in enumerate(self.devices)
        ]
        named = (
            replace(each, name=name)
            for robot in robots
            for name, each in zip(self.operations, robot.described, strict=True)
        )
        return replace(robots[0], described=tuple(named), username_token=robots[-1].username_token)

    def same(self, others: tuple[Device, ...]) -> Self:
        """Return the operations of the same names of the device to compare with.

        Raises:
            SettingsError: it lacks one, or does not allow it.
        """
        try:
            return self.of(others, [f"{name}={weight}" for name, weight in self.weights.items()])
        except SettingsError as error:
            raise SettingsError(f"--against: {error}") from None


def _only(device: Device, name: str) -> Operation:
    """Return the operation that a pair names for a device.

    Raises:
        SettingsError: it names none or several, or it may not be called.
    """
    half = device.half(name)
    try:
        found = list(choose(device, [half]).weights)
    except SettingsError as error:
        raise SettingsError(f"[load.pairs] {name}: {device.interface} = {half!r}: {error}") from None
    if len(found) > 1:
        labels = ", ".join(each.label for each in found)
        raise SettingsError(f"[load.pairs] {name}: {device.interface} = {half!r} means {labels}: name one")
    return found[0]


def streams_to_hear(device: Device, options: Mapping[str, Any]) -> Streams:
    """Return the streams that the options of a command name.

    Raises:
        SettingsError: a stream or a pointer cannot be used.
    """
    pointers = (_checked_pointer(name, options[name]) for name in ("stamp_field", "clock_field"))
    return Streams(_streams_of(device, options["streams"]), *pointers)


def _streams_of(device: Device, names: Iterable[str]) -> tuple[Stream, ...]:
    """Return the streams of --stream: WebSocket URLs, topics of a rosbridge, and operations."""
    found = []
    for name in names:
        if name.startswith(("ws://", "wss://")):
            where, topic = urldefrag(name)
            try:
                bridge_endpoint(where)
            except EndpointError as error:
                raise SettingsError(f"--stream: {error}") from None
            found.append(Stream(name, "rosbridge" if topic else "websocket", name))
        else:
            found += [_events(device, operation) for operation in choose(device, [name]).weights]
    return tuple(found)


def _checked_pointer(option: str, pointer: str | None) -> str | None:
    """Return a JSON pointer (RFC 6901)."""
    try:
        JSONPointer(pointer or "")
    except JSONPointerError as error:
        raise SettingsError(
            f"--{option.replace('_', '-')} {pointer!r}: {error}; a pointer is written /header/stamp"
        ) from None
    return pointer


def _events(device: Device, operation: Operation) -> Stream:
    surveyor = Surveyor(device.api, device.api.values or Values(device.statement.values))
    surveyor.begin(operation)
    probe = next((each for each in surveyor.probes if each.ok), surveyor.probes[0])
    return Stream(operation.label, "sse", device.api.client.base_url, octets_of(probe))


_PAPERS_ONLY = (
    "publishers_wsdl", "subscribers_wsdl", "publishers_endpoint", "subscribers_endpoint", "rosbridge",
)  # fmt: skip
_DESCRIPTIONS = (".json", ".yaml", ".yml", ".wsdl")


@dataclass
class Described:
    """A run on a device with a description.

    Attributes:
        named: the descriptions and the statement.
        options: options of the command.
        devices: the device by its OpenAPI description, by its WSDL, or by both; all of them are stopped at the end.
        others: the device to compare with, likewise; empty if there is none.
    """

    named: Named
    options: Mapping[str, Any]
    devices: tuple[Device, ...]
    others: tuple[Device, ...] = ()
    _stopping: tuple[Stopping, ...] = ()

    @classmethod
    def of(cls, named: Named, options: Mapping[str, Any]) -> Self:
        """Read the descriptions of the device, and of the device to compare with.

        Raises:
            SettingsError: an option is for the paper's robot, or a file cannot be used.
            CallError: a device does not respond.
        """
        alien = [name for name in _PAPERS_ONLY if options[name] not in {None, False}]
        if alien:
            raise SettingsError(
                f"--{alien[0].replace('_', '-')} is for the paper's robot, not for a device with a description"
            )
        if set(options["interfaces"]) - {"rest", "soap"} or set(options["clients"]) - {"wire"}:
            raise SettingsError("a device with a description is measured over REST or SOAP, with the client wire")
        devices, against = _open(named, options), options["against"]
        return cls(named, options, devices, _other(named, options, against) if against else ())

    def settings(self, command: str) -> Settings:
        """Return the settings of the run, after finding values that the device accepts.

        Raises:
            SettingsError: the operations or options do not make a run.
            CallError: the device does not respond.
        """
        options, scenario = self.options, self.options["scenario"]
        target = self._of_choice() if scenario is None else self._of_scenario(scenario)
        taken = {
            name: value for name, value in options.items() if name not in {*DESCRIBED_ONLY, *_PAPERS_ONLY, "against"}
        }
        if scenario is not None:
            taken["users"] = options["users"] or 1
        other = _statement(self.others[0]) if self.others else None
        return settle(CliOptions.of(**taken, against=other, command=command), _statement(self.devices[0]), target)

    def _of_choice(self) -> Target:
        """Return the operations that the options name."""
        options = self.options
        devices, others = (_select(each, options["interfaces"]) for each in (self.devices, self.others))
        state = self._read_by_operators()
        choice = Choice.of(devices, options["operations"] or state)
        names, weights, changing = tuple(choice.weights), tuple(choice.weights.values()), choice.changing
        if changing or options["operators"]:
            self._stopping = tuple(map(Stopping.of, (*self.devices, *self.others)))
        levels = choice.levels(partial=self.named.wsdl is not None)
        return Target(
            choice.robot(),
            Selection(
                names, tuple(each.interface for each in devices), ("wire",), weights if len(set(weights)) > 1 else ()
            ),
            moves=bool(changing),
            steps_move=names[step_operation(names)] in changing,
            other=choice.same(others).robot() if others else None,
            description=self.named.sources,
            slo={name: level for name, level in levels.items() if name in names},
            notes=(
                *(remark for each in devices for remark in each.remarks),
                *choice.notes,
                *_unmeasured_note(levels, names),
            ),
            streams=streams_to_hear(self.devices[0], options),
        )

    def _read_by_operators(self) -> tuple[str, ...]:
        """Return the operation that operators read, if there are to be several.

        Raises:
            SettingsError: the statement has no motion map, or the run may not move the device.
        """
        device = self.devices[0]
        if not self.options["operators"]:
            return ()
        if device.statement.motion_map is None or not device.api.run.allow_motion:
            raise SettingsError("--operators drives and stops the device: it needs a [motion] map and --allow-motion")
        return (device.statement.motion_map.state.read,)

    def beside_operators(self, result: CommandResult) -> CommandResult:
        """See how late a stop takes effect beside several operators, and write it into the result."""
        wanted, motion = self.options["operators"], self.devices[0].statement.motion_map
        if not wanted or motion is None or result.file is None or result.exit_code == ExitCode.INTERRUPTED:
            return result
        click.echo(f"driving and stopping the device, alone and beside {wanted - 1} who read its state", err=True)
        found = stops_beside(self.devices[0], motion, wanted)
        late = any(each["late"] for each in found["by_number"])
        code = ExitCode.FAILED if late else ExitCode.INCONCLUSIVE if found["error"] else ExitCode.PASSED
        return with_operators(result, found, code)

    def _of_scenario(self, file: str) -> Target:
        """Return the operations that a scenario may call."""
        device, scenario = self.devices[0], scenario_of(file, self.options)
        if device.interface != "rest":
            raise SettingsError("--scenario needs an OpenAPI description: name it with --openapi, or in [api] openapi")
        allowed, robot = callable_robot(device)
        names = [each.label for each in allowed]
        moves = any(not each.safe or each.motion for each in allowed)
        if moves:
            self._stopping = tuple(map(Stopping.of, self.devices))
        levels = {named_alike(name, device): level for name, level in device.statement.slo.items()}
        return Target(
            robot,
            Selection(tuple(names), ("rest",), ("wire",)),
            moves=moves,
            steps_move=moves,
            description=self.named.sources,
            slo={name: level for name, level in levels.items() if name in names},
            notes=(*device.remarks, *_unmeasured_note(levels, names)),
            streams=streams_to_hear(device, self.options),
            scenario=scenario,
        )

    @property
    def stopping(self) -> tuple[Stopping, ...]:
        """Return the stops of each device, if the run calls operations that may change something."""
        return self._stopping


def _unmeasured_note(levels: Collection[str], names: Collection[str]) -> list[str]:
    """Return a note on the service levels of operations that are not measured."""
    others = [name for name in levels if name not in names]
    return [f"not measured, so not judged: [slo] {', '.join(others)}"] if others else []


def _open(named: Named, options: Mapping[str, Any]) -> tuple[Device, ...]:
    """Return a device by its descriptions; without its WSDL if the options select REST alone.

    Raises:
        SettingsError: a description cannot be used, or none has an interface that the options select.
        CallError: the device does not respond.
    """
    first, wanted = Device.at(named, options), set(options["interfaces"])
    both = (
        (first,)
        if named.wsdl is None or wanted == {"rest"}
        else (first, first.beside(named.wsdl, options.get("schemas")))
    )
    lacking = wanted - {each.interface for each in both}
    if lacking:
        kind, option = ("a WSDL", "wsdl") if "soap" in lacking else ("an OpenAPI description", "openapi")
        raise SettingsError(f"--interface {min(lacking)} needs {kind}: name it with --{option}, or in [api] {option}")
    return both


def _select(devices: tuple[Device, ...], interfaces: Collection[str]) -> tuple[Device, ...]:
    """Return those with a selected interface; all if none is selected."""
    return tuple(each for each in devices if not interfaces or each.interface in interfaces)


def _other(named: Named, options: Mapping[str, Any], against: str) -> tuple[Device, ...]:
    """Return the device to compare with: at another URL, or with its own statement or description.

    Raises:
        SettingsError: a description cannot be used, or one URL is to stand for two descriptions.
        CallError: the device does not respond.
    """
    elsewhere = {**options, "base_url": None, "rest": None}
    if not is_url(against) and not against.endswith(_DESCRIPTIONS):
        own = Named.of((against,), {"openapi": None, "wsdl": None})
        return _open(own if own.source else Named(named.source, own.statement, named.wsdl), elsewhere)
    if named.wsdl is not None and set(options["interfaces"]) != {"rest"}:
        raise SettingsError(f"--against {against}: to compare REST and SOAP, name the other device's statement")
    if against.endswith(_DESCRIPTIONS) or is_wsdl(against):
        return _open(Named(against, named.statement), elsewhere)
    return _open(named, {**elsewhere, "base_url": against})


def _statement(device: Device) -> RobotStatement:
    """Return a device's statement as the load test reads it; a device without a name has its description's title."""
    said, info = device.statement, device.api.run.contract.openapi.get("info")
    title = {"name": str(info.get("title", ""))} if isinstance(info, dict) else {}
    return RobotStatement(robot=title | said.robot, endpoints=said.endpoints, load=said.load)
