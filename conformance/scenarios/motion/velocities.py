"""Scenarios that give a device velocities by its motion map: at the limits and between, ended by zero or let go."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Final

from conformance.measures.samples import SEVERAL, longest_s
from conformance.scenarios.motion.driving import with_room
from conformance.scenarios.motion.mapped import MappedDevice, Position
from conformance.scenarios.motion.moves import TRIES, beyond, recorded
from conformance.scenarios.motion.resting import creeping
from conformance.scenarios.motion.trace import Command, Drive, Reading
from conformance.scenarios.scenario import NotDeclaredError, NotPossibleError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.statement.motion_map import Way
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

_NEEDS: Final = (Need.REST, Need.MOTION)
_By = tuple[Way | None, ...]
# For so long a velocity is measured once it must be reached, s.
MEASURED_S: Final = 0.5
# Of the limit: a slow velocity, and the slowest.
_SLOW: Final = 0.4
_SLOWEST: Final = 0.1
# So many times its tolerance a velocity is at least, to be told from rest.
_TOLD: Final = 1.5
# A slow drive lasts longer than the hold time, up to this, so that a renewed command is seen to last, s.
_LONGEST_HOLD_S: Final = 2.0
# After these parts of the hold time commands that must be refused follow the last one: after the first the device is
# seen to drive on, and the second renews nothing.
_REFUSED_AT: Final = (0.1, 0.9)
# A device is told its velocity that often within its hold time, at least every so many s.
_KEPT: Final = 3
_KEPT_S: Final = 0.1
# After the time to rest it is watched for so long, s.
_REST_S: Final = 0.5
# So long one is watched that still moves a little: one that creeps does so on and on, s.
_SLOWS_S: Final = 2.0
# And by at most so many readings more.
_MORE: Final = 50
# The speed is learned from so many readings.
_NOTED: Final = 50


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def velocities(mapped: MappedDevice, effort: Effort, run: Run) -> tuple[Drive, ...]:
    """Drive each axis at its limits and slowly, there and back, and two at once; end each drive with velocity 0.

    At quick each axis at its limits, and slowly two at once, or the only one back; the seed says in which of several
    ways. At standard each way drives each axis there and back, and beside another axis that it must leave alone.
    """
    chosen = _chosen(mapped, run.seed, quick=effort.name == "quick")
    return recorded(
        drive
        for speeds, longer, by in chosen
        for drive in _drives(mapped, _named(speeds, by), speeds, longer=longer, by=by)
    )


def _chosen(mapped: MappedDevice, seed: int, *, quick: bool) -> Iterator[tuple[Position, bool, _By]]:
    """Yield velocities, whether they are to outlast the hold time, and the ways in which they are commanded in turn."""
    for number, (speeds, longer) in enumerate(_planned(mapped, quick=quick), seed):
        yield speeds, longer, _in_turn(mapped, speeds, number) if quick else ()
    if not quick:
        yield from ((speeds, False, by) for speeds, by in _by_each_way(mapped))


def _by(way: Way, speeds: Position) -> _By:
    """Return the ways in which velocities are commanded in turn, so that the last commands at least a part of them."""
    return (way,) if {name for name, speed in speeds.items() if speed} <= way.axes else (None, way)


def _in_turn(mapped: MappedDevice, speeds: Position, number: int) -> _By:
    """Return one of the ways in which velocities can be commanded."""
    ways = [way for way in mapped.drives.ways if way.axes & speeds.keys()]
    return ((), *(_by(way, speeds) for way in ways))[number % (1 + len(ways))]


def _by_each_way(mapped: MappedDevice) -> Iterator[tuple[Position, _By]]:
    """Yield velocities for each further way to command one: of each axis alone, and of two at once."""
    for way in mapped.drives.ways:
        several = [{name: _SLOW * limit} for name, limit in _ends(mapped) if name in way.axes]
        several += [one for one in _at_once(mapped) if one.keys() & way.axes]
        yield from ((speeds, _by(way, speeds)) for speeds in several)


def _ends(mapped: MappedDevice) -> Iterator[tuple[str, float]]:
    for name, axis in mapped.drives.axes.items():
        yield from ((name, limit) for limit in _there_and_back(mapped, axis.limits, axis.of))


def _planned(mapped: MappedDevice, *, quick: bool) -> Iterator[tuple[Position, bool]]:
    """Yield velocities, and whether they are to outlast the hold time."""
    several = list(_at_once(mapped))
    for name, axis in mapped.drives.axes.items():
        ends = list(_there_and_back(mapped, axis.limits, axis.of))
        yield from (({name: limit}, False) for limit in ends)
        slow = ends[-1:] if quick else ends
        yield from (({name: _SLOW * limit}, True) for limit in slow if not (quick and several))
    yield from ((speeds, not number) for number, speeds in enumerate(several[:1] if quick else several))


def _at_once(mapped: MappedDevice) -> Iterator[Position]:
    """Yield velocities of the first two axes at once, in each direction, so slow that no wheel limits them."""
    two = list(mapped.drives.axes.items())[:2]
    if len(two) > 1:
        for ends in itertools.product(*(filter(None, axis.limits) for _, axis in two)):
            yield {name: _SLOW * end for (name, _), end in zip(two, ends, strict=True)}


def _slowest(mapped: MappedDevice, name: str, limit: float) -> Position:
    """Return a velocity that is just fast enough to be told from rest."""
    least = _TOLD * mapped.motion.speed_tolerance(name)
    return {name: math.copysign(min(max(_SLOWEST * abs(limit), least), _SLOW * abs(limit)), limit)}


def _named(speeds: Position, by: _By = ()) -> str:
    way = next((f" by {one.send}" + (" as XML" if one.root else "") for one in by if one), "")
    return " and ".join(f"{name} {speed:g}" for name, speed in speeds.items()) + way


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def clamped_velocities(mapped: MappedDevice) -> tuple[Drive, ...]:
    """Command velocities beyond the limits, where the map says that the device drives as fast as it can."""
    if mapped.drives.beyond_limits != "clamped":
        raise NotDeclaredError("the map does not say that velocities beyond the limits are clamped")
    return recorded(
        drive
        for name, limit, value in beyond(mapped.drives.axes)
        if limit
        for drive in _drives(mapped, f"{name} {value:g}, beyond its limit", {name: value}, {name: limit})
    )


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def let_go(mapped: MappedDevice, effort: Effort, run: Run) -> tuple[Drive, ...]:
    """Command a velocity, and then nothing any more, as when the client vanishes or the network breaks.

    A watchdog may work after every other command, for some directions or sizes of a velocity alone, only while somebody
    reads, until a command is refused, or while its connection is open. At quick the seed says which of them are tried.
    """
    hold_s = mapped.drives.hold_s
    if hold_s is None:
        raise NotDeclaredError("the map declares no hold_s: the device goes on until it is told otherwise")
    chance = random.Random(f"{run.seed}/let go")  # noqa: S311 - no secret
    return recorded(_let_go(mapped, hold_s, chance, quick=effort.name == "quick"))


def _let_go(mapped: MappedDevice, hold_s: float, chance: random.Random, *, quick: bool) -> Iterator[Drive]:
    axes = list(mapped.drives.axes.items())
    ends = {name: list(_there_and_back(mapped, axis.limits, axis.of)) for name, axis in axes}
    limits = [{name: limit} for name in list(ends)[: 1 if quick else None] for limit in ends[name]]
    others = list(_at_once(mapped))
    chance.shuffle(others)
    slowest = [_slowest(mapped, name, chance.choice(ends[name])) for name in ends]
    others = [*others[:2], *slowest[:2]] if quick else [*limits, *others, *slowest]
    refusals = list(_refusals(mapped))
    chance.shuffle(refusals)
    number = chance.randrange(1 + len(mapped.drives.ways))
    left = [(one, _in_turn(mapped, one, number + made) if quick else ()) for made, one in enumerate([*limits, *others])]
    for made, (speeds, by) in enumerate([*left, *(() if quick else _by_each_way(mapped))]):
        # An odd number of commands and an even one; and with readings and without.
        silent = made == 1 if quick else len(limits) <= made < 2 * len(limits)
        what = f"{_named(speeds, by)}, let go" + (", and nothing is read until it must rest" if silent else "")
        yield from _drives(mapped, what, speeds, let_go_s=hold_s, more=made % 2, silent=silent, by=by)
    name = axes[0][0]
    for kind, refused in refusals[: 1 if quick else None]:
        limit = next(_there_and_back(mapped, axes[0][1].limits, axes[0][1].of))
        what = f"{name} {limit:g}, let go, with {kind} after it, which must be refused"
        yield from _drives(mapped, what, {name: limit}, let_go_s=hold_s, refused=refused)


def _refusals(mapped: MappedDevice) -> Iterator[tuple[str, Callable[[], Command]]]:
    """Yield commands that the device must refuse, each as a noun phrase and as what sends it."""
    name, axis = next(iter(mapped.drives.axes.items()))
    if mapped.drives.beyond_limits == "refused":
        for _, _, value in beyond({name: axis}):
            yield f"{name} {value:g}", partial(mapped.drive, {name: value})
    if mapped.binding.forbids(*mapped.call_of(mapped.drives, {name: "far"})):
        yield f'the text "far" as {name}', partial(mapped.drive, {name: "far"})
    if mapped.binding.has_credentials:
        yield (
            f"{name} {axis.limits[1]:g} without credentials",
            partial(mapped.drive, {name: axis.limits[1]}, authorized=False),
        )


def _there_and_back(mapped: MappedDevice, limits: tuple[float, float], of: str) -> Iterator[float]:
    """Yield the velocities other than 0, first the one that leads away from the nearer end of the axis."""
    least, greatest = limits
    ahead = True
    if of:
        ends = mapped.motion.state.axes[of].limits
        ahead = mapped.where()[of] <= sum(ends) / 2
    yield from filter(None, (greatest, least) if ahead else (least, greatest))


def _drives(
    mapped: MappedDevice,
    what: str,
    speeds: Position,
    ends: Position | None = None,
    *,
    let_go_s: float | None = None,
    more: int = 0,
    longer: bool = False,
    refused: Callable[[], Command] | None = None,
    silent: bool = False,
    by: _By = (),
) -> Iterator[Drive]:
    """Drive at a velocity; again, if a slow link let the hold time pass, or velocity 0 was answered late.

    Each drive is judged for what it shows.

    Args:
        mapped: the device.
        what: the drive, as a noun phrase.
        speeds: what is commanded.
        ends: what the device must take instead.
        let_go_s: its hold time, if nothing is sent after the drive; None: velocity 0 is.
        more: how often the velocity is sent once more at the end, on a connection of its own.
        longer: whether the drive outlasts the hold time.
        refused: sends what the device must refuse after the last command; None: nothing is sent.
        silent: whether nothing is read until the device must rest.
        by: in which ways the velocity is commanded in turn; empty: as usual.
    """
    drives, hold_s = mapped.drives, mapped.drives.hold_s or 0.0
    # One that is let go is measured in its hold time.
    measured_s = MEASURED_S if let_go_s is None else 0.0
    lasts_s = max(drives.settle_s, hold_s if longer and hold_s <= _LONGEST_HOLD_S else 0.0) + measured_s
    for _ in range(TRIES):
        # What follows the last reading: velocity 0 or the hold time, and until the device rests.
        rests_s = (let_go_s or 0.0) + more * mapped.room.slowest_s + drives.settle_s
        made = with_room(mapped, [speeds], lasts_s + rests_s)[0]
        if ends and made != speeds:
            raise NotPossibleError(f"the limits leave no room for {what}")
        slowed = "".join(f", slowed to {made[name]:.2g} for room" for name in made if made[name] != speeds[name])
        commands, readings, whole = _kept_up(mapped, made, lasts_s, rests_s, by or (None,))
        last = by[-1] if by else None
        commands += [mapped.drive(made, way=last, fresh=True) for _ in range(more if whole else 0)]
        wanted = {**dict.fromkeys(drives.axes, 0.0), **made, **(ends or {})}
        drive = Drive(what, wanted, tuple(commands), tuple(readings), None, (), slowed=slowed, resting=mapped.resting)
        if let_go_s is not None and not whole:
            # The next try begins elsewhere, or is slower: this one has shown how far the device comes.
            mapped.come_to_rest()
            continue
        drive = _ended(mapped, drive, let_go_s, refused, silent=silent, way=by[0] if by else None)
        if drive.refused is None or not drive.refused.accepted:
            yield drive
        in_time = drive.end is None or not drive.end.was_late(drive.readings)
        if whole and in_time and drive.was_kept(drives.hold_s):
            return
    if let_go_s is not None and not whole:
        raise NotPossibleError(f"the limits leave no room for {what}")


def _kept_up(
    mapped: MappedDevice, speeds: Position, lasts_s: float, rests_s: float, by: _By
) -> tuple[list[Command], list[Reading], bool]:
    """Command velocities again and again for as long as they are measured; return whether there was room for that."""
    given = mapped.drives
    every_s = min(_KEPT_S, given.hold_s / _KEPT) if given.hold_s else _KEPT_S
    ways = itertools.cycle(by)
    commands, readings = [mapped.drive(speeds, way=next(ways))], list[Reading]()
    while mapped.clock.now() < commands[0].answered + lasts_s and commands[-1].accepted:
        mapped.room.note(speeds, readings[-_NOTED:])
        if mapped.room.is_over([speeds], readings, rests_s):
            return commands, readings, False
        if mapped.clock.now() >= commands[-1].sent + every_s:
            commands.append(mapped.drive(speeds, way=next(ways)))
        readings.append(mapped.read())
    return commands, readings, True


def _ended(
    mapped: MappedDevice,
    drive: Drive,
    let_go_s: float | None,
    refused: Callable[[], Command] | None,
    *,
    silent: bool,
    way: Way | None,
) -> Drive:
    """End a drive by velocity 0, sent in a way, or let the device go; return it with what came after."""
    end = mapped.drive({}, way=way, integers=True) if let_go_s is None else None
    last = end or drive.commands[-1]
    rests_at = last.answered + (let_go_s or 0.0) + mapped.drives.settle_s
    answer: Command | None = None
    after: list[Reading] = []
    if refused is not None and let_go_s is not None:
        for part in _REFUSED_AT:
            after += mapped.watch(last.answered + part * let_go_s)
            one = refused()
            answer = one if answer is None or one.accepted else answer
    if silent:
        mapped.clock.sleep(rests_at - mapped.clock.now())
    due, speeds = rests_at + mapped.room.slowest_s, drive.wanted

    def seen_enough(readings: list[Reading]) -> bool:
        """Whether readings show that the device drives on, towards a limit."""
        late = [one for one in readings if one.sent >= due]
        return len(late) > 2 * SEVERAL and mapped.room.is_over([speeds], late, 0.0)

    after += mapped.watch(rests_at + _REST_S, seen_enough)
    # Where a reading took long, only those count that come as much later: several of them show whether it rests.
    for _ in range(_MORE):
        counted = [one for one in after if one.sent >= rests_at + longest_s([*drive.readings, *after])]
        if len(counted) >= 2 * SEVERAL or seen_enough(after):
            break
        after.append(mapped.read())
    if creeping([one for one in after if one.sent >= rests_at], mapped.motion, mapped.resting):
        # It may come to rest yet.
        after += mapped.watch(after[-1].sent + _SLOWS_S, seen_enough)
    if end is None:
        mapped.stop()
    mapped.saw_rest(after)
    return replace(drive, end=end, after=tuple(after), refused=answer)
