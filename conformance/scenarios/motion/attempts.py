"""Attempts that must not move a device at rest: beyond its limits, invalid, incomplete, without credentials."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

from conformance.scenarios.motion.mapped import STAYS_S, MappedDevice
from conformance.scenarios.motion.moves import beyond
from conformance.scenarios.motion.resting import fastest
from conformance.scenarios.motion.trace import Quiet, Tried
from conformance.scenarios.scenario import NotDeclaredError, NotPossibleError, PartialTraceError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.statement.motion_map import Axis, Goto, Speed, Velocity
from conformance.transport.exchange import NoAnswerError
from conformance.transport.raw import PartialRequest

# Longest wait for the effect of an attempt at rest, beside the time to settle, s.
_EFFECT_S: Final = 2.0
# Time that a server has to read the sent part of a request, s.
_READ_S: Final = 0.03


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STANDSTILL)
def attempts_at_rest(mapped: MappedDevice) -> Quiet:
    """At rest, send what must move nothing, and watch. If the device moves, try each again alone, and then nothing."""
    _settle(mapped)
    tries = list(_tries(mapped))
    quiet = _quiet(mapped, tries)
    if not _moved(mapped, quiet):
        return quiet
    alone: list[Quiet] = []
    try:
        for one in tries:
            _settle(mapped)
            alone.append(_quiet(mapped, [one]))
        _settle(mapped)
        quiet = replace(quiet, idle=_quiet(mapped, []))
        mapped.bring_home()
    except (NoAnswerError, NotPossibleError) as error:
        raise PartialTraceError(replace(quiet, alone=tuple(alone))) from error
    return replace(quiet, alone=tuple(alone))


def _settle(mapped: MappedDevice) -> None:
    """Bring the device home and to rest: one that has arrived may still turn."""
    mapped.bring_home()
    velocity = mapped.motion.velocity
    if velocity is not None:
        # A velocity that is read may come so late; by positions, coming to rest takes a part of that.
        mapped.clock.sleep(velocity.settle_s - (STAYS_S if mapped.motion.state.axes else 0.0))
        mapped.come_to_rest()


def _quiet(mapped: MappedDevice, tries: list[Callable[[], Tried]]) -> Quiet:
    where = mapped.where()
    tried = tuple(one() for one in tries)
    readings = mapped.watch(mapped.clock.now() + _effect_s(mapped))
    return Quiet(where, tried, tuple(readings), home=mapped.home if mapped.motion.goto else {})


def _effect_s(mapped: MappedDevice) -> float:
    """Return how long the effect of an attempt is awaited, s."""
    move, velocity = mapped.motion.goto, mapped.motion.velocity
    moves_s = min(mapped.takes_s, _EFFECT_S) + move.settle_s if move else 0.0
    drives_s = min(velocity.hold_s or _EFFECT_S, _EFFECT_S) + velocity.settle_s if velocity else 0.0
    return max(moves_s, drives_s)


def _moved(mapped: MappedDevice, quiet: Quiet) -> bool:
    def rests(here: Mapping[str, float]) -> bool:
        return mapped.is_near(here, quiet.where) or bool(quiet.home and mapped.is_near(here, quiet.home))

    elsewhere = any(one.values and not rests(one.values) for one in quiet.readings)
    return elsewhere or bool(fastest(quiet.readings, mapped.motion))


def _tries(mapped: MappedDevice) -> Iterator[Callable[[], Tried]]:
    """Yield functions that make one attempt each, with moves and with velocities."""
    move, velocity = mapped.motion.goto, mapped.motion.velocity
    if not (move or velocity):
        raise NotDeclaredError("the map has neither [motion.goto] nor [motion.velocity]")
    if move:
        yield from _tries_of(_Sender(mapped, move, mapped.motion.state.axes, "a move"))
    if velocity:
        yield from _tries_of(_Sender(mapped, velocity, velocity.axes, "a velocity"))


def _tries_of(sender: _Sender) -> Iterator[Callable[[], Tried]]:
    if sender.given.beyond_limits == "refused":
        for name, _, value in beyond(sender.axes):
            yield partial(sender.send, "beyond", f"{name} {value:g}, beyond its limit", {name: value})
    for name, axis in sender.axes.items():
        values: tuple[tuple[str, Any], ...] = (
            (f'the text "far" as {name}', "far"),
            (f"a list as {name}", [axis.limits[1]]),
        )
        for what, value in values:
            if sender.is_invalid({name: value}):
                yield partial(sender.send, "invalid", what, {name: value})
    first, axis = next(iter(sender.axes.items()))
    away = {first: axis.limits[1]}
    if sender.mapped.binding.has_credentials:
        yield partial(sender.send, "unauthorised", f"{sender.what} without credentials", away, authorized=False)
    if sender.given.body is not None:
        if not sender.is_form(away):  # nearly every text is a form
            yield partial(sender.send_broken, away)
        for promised in (10, None):
            yield partial(sender.vanish, away, promised)


@dataclass(frozen=True)
class _Sender:
    """Sends commands of one kind that must move nothing.

    Attributes:
        mapped: the device.
        given: how such a command is sent.
        axes: what it commands.
        what: "a move" or "a velocity".
    """

    mapped: MappedDevice
    given: Goto | Velocity
    axes: Mapping[str, Axis | Speed]
    what: str

    def is_invalid(self, values: dict[str, Any]) -> bool:
        """Return whether the description forbids a command."""
        return self.mapped.binding.forbids(*self.mapped.call_of(self.given, values))

    def is_form(self, values: dict[str, Any]) -> bool:
        """Return whether a command is written as a form."""
        return "form" in self.mapped.request_of(self.given, values).media_type

    def send(self, kind: str, what: str, values: dict[str, Any], *, authorized: bool = True) -> Tried:
        """Send a command."""
        made = self.mapped.request_of(self.given, values, authorized=authorized)
        exchange = self.mapped.send(made, authorized=authorized)
        return Tried(kind, what, exchange, self.mapped.has_failed(exchange))

    def send_broken(self, values: dict[str, Any]) -> Tried:
        """Send a command whose body is not in its syntax."""
        made = self.mapped.request_of(self.given, values)
        exchange = self.mapped.send(replace(made, body=made.body + b"}"))
        what = f"{self.what} whose body is not {self.mapped.binding.syntax}"
        return Tried("invalid", what, exchange, self.mapped.has_failed(exchange))

    def vanish(self, values: dict[str, Any], promised: int | None) -> Tried:
        """Send a command of which some bytes are missing, and close the connection."""
        made = self.mapped.request_of(self.given, values)
        whole = None if promised is None else len(made.body) + promised
        client = self.mapped.api.client
        request = PartialRequest(client, made.method, made.target, sent=made.body, promised=whole, headers=made.headers)
        self.mapped.clock.sleep(_READ_S)
        request.vanish(reset=promised is None)
        return Tried("incomplete", f"{self.what} of which some bytes were not sent", None)
