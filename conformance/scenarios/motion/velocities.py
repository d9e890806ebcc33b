"""Scenarios that give a device velocities by its motion map: at the limits and between, ended by zero or let go."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

from conformance.measures.samples import SEVERAL, longest_s, usual_s
from conformance.scenarios.motion.driving import with_room
from conformance.scenarios.motion.mapped import STAYS_S, MappedDevice, Position
from conformance.scenarios.motion.measuring import STEADY_S, speed_in, steady_since
from conformance.scenarios.motion.moves import TRIES, beyond, record_parts
from conformance.scenarios.motion.resting import creeping, fastest, may_creep
from conformance.scenarios.motion.trace import Command, Drive, Reading
from conformance.scenarios.scenario import NotDeclaredError, NotPossibleError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.statement.motion_map import Way
from conformance.transport.raw import PartialRequest
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run

_NEEDS: Final = (Need.REST, Need.MOTION)
_By = tuple[Way | None, ...]
SILENT: Final = "and the client falls silent"
CLOSED: Final = "and the client closes its connection"
HALF_OPEN: Final = "and the link breaks without a word"
POLLING: Final = "and the client only goes on reading the state"
#: How a client vanishes, each as the end of a drive's name.
WAYS: Final = (SILENT, CLOSED, HALF_OPEN, POLLING)
# How long a device without a declared hold time is watched, s; no verdict follows.
_UNDECLARED_S: Final = 2.0
# How long a velocity that still varies is measured once it must be reached, s.
MEASURED_S: Final = 0.5
# How much longer it is measured at most, where a slow link or machine leaves too few readings, s.
_LONGER_S: Final = 2.0
_SLOW: Final = 0.4  # slow velocity, as a share of the limit
_SLOWEST: Final = 0.1  # slowest velocity, as a share of the limit
# A velocity differs from rest by this multiple of its tolerance.
_TOLD: Final = 1.5
# Successive velocities before the device is stopped; at quick effort, all of them.
_PAIR: Final = 2
# A slow drive exceeds the hold time, up to this, so that renewing shows, s.
_LONGEST_HOLD_S: Final = 2.0
# Parts of the hold time after which commands are sent that must be refused: after the first the device must still
# drive; the second must renew nothing.
_REFUSED_AT: Final = (0.1, 0.9)
#: Part of the hold time in which the device must still drive.
HELD: Final = (0.2, 0.7)
_KEPT: Final = 3  # renewals of a velocity within its hold time
_KEPT_S: Final = 0.1  # longest time between two renewals, s
# To save room, a device that is not stopped may begin at this share of the velocity.
_SLOWER: Final = 0.7
# How long a device is watched after the time to rest, s.
_REST_S: Final = 0.5
# How long a device that still moves slowly is watched, to see whether it comes to rest, s.
_SLOWS_S: Final = 2.0
_MORE: Final = 50  # most readings in that time
_NOTED: Final = 50  # readings from which the speed is learned


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def velocities(mapped: MappedDevice, effort: Effort, run: Run) -> tuple[Drive, ...]:
    """Drive each axis at its limits and slowly, there and back, and two at once; end each drive with velocity 0.

    At quick, each axis is driven at its limits, and two slowly at once (or the only one back); the seed chooses the
    command if the map has several. At standard, each command drives each axis there and back, also while another axis
    moves, which must not change.
    """
    if effort.name == "quick":
        parts = [
            Part(_speeds_text(speeds, by := _in_turn(mapped, speeds, number)), speeds, longer=longer, by=by)
            for number, (speeds, longer) in enumerate(_plan_drives(mapped, quick=True), run.seed)
        ]
        return record_parts(itertools.chain(_in_a_row(mapped, parts), _ended_by_stop(mapped, parts[:1])))
    parts = [Part(_speeds_text(speeds), speeds, longer=longer) for speeds, longer in _plan_drives(mapped, quick=False)]
    parts += [Part(_speeds_text(speeds, by), speeds, by=by) for speeds, by in _by_each_way(mapped)]
    pairs = (parts[index : index + _PAIR] for index in range(0, len(parts), _PAIR))
    in_pairs = (drive for pair in pairs for drive in _in_a_row(mapped, pair))
    return record_parts(itertools.chain(in_pairs, _ended_by_stop(mapped, parts[:_PAIR])))


def _ended_by_stop(mapped: MappedDevice, parts: Sequence[Part]) -> Iterator[Drive]:
    """Drive at velocities again, and end each by the stop, of a device that takes velocities alone."""
    if mapped.motion.stop is not None and mapped.motion.goto is None:
        for part in parts:
            yield from _in_a_row(mapped, [replace(part, what=f"{part.what}, to be stopped", is_stopped=True)])


def _by(way: Way, speeds: Position) -> _By:
    """Return the ways to command velocities; the last one commands at least one of these."""
    return (way,) if {name for name, speed in speeds.items() if speed} <= way.axes else (None, way)


def _in_turn(mapped: MappedDevice, speeds: Position, number: int) -> _By:
    """Return the way to command velocities whose turn it is."""
    ways = [way for way in mapped.drives.ways if way.axes & speeds.keys()]
    return ((), *(_by(way, speeds) for way in ways))[number % (1 + len(ways))]


def _by_each_way(mapped: MappedDevice) -> Iterator[tuple[Position, _By]]:
    """Yield velocities for each further way to command one: of each axis alone, and of two at once."""
    for way in mapped.drives.ways:
        several = [
            {name: _SLOW * limit}
            for name, axis in mapped.drives.axes.items()
            if name in way.axes
            for limit in _there_and_back(mapped, axis.limits, axis.of)
        ]
        several += [item for item in _at_once(mapped) if item.keys() & way.axes]
        yield from ((speeds, _by(way, speeds)) for speeds in several)


def _plan_drives(mapped: MappedDevice, *, quick: bool) -> Iterator[tuple[Position, bool]]:
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
    """Return the lowest velocity that can be distinguished from rest."""
    least = _TOLD * mapped.motion.speed_tolerance(name)
    return {name: math.copysign(min(max(_SLOWEST * abs(limit), least), _SLOW * abs(limit)), limit)}


def _speeds_text(speeds: Position, by: _By = ()) -> str:
    way = next((f" by {one.send}" + (" as XML" if one.root else "") for one in by if one), "")
    return " and ".join(f"{name} {speed:g}" for name, speed in speeds.items()) + way


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def clamped_velocities(mapped: MappedDevice) -> tuple[Drive, ...]:
    """Command velocities beyond the limits, if the map declares that the device clamps them."""
    if mapped.drives.beyond_limits != "clamped":
        raise NotDeclaredError("the map does not say that velocities beyond the limits are clamped")
    parts = [
        Part(f"{name} {value:g}, beyond its limit", {name: value}, {name: limit})
        for name, limit, value in beyond(mapped.drives.axes)
        if limit
    ]
    return record_parts(drive for part in parts for drive in _in_a_row(mapped, [part]))


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def let_go(mapped: MappedDevice, effort: Effort, run: Run) -> tuple[Drive, ...]:
    """Command a velocity, and then nothing any more: in silence, reading on, with the connection closed or broken.

    A watchdog may work after every other command, for some directions or sizes of a velocity alone, only while somebody
    reads, until a command is refused, or while its connection is open. At quick the seed says which of them are tried.
    Without a hold time, nothing is judged, but how the device goes on is shown.
    """
    hold_s, chance = mapped.drives.hold_s, random.Random(f"{run.seed}/let go")  # noqa: S311 - no secret
    let_go = () if hold_s is None else _let_go(mapped, hold_s, chance, quick=effort.name == "quick")
    ways = (CLOSED, POLLING) if hold_s is None else (CLOSED, HALF_OPEN)
    return record_parts(itertools.chain(*(_drive_and_vanish(mapped, way) for way in ways), let_go))


def _let_go(mapped: MappedDevice, hold_s: float, chance: random.Random, *, quick: bool) -> Iterator[Drive]:
    axes = list(mapped.drives.axes.items())
    ends = {name: list(_there_and_back(mapped, axis.limits, axis.of)) for name, axis in axes}
    limits = [{name: limit} for name in list(ends)[: 1 if quick else None] for limit in ends[name]]
    others = list(_at_once(mapped))
    chance.shuffle(others)
    slowest = [_slowest(mapped, name, chance.choice(ends[name])) for name in ends]
    others = [*others[:1], *slowest] if quick else [*limits, *others, *slowest]
    refusals = list(_refusals(mapped))
    chance.shuffle(refusals)
    number = chance.randrange(1 + len(mapped.drives.ways))
    left = [(one, _in_turn(mapped, one, number + made) if quick else ()) for made, one in enumerate([*limits, *others])]
    for made, (speeds, by) in enumerate([*left, *(() if quick else _by_each_way(mapped))]):
        # Odd and even numbers of commands, with and without readings.
        silent = made == 1 if quick else len(limits) <= made < 2 * len(limits)
        gone = SILENT if silent else POLLING
        part = Part(f"{_speeds_text(speeds, by)}, {gone}", speeds, by=by)
        yield from left_alone(mapped, part, hold_s, more=made % 2, gone=gone, brief=made > 0)
    name = axes[0][0]
    for kind, refused in refusals[: 1 if quick else None]:
        limit = next(_there_and_back(mapped, axes[0][1].limits, axes[0][1].of))
        what = f"{name} {limit:g}, let go, with {kind} after it, which must be refused"
        yield from left_alone(mapped, Part(what, {name: limit}), hold_s, refused=refused, brief=True)


def _drive_and_vanish(mapped: MappedDevice, way: str) -> Iterator[Drive]:
    name, axis = next(iter(mapped.drives.axes.items()))
    limit = next(_there_and_back(mapped, axis.limits, axis.of))
    # So slow that a device that does not stop stays near.
    least = min(_TOLD * mapped.motion.speed_tolerance(name), abs(limit))
    speeds = {name: math.copysign(max(_SLOW * abs(limit), least), limit)}
    hold_s = mapped.drives.hold_s if mapped.drives.hold_s is not None else _UNDECLARED_S
    yield from left_alone(mapped, Part(f"{_speeds_text(speeds)}, {way}", speeds), hold_s, gone=way, brief=True)


def _refusals(mapped: MappedDevice) -> Iterator[tuple[str, Callable[[], Command]]]:
    """Yield commands that the device must refuse, each as a noun phrase and a function that sends it."""
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
    """Yield the velocities other than 0, first the one away from the nearer end of the axis."""
    least, greatest = limits
    ahead = True
    if of:
        ends = mapped.motion.state.axes[of].limits
        ahead = mapped.where()[of] <= sum(ends) / 2
    yield from filter(None, (greatest, least) if ahead else (least, greatest))


@dataclass(frozen=True)
class Part:
    """A velocity to drive at.

    Attributes:
        what: as a noun phrase.
        speeds: what is commanded.
        ends: what the device must take instead; None means the same.
        longer: whether it is to outlast the hold time.
        by: in which ways it is commanded in turn; empty means as usual.
        is_stopped: whether the stop ends it, in place of velocity 0.
    """

    what: str
    speeds: Position
    ends: Position | None = None
    longer: bool = False
    by: _By = ()
    is_stopped: bool = False


def _in_a_row(mapped: MappedDevice, parts: Sequence[Part]) -> Iterator[Drive]:
    """Drive at velocities one after the other, and end by velocity 0; repeat what a slow link or machine spoilt."""
    left = list(parts)
    for _ in range(TRIES):
        again: list[Part] = []
        for part, drive, whole in _at_each(mapped, left):
            yield drive
            in_time = drive.end is None or not drive.end.was_late(drive.readings)
            # A refused command is judged without readings.
            shown = not drive.commands[-1].is_ok or _shows(
                mapped, drive.wanted, drive.under_way, drive.settled_at(mapped.drives.settle_s)
            )
            if not (whole and in_time and shown and drive.was_kept(mapped.drives.hold_s)):
                again.append(part)
        left = again
        if not left:
            return


def _at_each(mapped: MappedDevice, parts: Sequence[Part]) -> Iterator[tuple[Part, Drive, bool]]:
    """Yield each part with its drive, and whether there was room for the whole drive.

    A velocity turns into the next one while the limits leave room for both.
    """
    drives, hold_s = mapped.drives, mapped.drives.hold_s or 0.0
    before: tuple[Part, Drive, bool] | None = None
    for part in parts:
        outlasts_s = hold_s if part.longer and hold_s <= _LONGEST_HOLD_S else 0.0
        settle_s = drives.settle_s * _times(mapped, before[1].wanted if before else {}, part.speeds)
        lasts_s = max(settle_s + STEADY_S, outlasts_s + MEASURED_S)
        made = part.speeds
        if before is not None and not _goes_on(mapped, before[1], made, lasts_s + drives.settle_s):
            yield before[0], _end_drive(mapped, before[1], before[0]), before[2]
            before, settle_s = None, drives.settle_s
        if before is None:
            made = with_room(mapped, [part.speeds], lasts_s + drives.settle_s)[0]
            if part.ends and made != part.speeds:
                raise NotPossibleError(f"the limits leave no room for {part.what}")
        drive, whole = _kept_up(
            mapped, part, made, settle_s, drives.settle_s, before=before[1] if before else None, outlasts_s=outlasts_s
        )
        if before is not None:
            yield before
        before = part, drive, whole
    if before is not None:
        yield before[0], _end_drive(mapped, before[1], before[0]), before[2]


def _times(mapped: MappedDevice, before: Position, after: Position) -> float:
    """Return how many times its time to settle a device may need: one that turns round changes by more than a limit."""
    names = before.keys() | after.keys()
    changes = [
        abs(after.get(name, 0.0) - before.get(name, 0.0)) / max(map(abs, mapped.drives.axes[name].limits))
        for name in names
    ]
    return max(1.0, *changes)


def _goes_on(mapped: MappedDevice, before: Drive, speeds: Position, lasts_s: float) -> bool:
    """Return whether the limits leave room for another velocity without a stop before it."""
    room, seen = mapped.room, before.under_way
    # Over a slow link, readings come too late to see where the device is.
    if usual_s(seen) > _KEPT_S:
        return False
    return room.leads_on(before.wanted, seen, mapped.drives.settle_s) and room.leads_on(speeds, seen, lasts_s)


def left_alone(
    mapped: MappedDevice,
    part: Part,
    hold_s: float,
    *,
    more: int = 0,
    refused: Callable[[], Command | None] | None = None,
    gone: str = "",
    brief: bool,
    silent_s: float | None = None,
    outlasts_s: float = 0.0,
    beside: Callable[[], None] = lambda: None,
) -> Iterator[Drive]:
    """Drive at a velocity, then send nothing any more, and watch; again where a slow link or the limits spoilt it.

    Args:
        mapped: the device.
        part: the velocity.
        hold_s: its hold time, s.
        more: how often the velocity is sent once more at the end, on a connection of its own.
        refused: sends what commands nothing after the last command, and returns what the device must refuse, if any;
            None if nothing is sent.
        gone: how the client vanishes, one of WAYS; empty if it stays, and keeps its lease.
        brief: whether to look no longer than until it rests.
        silent_s: for so long after the last command a client that vanishes sends nothing, s; None: until the device
            must rest, unless it goes on reading.
        outlasts_s: for so long it is commanded at least before, as usual, and measured after that, s.
        beside: called after each reading before the last call of ``refused``.
    """
    settle_s, whole = mapped.drives.settle_s, False
    if silent_s is None:
        silent_s = 0.0 if gone in {"", POLLING} else hold_s + settle_s
    for _ in range(TRIES):
        rests_s = hold_s + more * mapped.room.slowest_s + settle_s
        made = with_room(mapped, [part.speeds], max(settle_s, outlasts_s) + rests_s, slower=_SLOWER)[0]
        kept, measured_s = (replace(part, by=()), MEASURED_S) if outlasts_s else (part, 0.0)
        drive, whole = _kept_up(mapped, kept, made, settle_s, rests_s, outlasts_s=outlasts_s, measured_s=measured_s)
        if not whole:
            # The next try begins elsewhere, or is slower, because this one has shown how far the device drives.
            mapped.come_to_rest()
            continue
        way = part.by[-1] if part.by else None
        again = [mapped.drive(made, way=way, fresh=True) for _ in range(more)]
        drive = replace(drive, commands=(*drive.commands, *again))
        with ExitStack() as links:
            links.callback(mapped.ready.speak)
            if gone in {CLOSED, HALF_OPEN} and drive.commands[-1].is_ok:
                drive = replace(drive, commands=(*drive.commands, _unread(mapped, made, drive, links, gone)))
            if gone:
                mapped.ready.fall_silent()
            drive = _let_go_of(mapped, drive, hold_s, refused, beside, silent_s=silent_s, brief=brief)
        if drive.refused is None or not drive.refused.is_ok:
            yield drive
        if drive.was_kept(hold_s) and (silent_s or _shows_hold(mapped, drive, hold_s)):
            return
    if not whole:
        raise NotPossibleError(f"the limits leave no room for {part.what}")


def _shows(mapped: MappedDevice, wanted: Position, readings: Sequence[Reading], begin: float) -> bool:
    """Return whether the readings from a time on, s, are enough to measure each velocity."""
    seen = [reading for reading in readings if reading.sent >= begin]
    return all(speed_in(seen, name, mapped.motion) is not None for name in wanted)


def _shows_hold(mapped: MappedDevice, drive: Drive, hold_s: float) -> bool:
    """Return whether readings within the hold time show velocities, or are too rare for that in every try."""
    last = drive.commands[-1]
    begin, end = last.answered + HELD[0] * hold_s, last.sent + HELD[1] * hold_s
    within = [reading for reading in drive.after if begin <= reading.sent and reading.received <= end]
    if usual_s(drive.readings) > (HELD[1] - HELD[0]) * hold_s / SEVERAL:
        return True
    return all(speed_in(within, name, mapped.motion) is not None for name, wanted in drive.wanted.items() if wanted)


def _unread(mapped: MappedDevice, speeds: Position, drive: Drive, links: ExitStack, gone: str) -> Command:
    """Send a velocity once more, and never read the response; the exchange is that of the command before.

    Args:
        mapped: the device.
        speeds: what is commanded.
        drive: with the command before.
        links: closes the connection in the end.
        gone: CLOSED: the client closes it at once, as one does that is killed; else it stays open without a word, as
            one that has lost its network.
    """
    made, sent = mapped.request_of(mapped.drives, speeds), mapped.clock.now()
    link = PartialRequest(
        mapped.api.client, made.method, made.target, sent=made.body, promised=len(made.body), headers=made.headers
    )
    if gone == CLOSED:
        link.vanish(reset=False)
        mapped.api.client.close()
    else:
        links.callback(link.vanish)
    return replace(drive.commands[-1], sent=sent, answered=mapped.clock.now())


def _let_go_of(
    mapped: MappedDevice,
    drive: Drive,
    hold_s: float,
    refused: Callable[[], Command | None] | None,
    beside: Callable[[], None],
    *,
    silent_s: float,
    brief: bool,
) -> Drive:
    last, after = drive.commands[-1], list[Reading]()
    rests_at = last.answered + hold_s + mapped.drives.settle_s
    answer: Command | None = None
    for part in _REFUSED_AT if refused is not None else ():
        after += mapped.watch(last.answered + part * hold_s, lambda _: beside())
        one = refused() if refused is not None else None
        answer = one if answer is None or (one and one.is_ok) else answer
    mapped.clock.sleep(last.answered + silent_s - mapped.clock.now())
    drive = _watch_rest(mapped, drive, after, rests_at, brief_from=last.answered + hold_s if brief else None)
    if not mapped.rests:
        mapped.stop()
    return replace(drive, refused=answer)


def _kept_up(
    mapped: MappedDevice,
    part: Part,
    made: Position,
    settle_s: float,
    rests_s: float,
    *,
    before: Drive | None = None,
    outlasts_s: float = 0.0,
    measured_s: float = MEASURED_S,
) -> tuple[Drive, bool]:
    """Command a velocity again and again until it is seen, or must be; return the drive, and whether it had room.

    Args:
        mapped: the device.
        part: what is commanded, and how.
        made: the velocity, with room for it.
        settle_s: time to reach it, s.
        rests_s: time to rest afterwards, s.
        before: the drive that turns into this one; None if it begins at rest.
        outlasts_s: for so long it is commanded at least, and measured after that, s; 0: as long as it takes to see it.
        measured_s: for so long one is measured that is not steady by then, s.
    """
    given, motion = mapped.drives, mapped.motion
    every_s = min(_KEPT_S, given.hold_s / _KEPT) if given.hold_s else _KEPT_S
    wanted = {**dict.fromkeys(given.axes, 0.0), **made, **(part.ends or {})}
    slowed = "".join(f", slowed to {made[name]:.2g} for room" for name in made if made[name] != part.speeds[name])
    ways = itertools.cycle(part.by or (None,))
    commands, readings = [mapped.drive(made, way=next(ways))], list[Reading]()
    begun = commands[0].answered
    until, since, whole = max(begun + settle_s, begun + outlasts_s) + measured_s, None, True

    def unseen() -> bool:
        """Whether the readings are too few to measure what must have been reached, and there is room for more."""
        few = measured_s > 0 and not _shows(mapped, wanted, readings, begun + settle_s)
        return few and usual_s(readings) <= _KEPT_S and mapped.room.leads_on(made, readings, rests_s)

    while commands[-1].is_ok and ((now := mapped.clock.now()) < until or (now < until + _LONGER_S and unseen())):
        # Before the settle time is over, a device that reverses still drives at the earlier velocity.
        settled = before is None or mapped.clock.now() >= begun + settle_s
        mapped.room.note(
            made, [reading for reading in readings[-_NOTED:] if before is None or reading.sent >= begun + settle_s]
        )
        choices, seen = (
            ([made], readings) if before is None else ([made, before.wanted], [*before.under_way, *readings])
        )
        if mapped.room.is_over(choices[:1] if settled else choices, seen, rests_s):
            whole = False
            break
        if mapped.clock.now() >= commands[-1].sent + every_s:
            commands.append(mapped.drive(made, way=next(ways)))
        readings.append(mapped.read())
        if since is None:
            since = steady_since(readings, wanted, motion, mapped.resting)
        if since is not None and not outlasts_s:
            break
    if since is not None:
        steady = [reading for reading in readings if reading.sent >= since]
        mapped.room.note(made, steady)
        mapped.room.note_heading(made, steady)
    elif mapped.room.ends(made, readings):
        whole = False
    since = begun + settle_s if since is None else min(since, begun + settle_s)
    drive = Drive(part.what, wanted, tuple(commands), tuple(readings), None, (), slowed=slowed)
    return replace(drive, resting=mapped.resting, since=since), whole


def _end_drive(mapped: MappedDevice, drive: Drive, part: Part) -> Drive:
    """End a drive by velocity 0, or by the stop; return it with the readings after that."""
    stop = mapped.motion.stop if part.is_stopped else None
    end = mapped.stop() if stop else None
    end = end or mapped.drive({}, way=part.by[0] if part.by else None, integers=True)
    rests_s = stop.rests_within_s if stop else mapped.drives.settle_s
    drive = _watch_rest(mapped, replace(drive, end=end), [], end.answered + rests_s)
    if stop and mapped.rests:
        # It must not take its velocity up again.
        is_over = partial(mapped.room.is_over, [drive.wanted], rests_s=rests_s)
        drive = replace(drive, after=(*drive.after, *mapped.watch(mapped.clock.now() + _SLOWS_S, is_over)))
    if stop:
        mapped.come_to_rest()
    return drive


def _watch_rest(
    mapped: MappedDevice, drive: Drive, after: list[Reading], rests_at: float, *, brief_from: float | None = None
) -> Drive:
    """Watch a device that must rest from a time on, s of the clock; return the drive with the readings after it.

    Args:
        mapped: the device.
        drive: until then.
        after: the readings so far.
        rests_at: when it must rest.
        brief_from: when it may be left, s of the clock, if it rests already; None means not before it must rest.
    """
    due, speeds = rests_at + mapped.room.slowest_s, drive.wanted

    def drives_on(readings: list[Reading]) -> bool:
        """Whether readings show that the device drives on, towards a limit."""
        late = [reading for reading in readings if reading.sent >= due]
        return len(late) > 2 * SEVERAL and mapped.room.is_over([speeds], late, 0.0)

    def resting_since(readings: list[Reading]) -> float | None:
        return None if brief_from is None else _resting_since(mapped, readings, brief_from)

    after += mapped.watch(rests_at + _REST_S, lambda seen: drives_on(seen) or resting_since(seen) is not None)
    since = resting_since(after)
    # After a slow reading, only readings as much later count: several of them show rest.
    for _ in range(_MORE if since is None else 0):
        counted = [reading for reading in after if reading.sent >= rests_at + longest_s([*drive.readings, *after])]
        if len(counted) >= 2 * SEVERAL or drives_on(after):
            break
        after.append(mapped.read())
    still = [reading for reading in after if reading.sent >= (rests_at if since is None else since)]
    if creeping(still, mapped.motion, mapped.resting) or may_creep(still, mapped.motion, mapped.resting):
        # The device may still come to rest.
        after += mapped.watch(after[-1].sent + _SLOWS_S, drives_on)
        since = None
    mapped.saw_rest(after)
    return replace(drive, after=tuple(after), rested=since)


def _resting_since(mapped: MappedDevice, readings: Sequence[Reading], begin: float) -> float | None:
    """Return since when, not before a time, the last readings show the device at rest, s; None if they do not."""
    last = [reading for reading in readings if reading.sent >= readings[-1].sent - STAYS_S]
    seen = [reading for reading in last if reading.values or reading.speeds]
    if len(last) in {len(readings), 0} or len(seen) < max(len(last), 2 * SEVERAL) or last[0].sent < begin:
        return None
    axes = mapped.motion.state.axes
    stays = all(
        abs(reading.values[name] - last[0].values[name]) <= mapped.motion.tolerance(name) / 2
        for reading in last
        for name in axes
    )
    return None if fastest(last, mapped.motion) or not stays else last[0].sent
