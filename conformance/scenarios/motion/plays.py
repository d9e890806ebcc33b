"""Scenarios of a device with a motion map: targets, stops, new targets, several clients, and attempts at rest."""

from __future__ import annotations

import random
from collections.abc import Iterator
from functools import partial
from typing import Any, Final

from conformance.api.rest.validity import INVALID, validity
from conformance.scenarios.motion.mapped import Mapped, Position
from conformance.scenarios.motion.trace import Command, Leg, Quiet, Reading, Tried
from conformance.scenarios.scenario import NoOccasionError, NotPossibleError, PartialTraceError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.transport.incomplete_request import PartialRequest
from conformance.transport.parallel import Outgoing, send_together
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

_NEEDS: Final = (Need.REST, Need.MOTION)
# Of the way: so far a device has come when it is stopped, or gets another target.
_UNDER_WAY: Final = 0.3
_CLIENTS: Final = 4
# A device that was stopped is watched for as long as its way would have taken, but no longer than the first, and at
# least for the second after its time to rest, s.
_LONGEST_S: Final = 5.0
_RESUMED_S: Final = 1.5
_COMMANDS: Final = 100
# For so long a server has time to read the part of a request that was sent, s.
_READ_S: Final = 0.03
# Of the range of an axis: so far beyond its limits are targets that the device must not take.
_BEYOND: Final = (0.05, 0.5)


def _at_home(mapped: Mapped) -> None:
    """Bring the device home.

    Raises:
        NotPossibleError: it does not get there.
    """
    if not mapped.bring_home():
        raise NotPossibleError("the device does not come to the position from which the suite begins")


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def targets(mapped: Mapped, effort: Effort, run: Run) -> tuple[Leg, ...]:
    """Send the device to the limits of each axis and back; at standard also to positions of all axes at random."""
    legs: list[Leg] = []
    axes = mapped.motion.state.axes
    chance = random.Random(f"{run.seed}/targets")  # noqa: S311 - no secret
    try:
        legs.append(mapped.go("the position at which it begins", {}))
        for name, axis in axes.items():
            told = f" {axis.unit}" if axis.unit else ""
            legs += [mapped.go(f"{name} {limit:g}{told}, its limit", {name: limit}) for limit in axis.limits]
            legs.append(mapped.go(f"{name} back", {}))
        for _ in range(0 if effort.name == "quick" else effort.cases(3)):
            anywhere = {name: round(chance.uniform(*axis.limits), 3) for name, axis in axes.items()}
            legs.append(mapped.go("a position of all axes", anywhere))
    except NoAnswerError as error:
        raise PartialTraceError(tuple(legs)) from error
    return tuple(legs)


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def clamped_targets(mapped: Mapped) -> tuple[Leg, ...]:
    """Send the device beyond its limits, where the map says that it goes as far as it can."""
    if mapped.motion.goto.beyond_limits != "clamped":
        raise NoOccasionError("the map does not say that targets beyond the limits are clamped")
    _at_home(mapped)
    return tuple(
        mapped.go(f"{name} {value:g}, beyond its limit", {name: value}, {name: limit})
        for name, limit, value in _beyond(mapped)
    )


def _beyond(mapped: Mapped) -> Iterator[tuple[str, float, float]]:
    """Yield axes, their limits, and targets beyond these."""
    for name, axis in mapped.motion.state.axes.items():
        for part in _BEYOND:
            room = part * (axis.limits[1] - axis.limits[0])
            yield name, axis.limits[0], axis.limits[0] - room
            yield name, axis.limits[1], axis.limits[1] + room


def _ends(mapped: Mapped, effort: Effort) -> Iterator[tuple[str, float, float]]:
    """Yield axes with where a move along them begins and ends; at quick the first axis alone."""
    axes = list(mapped.motion.state.axes.items())
    for name, axis in axes[:1] if effort.name == "quick" else axes:
        yield name, *axis.limits


def _started(mapped: Mapped, name: str, begin: float, end: float) -> tuple[Position, Command, list[Any]]:
    """Go to one end of an axis, and set out to the other; return when a part of the way is done."""
    mapped.go("one end", {name: begin})
    start = mapped.read().values
    command = mapped.goto({name: end})
    part = abs(end - begin) * _UNDER_WAY
    readings = mapped.watch(
        command.answered + mapped.takes_s,
        lambda seen: bool(seen[-1].values) and abs(seen[-1].values[name] - begin) > part,
    )
    return start, command, readings


