"""Measure velocities by several readings, so that no single reading decides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Final

from conformance.measures.samples import LATE, SEVERAL, slope, usual_s
from conformance.scenarios.motion.trace import Reading, Resting, middle_of
from conformance.statement.motion_map import MotionMap

# A reading is late if it takes longer than usual, and longer than this share of the drive.
_SHARE: Final = 0.1
# Shortest time in which a velocity is computed from positions, s.
_LAPSE_S: Final = 0.1
# Share of a velocity at which a device stands.
_STANDS: Final = 0.1
#: A velocity is steady if each half of this time shows it, s; a device may also pass through a velocity.
STEADY_S: Final = 0.36


def speed_in(readings: Sequence[Reading], name: str, motion: MotionMap) -> float | None:
    """Return a velocity by some readings, in units per second; None if they do not show it."""
    speed = motion.velocity.axes[name] if motion.velocity else None
    if speed is None or not speed.of:
        speeds = [reading.speeds[name] for reading in readings if reading.speeds]
        return median(speeds) if len(speeds) >= SEVERAL else None
    # If a response came late, the time of its position is not known.
    late_s = max(LATE * usual_s(readings), _SHARE * (readings[-1].sent - readings[0].sent)) if readings else 0.0
    seen = [
        ((reading.sent + reading.received) / 2, reading.values[speed.of])
        for reading in readings
        if reading.values and reading.received - reading.sent <= late_s
    ]
    if len(seen) < 2 * SEVERAL or seen[-1][0] - seen[0][0] < _LAPSE_S:
        return None
    rate = slope(seen)
    return None if rate is None else rate / speed.scale


def end_of_travel(
    readings: Sequence[Reading], name: str, wanted: float, motion: MotionMap, so_far: Sequence[Reading]
) -> float | None:
    """Return where a driven device has stopped moving, if this may be the undeclared end of its travel.

    Args:
        readings: under way.
        name: the velocity.
        wanted: how fast it is, units per second.
        motion: the map.
        so_far: other readings; a device that was farther in this direction does not stand at its end.
    """
    speed = motion.velocity.axes[name] if motion.velocity else None
    if speed is None or not speed.of or not wanted or motion.state.axes[speed.of].bound:
        return None
    last = [reading for reading in readings if reading.values and reading.sent >= readings[-1].sent - STEADY_S]
    found, room, way = speed_in(last, name, motion), motion.tolerance(speed.of), 1 if wanted > 0 else -1
    if found is None or abs(found) > _STANDS * abs(wanted) or last[-1].sent - last[0].sent < STEADY_S / 2:
        return None
    place = middle_of(last[-SEVERAL:], speed.of)
    farther = any(way * (reading.values[speed.of] - place) > room for reading in so_far if reading.values)
    return None if farther else place


def noise_of(readings: Sequence[Reading], name: str, motion: MotionMap, resting: Resting) -> float:
    """Return how far off a velocity may be for the noise of some readings alone, in units per second."""
    speed = motion.velocity.axes[name] if motion.velocity else None
    if speed is not None and speed.of in resting.axes:
        places = [(reading.sent, reading.values[speed.of]) for reading in readings if reading.values]
        return resting.axes[speed.of].slope_room(places) / speed.scale
    found = [(reading.sent, reading.speeds[name]) for reading in readings if reading.speeds]
    return resting.speeds[name].room(found) if name in resting.speeds else 0.0


def steady_since(
    readings: Sequence[Reading], wanted: Mapping[str, float], motion: MotionMap, resting: Resting
) -> float | None:
    """Return since when the last readings show some velocities and no change, s; None if they do not."""
    if not readings:
        return None
    begin = readings[-1].sent - STEADY_S
    last = [reading for reading in readings if reading.sent >= begin]
    if len(last) == len(readings):
        return None
    for half in (last[: len(last) // 2], last[len(last) // 2 :]):
        for name, speed in wanted.items():
            found = speed_in(half, name, motion)
            if found is None:
                return None
            if abs(found - speed) > motion.speed_tolerance(name) + noise_of(half, name, motion, resting):
                return None
    for name, speed in wanted.items():
        found = speed_in(last, name, motion)
        if found is None or abs(found - speed) > motion.speed_tolerance(name):
            return None
    return last[0].sent
