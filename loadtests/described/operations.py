"""Which operations of a description to measure: by name, with weights, as far as they may be called; their requests.

The messages to the operations of a WSDL are made by its schema, likewise.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from hashlib import sha256
from pathlib import Path
from typing import Any

from conformance.api.call_rules import Reason, is_literal, matches
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
from conformance.statement.load import ServiceLevel
from conformance.transport.credentials import hide_token
from conformance.transport.exchange import NoAnswerError, Request
from conformance.transport.reach import is_same
from loadtests.clients.failures import CallError, Reply
from loadtests.clients.payloads import VARIANTS
from loadtests.clients.robot import Described, Robot
from loadtests.described.device import Device
from loadtests.settings.settings import Scenario, SettingsError
from loadtests.statistics.recorder import MOST_OPERATIONS

_TRIED = 4  # messages of an operation that are tried until the device accepts one
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


_WEIGHTED = re.compile(r"(?P<name>.*?)(?:=(?P<weight>[1-9]\d{0,2}|1000))?", re.DOTALL)
#: Operations of a run; with more, each would get too few requests.
MOST = 16
_SHOWN = 12  # operations that a message names
_LONGEST = 300
#: Options that a scenario excludes, by their Python names, with their defaults.
_OTHERWISE = {
    "operations": (), "rate": None, "stages": (), "arrivals": "constant", "knee": False, "against": None,
    "restart_command": None,
}  # fmt: skip


@dataclass(frozen=True)
class Chosen:
    """The operations to measure.

    Attributes:
        weights: how often each is called, beside the others.
        notes: which of those named are not called, and why.
    """

    weights: dict[Operation, int]
    notes: tuple[str, ...]


def choose(device: Device, named: Iterable[str]) -> Chosen:
    """Return the operations that the options name, or else the statement's [load], or else its [slo].

    Args:
        device: with the description.
        named: `GET /state`, an operationId, a tag or a pattern; each may end with a weight, as in `GET /state=3`.

    Raises:
        SettingsError: a name means no operation, an operation may not be called, or nothing is named.
    """
    statement, known = device.statement, operations_of(device.contract)
    wanted = wanted_of(named, statement.load.operations, statement.slo)
    if not wanted:
        listed = ", ".join(f"'{device.name_of(each)}'" for each in known[:_SHOWN])
        more = f" and {len(known) - _SHOWN} more" if len(known) > _SHOWN else ""
        raise SettingsError(f"name the operations to measure with --operation; the description has {listed}{more}")
    weights: dict[Operation, int] = {}
    notes = []
    for name, weight in wanted.items():
        meant = _operations_meant(device.half(name), known)
        for operation in meant:
            why = refusal_of(device, operation)
            if why and meant == [operation] and is_literal(device.half(name), operation):
                raise SettingsError(f"{device.name_of(operation)} is not called: {why}")
            if why:
                notes.append(f"{device.name_of(operation)} is not called: {why}")
            else:
                weights[operation] = weight
    if not weights:
        raise SettingsError(f"nothing is left to measure: {'; '.join(notes)}")
    if len(weights) > MOST:
        raise SettingsError(f"{len(weights)} operations are too many for one run: at most {MOST}")
    return Chosen(weights, tuple(notes))


def named_alike(name: str, device: Device) -> str:
    """Return the result's name of an operation that the statement's [slo] names.

    Raises:
        SettingsError: it means none, or several.
    """
    found = _operations_meant(device.half(name), operations_of(device.contract))
    if len(found) > 1:
        raise SettingsError(f"[slo] {name!r} means {len(found)} operations: name one, as in 'GET /state'")
    return device.name_of(found[0])


def wanted_of(
    named: Iterable[str], operations: Mapping[str, int], levels: Mapping[str, ServiceLevel]
) -> dict[str, int]:
    """Return names with weights: those of the options, or else the statement's [load], or else its [slo]."""
    return _read(named) or dict(operations) or _by_rates(levels)


def _read(named: Iterable[str]) -> dict[str, int]:
    found = {}
    for text in named:
        parts = _WEIGHTED.fullmatch(text.strip())
        if parts is not None:
            found[parts["name"]] = int(parts["weight"] or 1)
    return found


def _by_rates(levels: Mapping[str, ServiceLevel]) -> dict[str, int]:
    """Return operations with service levels, weighted by the rates at which the levels hold if all have one."""
    rates = {name: level.at_rate for name, level in levels.items()}
    known = [rate for rate in rates.values() if rate is not None]
    if len(known) < len(rates):
        return dict.fromkeys(rates, 1)
    return {name: min(1000, round((rate or 1.0) / min(known))) for name, rate in rates.items()}


def _operations_meant(name: str, known: tuple[Operation, ...]) -> list[Operation]:
    """Return the operations that a name means.

    Raises:
        SettingsError: it means none; the message has the nearest names.
    """
    literal = [each for each in known if is_literal(name, each)]
    found = literal or [each for each in known if matches(name, each)]
    if found:
        return found
    labels = [each.label for each in known]
    near = get_close_matches(name, [*labels, *(each.id for each in known)], 3, 0.4) or labels[:_SHOWN]
    hint = f"did you mean {' or '.join(repr(each) for each in dict.fromkeys(near))}?" if near else "it has none"
    raise SettingsError(f"the description has no operation {name!r}: {hint}")


def refusal_of(device: Device, operation: Operation) -> str:
    """Return why an operation is not measured; empty if it is."""
    reason = device.api.call_rules.decide(operation)
    if not reason.may:
        return str(reason)
    if device.is_moved_by(operation) and not device.api.run.allow_motion:
        return str(Reason.MOVES)
    if device.messages is not None and not at_hand(device.messages, operation):
        return "its port is at another server"
    if operation.method in {"HEAD", "TRACE"}:
        return f"{operation.method} is not measured, because its response has no content"
    if not operation.label.isprintable() or len(operation.label) > _LONGEST:
        return "its path is too long, or is not printable"
    return ""


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
        Described(each.label, each.method, base, (), declared_good(each), refused=refusal_of(device, each))
        for each in known
    )
    allowed = [each for each, told in zip(known, found, strict=True) if not told.refused]
    if not 0 < len(allowed) <= MOST_OPERATIONS:
        raise SettingsError(
            f"of the description's {len(found)} operations, --scenario needs 1 to {MOST_OPERATIONS} that may be called"
        )
    return allowed, robot_at(device, found)
