"""The streams of a device to listen to: operations that send events, WebSockets, and topics of a rosbridge."""

from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import urldefrag

from jsonpath import JSONPointer
from jsonpath.exceptions import JSONPointerError

from conformance.api.rest.values import Values
from conformance.documents.openapi import Operation
from conformance.scenarios.survey import Surveyor
from loadtests.clients.endpoint import EndpointError
from loadtests.clients.robot import Stream
from loadtests.clients.rosbridge import bridge_endpoint
from loadtests.described.device import Device
from loadtests.described.operations import chosen
from loadtests.described.requests import octets_of
from loadtests.settings.settings import SettingsError, Streams


def streams_to_hear(device: Device, options: Mapping[str, Any]) -> Streams:
    """Return the streams that the options of a command name.

    Raises:
        SettingsError: a stream or a pointer cannot be used.
    """
    pointers = (_checked_pointer(name, options[name]) for name in ("stamp_field", "clock_field"))
    return Streams(_streams_of(device, options["streams"]), *pointers)


def _streams_of(device: Device, names: Iterable[str]) -> tuple[Stream, ...]:
    """Return what --stream names: URLs of WebSockets, with a topic those of a rosbridge; and operations."""
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
            found += [_events(device, operation) for operation in chosen(device, [name]).weights]
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