@scenario(needs=_NEEDS, stage=Stage.MOTION)
def stops(mapped: Mapped, effort: Effort) -> tuple[Leg, ...]:
    """Stop the device under way, and watch it for as long as the rest of the way would have taken, and longer."""
    if mapped.motion.stop is None:
        raise NotPossibleError("the map declares no stop")
    legs = []
    for name, begin, end in _ends(mapped, effort):
        start, command, readings = _started(mapped, name, begin, end)
        stop = mapped.stop()
        if stop is None:
            raise NotPossibleError("the stop names a value that the response to the move does not have")
        due = stop.answered + mapped.takes_s + mapped.motion.goto.settle_s
        # For as long as the rest of the way takes, if that is not too long; in any case long enough to be resumed.
        longest = max(
            min(due, stop.answered + _LONGEST_S), stop.answered + mapped.motion.stop.rests_within_s + _RESUMED_S
        )
        readings += mapped.watch(longest)
        legs.append(Leg(f"a stop on the way to {name} {end:g}", start, (command, stop), tuple(readings), due))
    return tuple(legs)


@scenario(needs=_NEEDS, stage=Stage.MOTION)
def new_targets(mapped: Mapped, effort: Effort) -> tuple[Leg, ...]:
    """Send the device back under way, and watch for as long as the first move would have taken, and longer."""
    legs = []
    for name, begin, end in _ends(mapped, effort):
        start, command, readings = _started(mapped, name, begin, end)
        second = mapped.goto({name: begin})
        leg = mapped.leg(f"a second target on the way to {name} {end:g}: back", command, second, start=start)
        more = mapped.watch(max(mapped.clock.now(), command.answered + mapped.takes_s) + 0.5)
        legs.append(Leg(leg.what, start, leg.commands, (*readings, *leg.readings, *more), leg.due))
    return tuple(legs)


@scenario(needs=_NEEDS, stage=Stage.MOTION)
def many_commands(mapped: Mapped, effort: Effort) -> Leg:
    """Send many targets in a row, without waiting for any of them."""
    name, axis = next(iter(mapped.motion.state.axes.items()))
    start = mapped.read().values
    ends = [axis.limits[turn % 2] for turn in range(effort.cases(_COMMANDS))]
    commands = [mapped.goto({name: end}) for end in ends]
    return mapped.leg(f"{len(ends)} targets in a row", *commands, start=start)


@scenario(needs=_NEEDS, stage=Stage.MOTION)
def repeated(mapped: Mapped) -> Leg:
    """Send one move twice, as a client does that tries again."""
    name, axis = next(iter(mapped.motion.state.axes.items()))
    start = mapped.read().values
    commands = [mapped.goto({name: axis.limits[0]}) for _ in range(2)]
    return mapped.leg("a move that was sent twice", *commands, start=start)


@scenario(needs=_NEEDS, stage=Stage.MOTION)
def several_clients(mapped: Mapped, effort: Effort) -> tuple[Leg, ...]:
    """Send different targets from several clients at the same moment."""
    legs = []
    for _ in range(1 if effort.name == "quick" else 3):
        _at_home(mapped)
        start = mapped.read().values
        wanted = [
            {
                name: axis.limits[0] + (axis.limits[1] - axis.limits[0]) * client / (_CLIENTS - 1)
                for name, axis in mapped.motion.state.axes.items()
            }
            for client in range(_CLIENTS)
        ]
        sent = mapped.clock.now()
        attempts = send_together([[_outgoing(mapped, one) for one in wanted]])[0]
        answered = mapped.clock.now()
        commands = [Command(sent, answered, one, attempt) for one, attempt in zip(wanted, attempts, strict=True)]
        for one in commands:
            if one.accepted and isinstance(one.attempt, Exchange):
                mapped.note(one.attempt)
        due = answered + mapped.takes_s + mapped.motion.goto.settle_s
        readings = mapped.watch(due, partial(_is_at_one, mapped, wanted)) + mapped.watch(mapped.clock.now() + 0.3)
        legs.append(Leg("targets of several clients", start, tuple(commands), tuple(readings), due))
    return tuple(legs)


