"""Bring a device to a place with room for a drive."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from conformance.measures.samples import SEVERAL
from conformance.scenarios.motion.mapped import MappedDevice, Position
from conformance.scenarios.motion.room import MEASURABLE, Span
from conformance.scenarios.motion.trace import Reading, middle_of
from conformance.scenarios.scenario import NotPossibleError

_BACK_SHARE: Final = 0.4  # share of the limit at which the device drives back
_BACK_S: Final = 20.0  # longest time for driving back, s
# How often the device is brought to where it has room.
_TRIES: Final = 3
# How long a slow drive lasts that shows which axes it changes, s.
_LEARNED_S: Final = 0.5
# Tolerances by which a device that is driven back goes the wrong way.
_WRONG: Final = 2
_TURNS: Final = 8  # most turns of a device to find a way back
_ALONG: Final = 0.5  # share of its velocity that must be along an axis after such a turn


def with_room(
    mapped: MappedDevice, choices: Sequence[Mapping[str, float]], lasts_s: float, *, slower: float = 1.0
) -> list[Position]:
    """Bring the device to rest where it can be driven at any of several velocities.

    Args:
        mapped: the device.
        choices: velocities by name; one of them will be commanded.
        lasts_s: from the first command until the device rests again, if every response comes at once, s.
        slower: by how much they may be multiplied rather than that the device is moved.

    Returns:
        The same velocities, lower where the limits leave no room for such a drive.

    Raises:
        NotPossibleError: there is no room, or the device does not get to where it is.
        NoAnswerError: there is no response.
    """
    for name in {name for choice in choices for name, speed in choice.items() if speed} & mapped.room.unknown:
        _learn(mapped, name)
    away, axes = dict[str, Span](), mapped.motion.state.axes
    for tried in range(_TRIES + 1):
        share, begin = _plan(mapped, choices, lasts_s)
        if not mapped.rests:
            mapped.come_to_rest()
        here = mapped.where()
        from_here = mapped.room.share_from(here, choices, lasts_s)
        # A drive back that a busy machine ended late leaves less room, which may be enough.
        if from_here and (from_here >= slower * share or tried == _TRIES):
            return [{name: from_here * speed for name, speed in choice.items()} for choice in choices]
        room = {name: mapped.motion.tolerance(name) if tried else 0.0 for name in begin}
        away = {
            name: (least, most)
            for name, (least, most) in begin.items()
            if not least - room[name] <= here[name] <= most + room[name]
        }
        if not away:
            return [{name: share * speed for name, speed in choice.items()} for choice in choices]
        if tried < _TRIES and mapped.motion.goto is not None:
            # A drive prolonged by a slow link may have moved another axis beyond its limits, where no move may end.
            wanted = {**here, **{name: sum(span) / 2 for name, span in away.items()}}
            mapped.go("room for a drive", {name: axes[name].within(value) for name, value in wanted.items()})
            mapped.come_to_rest()
        elif tried < _TRIES:
            for axis, span in away.items():
                _drive_back(mapped, axis, span, _BACK_SHARE / (1 + tried))
    raise NotPossibleError(f"the device does not get to where {next(iter(away))} has room for a drive")


def _plan(
    mapped: MappedDevice, choices: Sequence[Mapping[str, float]], lasts_s: float
) -> tuple[float, dict[str, Span]]:
    """Plan a drive; if one slow response leaves no room for it, time the responses again."""
    try:
        return mapped.room.plan(choices, lasts_s)
    except NotPossibleError:
        mapped.measure_link()
        return mapped.room.plan(choices, lasts_s)


def _learn(mapped: MappedDevice, name: str) -> None:
    """Drive slowly for a moment at a velocity whose axes the map does not name, and note which ones it changes."""
    mapped.room.unknown.discard(name)
    mapped.bring_home()
    mapped.come_to_rest()  # a device that has nearly arrived may not accept velocities yet
    driven_for_a_moment(mapped, {name: _slow(mapped, name)})


def driven_for_a_moment(mapped: MappedDevice, speeds: Mapping[str, float]) -> list[Reading]:
    """Drive at a velocity, learn which axes it changes, and come to rest; return the readings under way."""
    drives, room = mapped.drives, mapped.room
    command, seen = mapped.drive(speeds), list[Reading]()
    until = command.answered + drives.settle_s + _LEARNED_S
    while command.is_ok and (mapped.clock.now() < until or len(seen) < SEVERAL):
        seen.append(mapped.read())
        room.note(speeds, seen)
        if room.is_over([speeds], seen, drives.settle_s):
            break
        command = mapped.drive(speeds)
    mapped.drive({})
    mapped.come_to_rest()
    return seen


def _turned_back(mapped: MappedDevice, axis: str, *, forward: bool) -> list[dict[str, float]]:
    """Return the velocity that takes a device along an axis by what a slow drive shows; turn it until one does."""
    drives, room, axes = mapped.drives, mapped.room, mapped.motion.state.axes
    turns = [name for name, speed in drives.axes.items() if speed.of and axes[speed.of].angle]
    for _ in range(_TURNS):
        for name, speed in drives.axes.items():
            if speed.of or not room.greatest(name, axis):
                continue
            slow = _slow(mapped, name)
            seen = driven_for_a_moment(mapped, {name: slow})
            least, most = room.note_heading({name: slow}, seen[len(seen) // 2 :]).get(axis, (0.0, 0.0))
            if abs(least + most) / 2 >= _ALONG * room.greatest(name, axis):
                return [{name: speed.limits[forward == (least + most > 0)] * _BACK_SHARE}]
        for name in turns:
            driven_for_a_moment(mapped, {name: drives.axes[name].limits[1] * _BACK_SHARE})
    return []


def _slow(mapped: MappedDevice, name: str) -> float:
    """Return the slowest velocity that can be measured."""
    return min(mapped.drives.axes[name].limits[1], MEASURABLE * mapped.motion.speed_tolerance(name))


def _drive_back(mapped: MappedDevice, axis: str, span: Span, share: float) -> None:
    """Drive along an axis at a share of the limit until the device is in a span, or its travel ends before."""
    forward = mapped.where()[axis] < span[0]
    speeds = [
        {name: speed.limits[forward] * share}
        for name, speed in mapped.drives.axes.items()
        if speed.of == axis and speed.limits[forward]
    ] or _turned_back(mapped, axis, forward=forward)
    if not speeds:
        raise NotPossibleError(f"no velocity of the map takes {axis} back to where it has room for a drive")
    until, seen = mapped.clock.now() + _BACK_S, [mapped.read() for _ in range(SEVERAL)]
    middle, ends, begun = sum(span) / 2, False, mapped.where()[axis]
    starts_by = mapped.clock.now() + mapped.drives.settle_s + _LEARNED_S
    while not ends and mapped.clock.now() < until and not mapped.room.is_over(speeds, seen, mapped.drives.settle_s):
        if not mapped.drive(speeds[0]).is_ok:
            break
        seen.append(mapped.read())
        if seen[-1].values and (seen[-1].values[axis] >= middle if forward else seen[-1].values[axis] <= middle):
            break
        away = middle_of(seen[-SEVERAL:], axis) - begun if all(one.values for one in seen[-SEVERAL:]) else 0.0
        if begun != math.inf and (-away if forward else away) > _WRONG * mapped.motion.tolerance(axis):
            # It goes the wrong way, which is judged elsewhere: it is driven back by the other sign, once.
            begun, speeds = math.inf, [{name: -speed for name, speed in speeds[0].items()}]
        ends = mapped.clock.now() > starts_by and mapped.room.ends(speeds[0], seen)
    mapped.drive({})
    mapped.come_to_rest()
