"""Attempts that must not move a device at rest: beyond its limits, invalid, incomplete, without credentials."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final
from urllib.parse import quote

from conformance.measures.samples import SEVERAL
from conformance.scenarios.motion.mapped import STAYS_S, MappedDevice
from conformance.scenarios.motion.moves import beyond
from conformance.scenarios.motion.resting import fastest
from conformance.scenarios.motion.trace import Quiet, Reading, Tried
from conformance.scenarios.scenario import (
    NotDeclaredError,
    NotPossibleError,
    PartialTraceError,
    partial_trace,
    scenario,
)
from conformance.scenarios.stage import Need, Stage
from conformance.statement.motion_map import Axis, Goto, Speed, Velocity
from conformance.transport.exchange import NoAnswerError, Outgoing
from conformance.transport.raw import PartialRequest

# How long the suite waits for the effect of an attempt at rest, beyond the settle time, s.
_EFFECT_S: Final = 2.0
# Parts of a body to send: share, bytes that Content-Length promises in excess (None: chunked, without the last chunk),
# and whether a reset ends the connection.
_PARTS: Final = ((0.5, 0, True), (1.0, 10, True), (1.0, 10, False), (1.0, None, True))
# How long a server gets to read the sent part of a request, s.
_READ_S: Final = 0.03


# Function that makes attempts, and yields each when it is made.
Attempts = Callable[[], Iterable[Tried]]


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.STANDSTILL)
def attempts_at_rest(mapped: MappedDevice) -> Quiet:
    """Send requests to a device at rest that must not move it, and watch. If it moves, try each again alone."""
    _settle(mapped)
    return tried_at_rest(mapped, list(_tries(mapped)), partial(_settle, mapped), _effect_s(mapped))


def tried_at_rest(
    mapped: MappedDevice,
    several: Sequence[Attempts],
    settle: Callable[[], object],
    effect_s: float,
    beside: Callable[[], str] = str,
) -> Quiet:
    """Make attempts at rest, read after each, and watch. If the device moves, make some at a time again, then none.

    Args:
        mapped: the device.
        several: make the attempts; those of one function are made again together, until one has moved the device.
        settle: brings the device to rest.
        effect_s: for how long the device is watched after the last attempt, s.
        beside: returns what an attempt has changed beside the motion, empty if nothing; called after each watch.

    Raises:
        PartialTraceError: the device does not come to rest again, or there is no response.
    """
    quiet = _quiet(mapped, several, settle, effect_s, beside)
    if not _has_moved(mapped, quiet):
        return quiet
    # Refused requests rarely move a device, so most attempts are watched together.
    alone, left = list[Quiet](), list(filter(None, (several[:-1], several[-1:])))
    try:
        while left:
            settle()
            again = _quiet(mapped, group := left.pop(0), None, effect_s, beside)
            if len(group) > 1 and _has_moved(mapped, again):
                left[:0] = [group[: len(group) // 2], group[len(group) // 2 :]]
            else:
                alone.append(again)
        _let_rest(mapped, settle)
        quiet = replace(quiet, idle=_quiet(mapped, [], None, effect_s, beside))
        settle()
    except (NoAnswerError, NotPossibleError, PartialTraceError) as error:
        raise PartialTraceError(replace(quiet, alone=tuple(alone))) from error.__cause__ or error
    return replace(quiet, alone=tuple(alone))


def _let_rest(mapped: MappedDevice, settle: Callable[[], object]) -> None:
    """Wait until a device without positions rests by itself, as it may move again after a stop; else ``settle``."""
    if mapped.motion.goto is None:
        with suppress(NotPossibleError):
            mapped.come_to_rest(stop=False)
            return
    settle()


def _settle(mapped: MappedDevice) -> None:
    """Bring the device home and to rest: one that has arrived may still turn."""
    mapped.bring_home()
    velocity = mapped.motion.velocity
    if velocity is not None:
        # A velocity may be this late where it is read directly; where positions show it, coming to rest takes part of
        # that time.
        mapped.clock.sleep(velocity.settle_s - (STAYS_S if mapped.motion.state.axes else 0.0))
        mapped.come_to_rest()


def _quiet(
    mapped: MappedDevice,
    several: Sequence[Attempts],
    settle: Callable[[], object] | None,
    effect_s: float,
    beside: Callable[[], str],
) -> Quiet:
    """Make attempts, and watch. One that moves the device at once: ``settle``, or without that make no further one."""
    where, tried, readings = mapped.where(), list[Tried](), list[Reading]()
    home = mapped.home if mapped.motion.goto else {}
    with partial_trace(lambda: Quiet(where, tuple(tried), tuple(readings), home=home)):
        for attempt in itertools.chain.from_iterable(each() for each in several):
            tried.append(attempt)
            seen = _glance(mapped)
            readings += seen
            if fastest(seen, mapped.motion, rested=True):
                if settle is None:
                    break
                settle()
        readings += mapped.watch(mapped.clock.now() + effect_s)
        return Quiet(where, tuple(tried), tuple(readings), home=home, beside=beside())


def _glance(mapped: MappedDevice) -> list[Reading]:
    """Read the device once; if it seems to move, read again until that is certain."""
    seen = [mapped.read(at_once=True)]
    while len(seen) < SEVERAL and fastest(seen[-1:] * SEVERAL, mapped.motion, rested=True):
        seen.append(mapped.read())
    return seen


def _effect_s(mapped: MappedDevice) -> float:
    """Return how long the effect of an attempt is awaited, s."""
    move, velocity = mapped.motion.goto, mapped.motion.velocity
    moves_s = min(mapped.takes_s, _EFFECT_S) + move.settle_s if move else 0.0
    drives_s = min(velocity.hold_s or _EFFECT_S, _EFFECT_S) + velocity.settle_s if velocity else 0.0
    return max(moves_s, drives_s)


def _has_moved(mapped: MappedDevice, quiet: Quiet) -> bool:
    def rests(here: Mapping[str, float]) -> bool:
        return mapped.is_near(here, quiet.where) or bool(quiet.home and mapped.is_near(here, quiet.home))

    elsewhere = any(reading.values and not rests(reading.values) for reading in quiet.readings)
    return elsewhere or bool(fastest(quiet.readings, mapped.motion, rested=True) or quiet.beside)


def _tries(mapped: MappedDevice) -> Iterator[Attempts]:
    """Yield functions that make attempts of one kind each, with moves and with velocities."""
    move, velocity = mapped.motion.goto, mapped.motion.velocity
    if not (move or velocity):
        raise NotDeclaredError("the map has neither [motion.goto] nor [motion.velocity]")
    if move:
        yield from _tries_of(_Sender(mapped, move, mapped.motion.state.axes, "a move"))
    if velocity:
        yield from _tries_of(_Sender(mapped, velocity, velocity.axes, "a velocity"))


def _tries_of(sender: _Sender) -> Iterator[Attempts]:
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
    lease = sender.mapped.motion.lease
    if lease and (lease.header or "{lease}" in f"{sender.given.send} {sender.given.body}"):
        yield partial(sender.send_without_lease, away)
    if sender.given.body is not None:
        if "form" not in sender.mapped.request_of(sender.given, away).media_type:  # almost any text is a valid form
            yield partial(sender.send_broken, away)
        yield partial(sender.vanish, away)


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

    def send(self, kind: str, what: str, values: dict[str, Any], *, authorized: bool = True) -> Iterator[Tried]:
        """Send a command."""
        made = self.mapped.request_of(self.given, values, authorized=authorized)
        exchange = self.mapped.send(made, authorized=authorized)
        yield Tried(kind, what, exchange, self.mapped.has_failed(exchange))

    def send_without_lease(self, values: dict[str, Any]) -> Iterator[Tried]:
        """Send a command of a client that has no lease, and of one with a token that is not the lease."""
        made, lease = self.mapped.request_of(self.given, values), self.mapped.ready.lease
        others = {"": "without", lease[::-1]: "with a token that is not"}
        for other, how in ((other, how) for other, how in others.items() if other != lease):
            target = made.target.replace(quote(lease, safe=""), quote(other, safe=""))
            body, texts = made.body.replace(lease.encode(), other.encode()), {lease: other}
            headers = tuple((name, text) for name, value in made.headers if (text := texts.get(value, value)))
            exchange = self.mapped.api.client.send(made.method, target, headers=headers, body=body)
            what = f"{self.what} {how} the lease"
            yield Tried("unauthorised", what, exchange, self.mapped.has_failed(exchange))

    def send_broken(self, values: dict[str, Any]) -> Iterator[Tried]:
        """Send a command whose body is not in its syntax."""
        made = self.mapped.request_of(self.given, values)
        exchange = self.mapped.send(replace(made, body=made.body + b"}"))
        what = f"{self.what} whose body is not {self.mapped.binding.syntax}"
        yield Tried("invalid", what, exchange, self.mapped.has_failed(exchange))

    def vanish(self, values: dict[str, Any]) -> Iterator[Tried]:
        """Send parts of a command, and close their connections."""
        return send_in_parts(self.mapped, self.mapped.request_of(self.given, values), self.what)


def send_in_parts(mapped: MappedDevice, made: Outgoing, what: str) -> Iterator[Tried]:
    """Send parts of a request and close the connections; ``what``: the commanded move as a noun phrase."""
    begun = []
    for share, lacking, _ in _PARTS:
        body, promised = made.body[: int(share * len(made.body))], None if lacking is None else len(made.body) + lacking
        connection = mapped.api.client, made.method, made.target
        begun.append(PartialRequest(*connection, sent=body, promised=promised, headers=made.headers))
    mapped.clock.sleep(_READ_S)
    for request, (*_, reset) in zip(begun, _PARTS, strict=True):
        request.vanish(reset=reset)
    yield Tried("incomplete", f"{what} of which some bytes were not sent", None)
