"""Which operations of a description to measure: by name, with weights, as far as they may be called."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from hashlib import sha256
from pathlib import Path
from typing import Any

from conformance.api.call_rules import Reason, is_literal, matches
from conformance.documents.openapi import Operation, operations_of
from conformance.statement.load import ServiceLevel
from loadtests.clients.robot import Described, Robot
from loadtests.described.device import Device
from loadtests.described.requests import at_hand, declared_good, robot_at
from loadtests.settings.settings import Scenario, SettingsError
from loadtests.statistics.recorder import MOST_OPERATIONS

_WEIGHTED = re.compile(r"(?P<name>.*?)(?:=(?P<weight>[1-9]\d{0,2}|1000))?", re.DOTALL)
#: MOST: operations of a run; with more, each would get too few requests. _SHOWN: operations that a message names.
MOST = 16
_SHOWN = 12
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
