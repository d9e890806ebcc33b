"""Scenarios that move a device by its motion map: targets, stops, new targets, several clients."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, TypeVar

from conformance.documents.openapi import matching
from conformance.scenarios.motion.driving import with_room
from conformance.scenarios.motion.mapped import STAYS_S, MappedDevice, Position
from conformance.scenarios.motion.trace import Command, Leg, Reading
from conformance.scenarios.scenario import NotDeclaredError, NotPossibleError, NotSeenError, PartialTraceError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.statement.motion_map import Axis, Speed
from conformance.transport.exchange import NoAnswerError, NotPermittedError
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

_NEEDS: Final = (Need.REST, Need.MOTION)
_Part = TypeVar("_Part")
# Share of the way after which a device is stopped, or gets another target.
_UNDER_WAY: Final = 0.3
#: How often a measurement is tried that a slow link or a loaded machine has spoilt.
TRIES: Final = 3
# After a stop, the device is watched for the time of its remaining way: at least _AT_LEAST_S after it must rest, at
# most _AT_MOST_S, s.
_AT_LEAST_S: Final = 1.5
_AT_MOST_S: Final = 5.0
_LONGER_S = 0.5  # time added to that of a move which another move replaces, s
_LONGEST_S = 1.5  # the same where the move's own resource is read: a device ends a move a while after it arrives, s
_COMMANDS: Final = 100  # moves in a row
# A velocity with a longer hold time is always ended by a stop, s.
_SHORT_HOLD_S: Final = 2.0
_SURELY: Final = 1.5  # factor on the time that the finished part of the first move predicts for the whole
_SET_OUT: Final = 0.1  # the part before this share does not count, as a device may have to turn before it sets out
# Length of a way that is long enough for a stop under way, in tolerances.
_LONG: Final = 12
# How far beyond the limits forbidden targets lie, as shares of an axis's range.
_BEYOND: Final = (0.05, 0.5)


def record_parts(made: Iterable[_Part]) -> tuple[_Part, ...]:
    """Return the legs or drives of a generator, keeping those made before an error.

    Raises:
        PartialTraceError: there was no response; what was recorded before is kept.
    """
    found: list[_Part] = []
    try:
        found.extend(made)
    except (NoAnswerError, NotPossibleError) as error:
        raise PartialTraceError(tuple(found)) from error
    return tuple(found)


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def targets(mapped: MappedDevice, effort: Effort, run: Run) -> tuple[Leg, ...]:
    """Send the device to the limits of its axes; at quick all at once, at standard also back and at random."""
    return record_parts(_to_targets(mapped, effort, run.seed))


def _to_targets(mapped: MappedDevice, effort: Effort, seed: int) -> Iterator[Leg]:
    axes = mapped.motion.state.axes
    chance = random.Random(f"{seed}/targets")  # noqa: S311 - no secret
    yield mapped.go("where the suite begins", {})
    if effort.name == "quick":
        # One axis at its least and the next at its greatest, so that exchanged axes show.
        for side in (0, 1):
            ends = {name: axis.limits[(number + side) % 2] for number, (name, axis) in enumerate(axes.items())}
            yield mapped.go("a limit of each axis" if side else "the other limit of each axis", ends)
        return
    for name, axis in axes.items():
        for limit in axis.limits:
            yield mapped.go(f"a limit of {name}", {name: limit})
        yield mapped.go(f"{name} back", {})
    for _ in range(effort.cases(3)):
        yield mapped.go(
            "all axes", {name: axis.within(round(chance.uniform(*axis.limits), 3)) for name, axis in axes.items()}
        )


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def clamped_targets(mapped: MappedDevice) -> tuple[Leg, ...]:
    """Send the device beyond its limits, if the map declares that it clamps targets."""
    if mapped.moves.beyond_limits != "clamped":
        raise NotDeclaredError("the map does not say that targets beyond the limits are clamped")
    mapped.bring_home()
    return record_parts(
        mapped.go(f"{name} {value:g}, beyond its limit", {name: value}, {name: limit})
        for name, limit, value in beyond(mapped.motion.state.axes)
    )


def beyond(axes: Mapping[str, Axis | Speed]) -> Iterator[tuple[str, float, float]]:
    """Yield axes, their limits, and targets or velocities beyond them; an axis that turns freely has none."""
    for name, axis in axes.items():
        if isinstance(axis, Axis) and axis.angle:
            continue
        least, most = axis.ends if isinstance(axis, Axis) else axis.limits
        for part in _BEYOND:
            room = part * (most - least)
            yield name, least, least - room
            yield name, most, most + room


@dataclass(frozen=True)
class _Way:
    """A move under way: where it began, its command, the readings since, and a target behind where it began."""

    start: Position
    command: Command
    readings: list[Reading]
    behind: Position

    def lasts_s(self, name: str) -> float:
        """Return how long the way along an axis may take, by the part that is done since the device set out, s."""
        seen = [(one.received, abs(one.values[name] - self.start[name])) for one in self.readings if one.values]
        done = seen[-1][1] if seen else 0.0
        if not done:
            return math.inf
        begun = next(moment for moment, gone in seen if gone >= _SET_OUT * done)
        way = abs(self.command.targets[name] - self.start[name])
        return begun - self.command.sent + _SURELY * way / done * (seen[-1][0] - begun)


def _axes(mapped: MappedDevice, effort: Effort) -> list[str]:
    """Return the axes that are moved one by one, the longest (in tolerances) first; at quick only that one."""
    axes, tolerance = mapped.motion.state.axes, mapped.motion.tolerance
    ranked = sorted(
        axes, key=lambda name: (axes[name].limits[0] - axes[name].limits[1]) / (tolerance(name) or math.inf)
    )
    return ranked[:1] if effort.name == "quick" else ranked


def _way(mapped: MappedDevice, name: str, share: float = _UNDER_WAY) -> _Way:
    """Move to the farther end of an axis, first to the other end if needed; return when a share of the way is done."""
    if not mapped.rests:
        mapped.saw_rest(mapped.watch(mapped.clock.now() + STAYS_S))
    axes = mapped.motion.state.axes
    start, (begin, end) = mapped.where(), axes[name].limits
    if abs(start[name] - begin) > abs(start[name] - end):
        begin, end = end, begin
    if not mapped.rests or abs(end - start[name]) < _LONG * mapped.motion.tolerance(name):
        mapped.go("one end", {name: begin})
        start = mapped.where()
    # The other axes stay in place.
    beside = {other: start[other] if axis.angle else axis.within(start[other]) for other, axis in axes.items()}
    command = mapped.goto({**beside, name: end})
    part = abs(end - start[name]) * share
    seen = mapped.watch(
        command.answered + mapped.takes_s,
        lambda so_far: bool(so_far[-1].values) and abs(so_far[-1].values[name] - start[name]) >= part,
    )
    return _Way(start, command, seen, {**beside, name: begin})


@scenario(needs=_NEEDS, stage=Stage.MOTION)
def stops(mapped: MappedDevice, effort: Effort) -> tuple[Leg, ...]:
    """Stop the device under way, and watch it for as long as the rest of the way would have taken, and longer."""
    stop = mapped.motion.stop
    return record_parts(_to_stops(mapped, effort, stop.rests_within_s)) if stop and mapped.moves else ()


def _to_stops(mapped: MappedDevice, effort: Effort, rests_s: float) -> Iterator[Leg]:
    for name in _axes(mapped, effort):
        part = _UNDER_WAY
        for _ in range(TRIES):
            leg = _stop_under_way(mapped, name, part, rests_s)
            # Judge each try: if every second stop is late, the discarded try may be the late one.
            yield leg
            goal, tolerance = leg.commands[0].targets, mapped.motion.tolerance(name)
            under_way = leg.was_under_way(name, tolerance) or not mapped.is_near(leg.readings[-1].values, goal)
            if under_way and not leg.commands[1].was_late(leg.readings):
                break
            # One that arrives sooner than it is seen on its way is stopped at once in the end.
            part = part if under_way else part / TRIES if part == _UNDER_WAY else 0.0


def _stop_under_way(mapped: MappedDevice, name: str, part: float, rests_s: float) -> Leg:
    _drive_before(mapped)
    way = _way(mapped, name, part)
    stop = mapped.stop()
    if stop is None:
        raise NotPossibleError("the stop names a value that the response to the move does not have")
    # One that is not seen under way must be seen to stay short of its target.
    most_s = _AT_MOST_S if part else math.inf
    until = min(mapped.due(stop), stop.answered + most_s, way.command.answered + way.lasts_s(name))
    seen = way.readings + mapped.watch(max(until, stop.answered + rests_s + _AT_LEAST_S))
    return Leg(
        f"a stop of {name} under way", way.start, (way.command, stop), tuple(seen), mapped.due(stop), mapped.resting
    )


def _drive_before(mapped: MappedDevice) -> None:
    """Drive a little and let go: a device that is stopped later must not take this velocity up again."""
    velocity = mapped.motion.velocity
    if velocity is not None and velocity.hold_s is not None and velocity.hold_s <= _SHORT_HOLD_S:
        name, axis = next(iter(velocity.axes.items()))
        half = with_room(mapped, [{name: axis.limits[1] / 2}], velocity.hold_s + velocity.settle_s)
        last = mapped.drive(half[0])
        mapped.clock.sleep(last.answered + velocity.hold_s - mapped.clock.now())
        mapped.come_to_rest(stop=False)  # velocity 0 would be the last command


@scenario(needs=_NEEDS, stage=Stage.MOTION)
def new_targets(mapped: MappedDevice, effort: Effort, run: Run) -> tuple[Leg, ...]:
    """Send the device back under way, and watch for as long as the first move would have taken, and longer."""
    need_positions(mapped)
    return record_parts(_to_new_targets(mapped, effort, run))


def need_positions(mapped: MappedDevice) -> None:
    """Check that a move names its end: the end of several relative moves is unknown.

    Raises:
        NotDeclaredError: it does not.
    """
    if mapped.moves.relative:
        raise NotDeclaredError("moves are relative: where they end when they come together, nobody declares")


def _to_new_targets(mapped: MappedDevice, effort: Effort, run: Run) -> Iterator[Leg]:
    path = mapped.moves.send.partition(" ")[2]
    has_get = run.contract is not None and matching(run.contract, "GET", path) is not None
    is_late = False
    longer_s = _LONGEST_S if has_get else _LONGER_S

    def ask(_: object) -> None:
        """Read the move's own resource, as a client does that waits for its end."""
        with suppress(NotPermittedError):
            if has_get:
                mapped.get(f"GET {path}")

    for name, share in itertools.product(_axes(mapped, effort), (_UNDER_WAY, _UNDER_WAY / TRIES, 0.0)):
        if share != _UNDER_WAY and not is_late:
            continue
        way = _way(mapped, name, share)
        second = mapped.goto(way.behind)
        first_s = min(mapped.takes_s, way.lasts_s(name))
        followed, due = mapped.follow_several([way.command, second])
        seen = way.readings + followed
        seen += mapped.watch(max(mapped.clock.now(), way.command.answered + first_s) + longer_s, ask)
        yield Leg(f"back, with {name} under way", way.start, (way.command, second), tuple(seen), due)
        # One that takes its moves one at a time may have ended the first before it got the second.
        is_late = mapped.moves.while_moving == "refused" and second.is_ok


