"""The streams of a device to listen to: operations that send events, and WebSockets."""

from collections.abc import Iterable

from jsonpath import JSONPointer
from jsonpath.exceptions import JSONPointerError

from conformance.api.rest.values import Values
from conformance.documents.openapi import Operation
from conformance.scenarios.survey import Surveyor
from loadtests.clients.described import Stream
from loadtests.clients.endpoint import EndpointError
from loadtests.clients.rosbridge import bridge_endpoint
from loadtests.described.device import Device
from loadtests.described.operations import chosen
from loadtests.described.requests import octets_of
from loadtests.settings.errors import SettingsError


def streams_of(device: Device, names: Iterable[str]) -> tuple[Stream, ...]:
    """Return what the options name: URLs of WebSockets, and operations of the description.

    Raises:
        SettingsError: a URL cannot be used, or an operation is unknown or may not be called.
    """
    found = []
    for name in names:
        if name.startswith(("ws://", "wss://")):
            try:
                bridge_endpoint(name)
            except EndpointError as error:
                raise SettingsError(f"--stream: {error}") from None
            found.append(Stream(name, "websocket", name))
        else:
            found += [_events(device, operation) for operation in chosen(device, [name]).weights]
    return tuple(found)


def checked_pointer(pointer: str | None) -> str | None:
    """Return a JSON pointer (RFC 6901).

    Raises:
        SettingsError: it is none.
    """
    try:
        JSONPointer(pointer or "")
    except JSONPointerError as error:
        raise SettingsError(f"--stamp-field {pointer!r}: {error}; a pointer is written /header/stamp") from None
    return pointer


def _events(device: Device, operation: Operation) -> Stream:
    surveyor = Surveyor(device.api, device.api.values or Values(device.statement.values))
    surveyor.begin(operation)
    probe = next((each for each in surveyor.probes if each.ok), surveyor.probes[0])
    return Stream(operation.label, "sse", device.api.client.base_url, octets_of(probe))
