"""Scenarios that give a device velocities by its motion map: at the limits and between, ended by zero or let go."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from conformance.scenarios.motion.driving import with_room
from conformance.scenarios.motion.mapped import MappedDevice, Position
from conformance.scenarios.motion.moves import TRIES, beyond, recorded
from conformance.scenarios.motion.trace import SEVERAL, Command, Drive, Reading, longest_s
from conformance.scenarios.scenario import NotDeclaredError, NotPossibleError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.verdict.effort import Effort

_NEEDS: Final = (Need.REST, Need.MOTION)
# For so long a velocity is measured once it must be reached, s.
MEASURED_S: Final = 0.5
# Of the limit: velocities.
_SHARES: Final = (1.0, 0.4)
# A slow drive lasts longer than the hold time, up to this, so that a renewed command is seen to last, s.
_LONGEST_HOLD_S: Final = 2.0
# After this part of the hold time a command that must be refused follows the last one.
_REFUSED_AT: Final = 0.6
# A device is told its velocity that often within its hold time, at least every so many s.
_KEPT: Final = 3
_KEPT_S: Final = 0.1
# After the time to rest it is watched for so long, s.
_REST_S: Final = 0.5
# And by at most so many readings more.
_MORE: Final = 50
# The speed is learned from so many readings.
_NOTED: Final = 50


@scenario(needs=_NEEDS, stage=Stage.DRIVE)
def velocities(mapped: MappedDevice, effort: Effort) -> tuple[Drive, ...]:
    """Drive each axis at its limits and slowly, there and back; end each drive with velocity 0.

    At quick there at one limit, and back slowly.
    """
    return recorded(
        drive
        for name, axis in mapped.drives.axes.items()
        for speed in _speeds(list(_there_and_back(mapped, axis.limits, axis.of)), effort)
        for drive in _drives(
            mapped, f"{name} {speed:g}", {name: speed}, longer=abs(speed) < max(map(abs, axis.limits)) / 2
        )
    )


def _speeds(limits: list[float], effort: Effort) -> list[float]:
    if effort.name == "quick" and len(limits) == len(_SHARES):
        return [share * limit for share, limit in zip(_SHARES, limits, strict=True)]
    return [share * limit for share in _SHARES for limit in limits]


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
def let_go(mapped: MappedDevice, effort: Effort) -> tuple[Drive, ...]:
    """Command a velocity, and then nothing any more, as when the client vanishes or the network breaks."""
    hold_s = mapped.drives.hold_s
    if hold_s is None:
        raise NotDeclaredError("the map declares no hold_s: the device goes on until it is told otherwise")
    return recorded(_let_go(mapped, effort, hold_s))


def _let_go(mapped: MappedDevice, effort: Effort, hold_s: float) -> Iterator[Drive]:
    axes = list(mapped.drives.axes.items())
    quick, made = effort.name == "quick", 0
    for turn in range(1 if quick else 2):
        for name, axis in axes[:1] if quick else axes:
            for limit in _there_and_back(mapped, axis.limits, axis.of):
                # An odd number of commands and an even one: a watchdog may work after every other command. And with
                # readings and without: one may work only while somebody asks.
                silent = made == 1 if quick else turn == 1
                what = f"{name} {limit:g}, let go" + (", and nothing is read until it must rest" if silent else "")
                yield from _drives(mapped, what, {name: limit}, let_go_s=hold_s, more=made % 2, silent=silent)
                made += 1
    name, axis = axes[0]
    limit = next(_there_and_back(mapped, axis.limits, axis.of))
    if mapped.drives.beyond_limits == "refused":
        refused = {name: next(value for _, end, value in beyond({name: axis}) if end == limit)}
        what = f"{name} {limit:g}, let go, with {name} {refused[name]:g} after it, which must be refused"
        yield from _drives(mapped, what, {name: limit}, let_go_s=hold_s, refused=refused)


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
    refused: Position | None = None,
    silent: bool = False,
) -> Iterator[Drive]:
    """Drive at a velocity; again, if a slow link let the hold time pass, or velocity 0 was answered late.

    Each drive is judged for what it shows.

    Args:
        mapped: the device.
        what: the drive, as a noun phrase.
        speeds: what is commanded.
        ends: what the device must take instead.
        let_go_s: its hold time, if nothing is sent after the drive; None: velocity 0 is.
        more: how often the velocity is sent once more at the end.
        longer: whether the drive outlasts the hold time.
        refused: velocities that the device must refuse, sent after the last command; None: none are.
        silent: whether nothing is read until the device must rest.
    """
    drives, hold_s = mapped.drives, mapped.drives.hold_s or 0.0
    lasts_s = max(drives.settle_s, hold_s if longer and hold_s <= _LONGEST_HOLD_S else 0.0) + MEASURED_S
    for _ in range(TRIES):
        # What follows the last reading: velocity 0 or the hold time, and until the device rests.
        rests_s = (let_go_s or 0.0) + more * mapped.room.slowest_s + drives.settle_s
        made = with_room(mapped, [speeds], lasts_s + rests_s)[0]
        if ends and made != speeds:
            raise NotPossibleError(f"the limits leave no room for {what}")
        slowed = "".join(f", slowed to {made[name]:.2g} for room" for name in made if made[name] != speeds[name])
        commands, readings, whole = _kept_up(mapped, made, lasts_s, rests_s)
        commands += [mapped.drive(made) for _ in range(more if whole else 0)]
        wanted = {**dict.fromkeys(drives.axes, 0.0), **made, **(ends or {})}
        drive = Drive(what, wanted, tuple(commands), tuple(readings), None, (), slowed=slowed)
        if let_go_s is not None and not whole:
            # The next try begins elsewhere, or is slower: this one has shown how far the device comes.
            mapped.come_to_rest()
            continue
        drive = _ended(mapped, drive, let_go_s, refused, silent=silent)
        yield drive
        in_time = drive.end is None or not drive.end.was_late(drive.readings)
        if whole and in_time and drive.was_kept(drives.hold_s):
            return
    if let_go_s is not None and not whole:
        raise NotPossibleError(f"the limits leave no room for {what}")


def _kept_up(
    mapped: MappedDevice, speeds: Position, lasts_s: float, rests_s: float
) -> tuple[list[Command], list[Reading], bool]:
    """Command velocities again and again for as long as they are measured; return whether there was room for that."""
    given = mapped.drives
    every_s = min(_KEPT_S, given.hold_s / _KEPT) if given.hold_s else _KEPT_S
    commands, readings = [mapped.drive(speeds)], list[Reading]()
    while mapped.clock.now() < commands[0].answered + lasts_s and commands[-1].accepted:
        mapped.room.note(speeds, readings[-_NOTED:])
        if mapped.room.is_over([speeds], readings, rests_s):
            return commands, readings, False
        if mapped.clock.now() >= commands[-1].sent + every_s:
            commands.append(mapped.drive(speeds))
        readings.append(mapped.read())
    return commands, readings, True


def _ended(
    mapped: MappedDevice, drive: Drive, let_go_s: float | None, refused: Position | None, *, silent: bool
) -> Drive:
    """End a drive by velocity 0, or let the device go; return it with what came after."""
    end = mapped.drive({}) if let_go_s is None else None
    last = end or drive.commands[-1]
    rests_at = last.answered + (let_go_s or 0.0) + mapped.drives.settle_s
    after, answer = list[Reading](), None
    if refused is not None and let_go_s is not None:
        after = mapped.watch(last.answered + _REFUSED_AT * let_go_s)
        answer = mapped.drive(refused)
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
    if end is None:
        mapped.stop()
    return replace(drive, end=end, after=tuple(after), refused=answer)
