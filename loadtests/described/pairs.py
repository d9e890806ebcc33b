"""The operations that a run measures: of one description, or pairs of an OpenAPI description and a WSDL."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any, Self
from urllib.parse import urldefrag

from jsonpath import JSONPointer
from jsonpath.exceptions import JSONPointerError

from conformance.api.rest.values import Values
from conformance.documents.openapi import Operation
from conformance.scenarios.survey import Surveyor
from conformance.statement.load import ServiceLevel
from loadtests.clients.endpoint import EndpointError
from loadtests.clients.robot import Robot, Stream
from loadtests.clients.rosbridge import bridge_endpoint
from loadtests.described.device import Device
from loadtests.described.operations import choose, named_alike, wanted_of
from loadtests.described.requests import octets_of, robot_of
from loadtests.settings.settings import SettingsError, Streams

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
