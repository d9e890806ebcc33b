"""The requests of described operations: values as `roaas certify` picks them, kept where the device accepts them."""

from collections.abc import Collection

from conformance.api.rest.inputs import usual_inputs
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Kind, Variation
from conformance.documents.openapi import Operation, operations_of
from conformance.scenarios.drawing import order_of
from conformance.scenarios.scenario import PartialTraceError
from conformance.scenarios.survey import Probe, Surveyor
from loadtests.clients.failures import CallError
from loadtests.clients.robot import Described, Robot
from loadtests.described.device import Device
from loadtests.described.messages import bytes_of, described_message
from loadtests.settings.settings import SettingsError

_STREAM = "its response does not end, as that of a stream"
_FIRST, _LAST = 200, 399  # statuses that are no errors (RFC 9110 section 15)
_ANY_SUCCESS = range(200, 300)


def robot_of(device: Device, operations: Collection[Operation]) -> Robot:
    """Return the robot with the operations to measure, after finding values that it accepts.

    Each operation is called up to four times, and before it what lists the things that its path names. An operation of
    a WSDL is called with each of the statement's values.

    Raises:
        SettingsError: the response of an operation does not end, or no message of it can be made.
        CallError: the device does not respond.
    """
    return robot_at(device, _described_of(device, operations))


def robot_at(device: Device, described: tuple[Described, ...]) -> Robot:
    """Return the robot with operations, by the device's address and credentials."""
    where, connection = device.statement.endpoints, device.api.client.connection
    return Robot(
        rest=where.rest if device.interface == "rest" else None,
        publishers=None,
        subscribers=None,
        ca_file=where.ca_file,
        timeout_s=where.timeout_s,
        described=described,
        credentials=connection.credentials.items,
        username_token=device.messages.token if device.messages is not None else None,
        certificate=connection.certificate,
    )


def _described_of(device: Device, operations: Collection[Operation]) -> tuple[Described, ...]:
    """Return the operations with their requests; see robot_of()."""
    if device.messages is not None:
        return tuple(described_message(device, device.messages, operation) for operation in operations)
    values = Values(device.statement.values)
    device.api.values = values
    surveyor = Surveyor(device.api, values)
    try:
        for operation in sorted({*operations, *_listing(device, operations)}, key=order_of):
            surveyor.begin(operation)
    except PartialTraceError:
        raise CallError("closed", f"{device.api.client.base_url}: the device stopped responding") from None
    return tuple(_described(surveyor, operation) for operation in operations)


def _listing(device: Device, operations: Collection[Operation]) -> list[Operation]:
    """Return the operations that may list what others have in their paths: GET of the path before a parameter."""
    before = {
        each.template.split(f"{{{item.name}}}", 1)[0].rstrip("/")
        for each in operations
        for item in each.parameter("path")
    }
    return [
        each
        for each in operations_of(device.contract)
        if each.method == "GET" and each.template.rstrip("/") in before and device.api.call_rules.decide(each).may
    ]


def _described(surveyor: Surveyor, operation: Operation) -> Described:
    """Return an operation with a request for each set of values that the device accepts; with one, if it acts."""
    label = operation.label
    probes = [each for each in surveyor.probes if each.operation == label]
    if any(each.exchange is not None and each.exchange.response.cut for each in probes):
        raise SettingsError(f"{label} cannot be measured by requests: {_STREAM}")
    if operation.safe:
        tried = surveyor.usual[label]
        others = [each for each in usual_inputs(operation, surveyor.values) if each != tried]
        probes += [surveyor.send(operation, Variation(Kind.USUAL, "", "", each)) for each in others]
    good = [each for each in probes if each.ok] if operation.safe else [each for each in probes if each.ok][:1]
    octets = dict.fromkeys(octets_of(each) for each in good or probes[:1])
    return Described(
        name=label,
        method=operation.method,
        base_url=surveyor.api.client.base_url,
        octets=tuple(octets),
        responses=declared_good(operation),
    )


def octets_of(probe: Probe) -> bytes:
    """Return the bytes of the request of a probe; see bytes_of()."""
    return bytes_of(probe.attempt.request)


def declared_good(operation: Operation) -> tuple[tuple[int, tuple[str, ...]], ...]:
    """Return the declared responses that are no errors; if none is, each 2xx with any media type."""
    explicit = any(key.startswith(("2", "3")) for key in operation.responses)
    found = []
    for status in range(_FIRST, _LAST + 1):
        key = operation.response_key(status)
        if key is not None and (key != "default" or (not explicit and status in _ANY_SUCCESS)):
            found.append((status, tuple(operation.responses[key])))
    return tuple(found) or tuple((status, ()) for status in _ANY_SUCCESS)