@scenario(needs=_NEEDS, stage=Stage.MOTION)
def many_commands(mapped: MappedDevice, effort: Effort) -> Leg:
    """Send many targets in a row, without waiting for any of them."""
    need_positions(mapped)
    name, axis = next(iter(mapped.motion.state.axes.items()))
    # The last target is far away, so that the device visibly moves to it.
    far = int(abs(axis.limits[1] - mapped.where()[name]) > abs(axis.limits[0] - mapped.where()[name]))
    ends = [axis.limits[(far + turn) % 2] for turn in reversed(range(effort.cases(_COMMANDS)))]
    return _in_a_row(mapped, f"{len(ends)} targets in a row", [{name: end} for end in ends])


@scenario(needs=_NEEDS, stage=Stage.MOTION)
def repeated(mapped: MappedDevice) -> Leg:
    """Send one move twice, as a client does that tries again."""
    need_positions(mapped)
    name, axis = next(iter(mapped.motion.state.axes.items()))
    here = mapped.where()[name]
    return _in_a_row(
        mapped, "a move that was sent twice", [{name: max(axis.limits, key=lambda end: abs(end - here))}] * 2
    )


def _in_a_row(mapped: MappedDevice, what: str, wanted: list[Position]) -> Leg:
    """Send targets in a row, and follow the last one that is accepted."""
    start = mapped.where()
    commands = [mapped.goto(item) for item in wanted]
    last = next((command for command in reversed(commands) if command.is_ok), commands[-1])
    seen, due = mapped.follow_several(commands)
    if seen and not mapped.is_near(seen[-1].values, last.targets):
        need_reached_alone(mapped, start, last.targets)
    return Leg(what, start, tuple(commands), tuple(seen), due)


def need_reached_alone(mapped: MappedDevice, start: Position, target: Position) -> None:
    """Send a target that was not reached among others alone from the same place: axes may limit each other.

    Raises:
        NotSeenError: it is not reached then either.
    """
    mapped.go("back", start)
    seen = mapped.go("alone", target).readings
    if not (seen and mapped.is_near(seen[-1].values, target)):
        raise NotSeenError("the target is not reached from here when it is sent alone either")
