"""Attempts that must not move a device at rest: beyond its limits, invalid, incomplete, without credentials."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Final

from conformance.api.rest.validity import INVALID, validity
from conformance.scenarios.motion.mapped import MappedDevice
from conformance.scenarios.motion.moves import beyond
from conformance.scenarios.motion.trace import Quiet, Tried
from conformance.scenarios.scenario import NotPossibleError, PartialTraceError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import NoAnswerError
from conformance.transport.incomplete_request import PartialRequest

# For so long the effect of an attempt at rest is awaited at most, without the time to settle, s.
_EFFECT_S: Final = 2.0
# For so long a server has time to read the part of a request that was sent, s.
_READ_S: Final = 0.03


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STANDSTILL)
def attempts_at_rest(mapped: MappedDevice) -> Quiet:
    """At rest, send what must move nothing, watch once, and if the device moves, try each again alone."""
    mapped.bring_home()
    tries = list(_tries(mapped))
    quiet = _quiet(mapped, tries)
    if not _moved(mapped, quiet):
        return quiet
    alone: list[Quiet] = []
    try:
        for one in tries:
            mapped.bring_home()
            alone.append(_quiet(mapped, [one]))
        mapped.bring_home()
    except (NoAnswerError, NotPossibleError) as error:
        raise PartialTraceError(replace(quiet, alone=tuple(alone))) from error
    return replace(quiet, alone=tuple(alone))


def _quiet(mapped: MappedDevice, tries: list[Callable[[], Tried]]) -> Quiet:
    where = mapped.where()
    tried = tuple(one() for one in tries)
    readings = mapped.watch(mapped.clock.now() + min(mapped.takes_s, _EFFECT_S) + mapped.motion.goto.settle_s)
    return Quiet(where, tried, tuple(readings))


def _moved(mapped: MappedDevice, quiet: Quiet) -> bool:
    return any(one.values and not mapped.is_near(one.values, quiet.where) for one in quiet.readings)


def _tries(mapped: MappedDevice) -> Iterator[Callable[[], Tried]]:
    """Yield functions that make one attempt each."""
    goto, axes = mapped.motion.goto, mapped.motion.state.axes
    if goto.beyond_limits == "refused":
        for name, _, value in beyond(mapped):
            yield partial(_send, mapped, "beyond", f"{name} {value:g}, beyond its limit", {name: value})
    for name, axis in axes.items():
        values: tuple[tuple[str, Any], ...] = (
            (f'the text "far" as {name}', "far"),
            (f"a list as {name}", [axis.limits[1]]),
        )
        for what, value in values:
            if _is_invalid(mapped, {name: value}):
                yield partial(_send, mapped, "invalid", what, {name: value})
    first, axis = next(iter(axes.items()))
    away = {first: axis.limits[1]}
    if mapped.api.client.connection.credentials.items:
        yield partial(_send, mapped, "unauthorised", "a move without credentials", away, authorized=False)
    if goto.body is not None:
        yield partial(_send_broken, mapped, away)
        for promised in (10, None):
            yield partial(_vanish, mapped, away, promised)


def _is_invalid(mapped: MappedDevice, targets: dict[str, Any]) -> bool:
    """Return whether the description forbids a move."""
    method, path, fields, octets = mapped.request_of(targets)
    media_type = "application/json" if fields else ""
    return validity(mapped.api.run.contract, method, path, media_type, octets).verdict == INVALID


def _send(mapped: MappedDevice, kind: str, what: str, targets: dict[str, Any], *, authorized: bool = True) -> Tried:
    method, path, fields, octets = mapped.request_of(targets)
    exchange = mapped.api.client.send(method, path, headers=fields, body=octets, authorized=authorized)
    return Tried(kind, what, exchange)


def _send_broken(mapped: MappedDevice, targets: dict[str, Any]) -> Tried:
    method, path, fields, octets = mapped.request_of(targets)
    exchange = mapped.api.client.send(method, path, headers=fields, body=octets + b"}")
    return Tried("invalid", "a body that is not JSON", exchange)


def _vanish(mapped: MappedDevice, targets: dict[str, Any], promised: int | None) -> Tried:
    """Send a move of which some bytes are missing, and close the connection."""
    method, path, _, octets = mapped.request_of(targets)
    whole = None if promised is None else len(octets) + promised
    request = PartialRequest(mapped.api.client, method, path, sent=octets, promised=whole)
    mapped.clock.sleep(_READ_S)
    request.vanish(reset=promised is None)
    return Tried("incomplete", "a move of which some bytes were not sent", None)
