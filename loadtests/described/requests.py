"""The requests of described operations: values as `roaas certify` picks them, kept where the device accepts them.

The messages to the operations of a WSDL are made by its schema, likewise.
"""

from collections.abc import Collection, Iterator

from conformance.api.rest.inputs import usual_inputs
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Kind, Variation
from conformance.documents.openapi import Operation, operations_of
from conformance.documents.wsdl import SoapOperation, SoapPort
from conformance.documents.wsdl_pack import each, label_of
from conformance.documents.xml import Node, local
from conformance.scenarios.described_messages import DescribedMessages, fields_of, target_of
from conformance.scenarios.drawing import order_of
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError
from conformance.scenarios.survey import Probe, Surveyor
from conformance.transport.credentials import hide_token
from conformance.transport.exchange import NoAnswerError, Request
from conformance.transport.reach import is_same
from loadtests.clients.failures import CallError, Reply
from loadtests.clients.payloads import VARIANTS
from loadtests.clients.robot import Described, Robot
from loadtests.described.device import Device
from loadtests.settings.settings import SettingsError

#: _TRIED: messages of an operation that changes something, tried until the device accepts one.
_TRIED = 4
_STREAM = "its response does not end, as that of a stream"
_FIRST, _LAST = 200, 399  # statuses that are no errors (RFC 9110 section 15)
_ANY_SUCCESS = range(200, 300)


def _find(messages: DescribedMessages, operation: Operation) -> tuple[SoapPort, SoapOperation]:
    """Return an operation of the WSDL with its port."""
    return next(found for found in each(messages.found.ports) if label_of(*found) == operation.label)


def at_hand(messages: DescribedMessages, operation: Operation) -> bool:
    """Return whether the port of an operation is at the server of the first one; others are not called."""
    return is_same(_find(messages, operation)[0].url, messages.found.base)


def described_message(device: Device, messages: DescribedMessages, operation: Operation) -> Described:
    """Return an operation with a message for each set of values that the device accepts; with one, if it acts.

    Raises:
        SettingsError: no valid message can be made.
    """
    port, own = _find(messages, operation)
    reply = Reply(local(own.response or ""))
    good, bad = list[bytes](), list[bytes]()
    for node in list(dict.fromkeys(_bodies(messages, own)))[: None if operation.safe else _TRIED]:
        try:
            message = messages.message(port, own, node)
            sent = device.api.client.send("POST", target_of(port), headers=fields_of(port, own), body=message)
            answer, request = sent.response, sent.request
            reply.require(answer.status, answer.header("location"), None, answer.body)
            good.append(hide_token(bytes_of(request)))
        except NotPossibleError as error:
            raise SettingsError(str(error)) from None
        except NoAnswerError as none:
            bad.append(hide_token(bytes_of(none.unanswered.request)))
            break  # each further call would wait for the same deadline
        except CallError:
            bad.append(hide_token(bytes_of(request)))
        if good and not operation.safe:
            break
    return Described(
        name=device.name_of(operation),
        method="POST",
        base_url=device.api.client.base_url,
        octets=tuple(good or bad[:1]),
        interface="soap",
        reply=reply.element,
    )


def _bodies(messages: DescribedMessages, operation: SoapOperation) -> Iterator[Node | None]:
    """Yield what the Body has, with the statement's values in rotation; the same again where it names too few.

    Raises:
        SettingsError: no valid message can be made.
    """
    turns = min(VARIANTS, max(map(len, messages.values.values()), default=1))
    try:
        for turn in range(turns):
            yield messages.usual(operation, turn)[1]
    except NotPossibleError as error:
        raise SettingsError(str(error)) from None


def bytes_of(request: Request) -> bytes:
    """Return the bytes of a request that was sent, with variables in place of credentials."""
    fields = [pair for pair in request.headers if pair[0] != "Connection"]
    lines = [
        f"{request.method} {request.target}{request.query} HTTP/1.1",
        *(f"{name}: {text}" for name, text in fields),
    ]
    return "\r\n".join([*lines, "", ""]).encode() + request.body


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
    return tuple(_describe(surveyor, operation) for operation in operations)


def _listing(device: Device, operations: Collection[Operation]) -> list[Operation]:
    """Return operations that may list values for others' paths: GET of the path before a parameter."""
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


def _describe(surveyor: Surveyor, operation: Operation) -> Described:
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