def _outgoing(mapped: Mapped, targets: Position) -> Outgoing:
    return Outgoing(mapped.api.client, *mapped.request_of(targets))


def _is_at_one(mapped: Mapped, wanted: list[Position], readings: list[Reading]) -> bool:
    return any(mapped.is_at(one, readings) for one in wanted)


@scenario(needs=_NEEDS, stage=Stage.STANDSTILL)
def attempts_at_rest(mapped: Mapped) -> Quiet:
    """At rest, send what must move nothing, watch once, and if the device moves, try each again alone."""
    _at_home(mapped)
    tries = list(_tries(mapped))
    quiet = _quiet(mapped, tries)
    if not _moved(mapped, quiet):
        return quiet
    alone = []
    for one in tries:
        if not mapped.bring_home():
            break
        alone.append(_quiet(mapped, [one]))
    mapped.bring_home()
    return Quiet(quiet.where, quiet.tried, quiet.readings, tuple(alone))


def _quiet(mapped: Mapped, tries: list[Any]) -> Quiet:
    where = mapped.read().values
    tried = tuple(one() for one in tries)
    readings = mapped.watch(mapped.clock.now() + min(mapped.takes_s, 2.0) + mapped.motion.goto.settle_s)
    return Quiet(where, tried, tuple(readings))


def _moved(mapped: Mapped, quiet: Quiet) -> bool:
    return any(one.values and not mapped.is_near(one.values, quiet.where) for one in quiet.readings)


def _tries(mapped: Mapped) -> Iterator[Any]:
    """Yield functions that make one attempt each."""
    goto, axes = mapped.motion.goto, mapped.motion.state.axes
    if goto.beyond_limits == "refused":
        for name, _, value in _beyond(mapped):
            yield partial(_send, mapped, "beyond", f"{name} {value:g}, beyond its limit", {name: value})
    name, axis = next(iter(axes.items()))
    away = {name: axis.limits[1]}
    for other, axis in axes.items():
        values: tuple[tuple[str, Any], ...] = (
            (f'the text "far" as {other}', "far"),
            (f"a list as {other}", [axis.limits[1]]),
        )
        for what, value in values:
            if _is_invalid(mapped, {other: value}):
                yield partial(_send, mapped, "invalid", what, {other: value})
    if mapped.api.client.connection.credentials.items:
        yield partial(_send, mapped, "unauthorised", "a move without credentials", away, authorized=False)
    if goto.body is not None:
        yield partial(_send_cut, mapped, away)
        for promised in (10, None):
            yield partial(_vanish, mapped, away, promised)


def _is_invalid(mapped: Mapped, targets: dict[str, Any]) -> bool:
    """Return whether the description forbids a move."""
    method, path, fields, octets = mapped.request_of(targets)
    media_type = "application/json" if fields else ""
    return validity(mapped.api.run.contract, method, path, media_type, octets).verdict == INVALID


def _send(mapped: Mapped, kind: str, what: str, targets: dict[str, Any], *, authorized: bool = True) -> Tried:
    method, path, fields, octets = mapped.request_of(targets)
    exchange = mapped.api.client.send(method, path, headers=fields, body=octets, authorized=authorized)
    return Tried(kind, what, exchange)


def _send_cut(mapped: Mapped, targets: dict[str, Any]) -> Tried:
    method, path, fields, octets = mapped.request_of(targets)
    exchange = mapped.api.client.send(method, path, headers=fields, body=octets + b"}")
    return Tried("invalid", "a body that is not JSON", exchange)


def _vanish(mapped: Mapped, targets: dict[str, Any], promised: int | None) -> Tried:
    """Send a move of which some bytes are missing, and close the connection."""
    method, path, _, octets = mapped.request_of(targets)
    whole = None if promised is None else len(octets) + promised
    request = PartialRequest(mapped.api.client, method, path, sent=octets, promised=whole)
    mapped.clock.sleep(_READ_S)
    request.vanish(reset=promised is None)
    return Tried("incomplete", "a move of which some bytes were not sent", None)
