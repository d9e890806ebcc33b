"""Whether a device rests: by its velocity, and by where it is while time passes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import median
from typing import Final

from conformance.measures.samples import FARTHEST, SEVERAL, Noise, Sample, goes_on, slope
from conformance.scenarios.motion.trace import Reading, Resting
from conformance.statement.motion_map import MotionMap

#: Shortest time that shows whether a device creeps, s.
CREEPS_S: Final = 1.0
# By default, how fast a device may seem to move at rest: these shares of its tolerance of speed, and of position.
_OF_SPEED: Final = 0.1
_OF_POSITION: Final = 0.2


def at_rest(readings: Sequence[Reading], motion: MotionMap) -> Resting:
    """Return the noise of a device at rest, measured or at least as its map declares."""
    axes = {
        name: Noise.of([reading.values[name] for reading in readings if reading.values], axis.noise)
        for name, axis in motion.state.axes.items()
    }
    declared = motion.velocity.axes if motion.velocity else {}
    speeds = {
        name: Noise.of([reading.speeds[name] for reading in readings if reading.speeds], declared[name].noise)
        for name in motion.speeds
    }
    return Resting(axes, speeds)


def fastest(readings: Sequence[Reading], motion: MotionMap, *, rested: bool = False) -> str:
    """Return a measured velocity that is not zero in several readings in a row; empty if there is none.

    Of a device that has ``rested`` before, each is judged by what the map declares for rest, if it declares that.
    """
    declared = motion.velocity.axes if rested and motion.velocity else {}
    most = {name: motion.speed_tolerance(name) for name in motion.speeds}
    for name, axis in declared.items():
        if name in most and axis.rest is not None:
            most[name] = min(most[name], axis.rest + FARTHEST * axis.noise)
    seen = [reading.speeds for reading in readings if reading.speeds]
    for window in (seen[index : index + SEVERAL] for index in range(len(seen) - SEVERAL + 1)):
        for name in window[0]:
            speed = median(item[name] for item in window)
            if abs(speed) > most[name]:
                return f"{name} at {speed:.4g} per second"
    return ""


def creeping(readings: Sequence[Reading], motion: MotionMap, resting: Resting) -> str:
    """Return the axes that keep moving, however slowly, as text; empty if none, or if it cannot be told."""
    declared = motion.velocity.axes if motion.velocity else {}
    for name, noise in resting.speeds.items():
        most = declared[name].rest or _OF_SPEED * motion.speed_tolerance(name)
        seen = [(reading.sent, reading.speeds[name]) for reading in readings if reading.speeds]
        if speed := goes_on(seen, _middle, _beside(most, noise.room)):
            return f"{name} at {speed:.3g} per second, on and on"
    for name, noise in resting.axes.items():
        most = motion.state.axes[name].rest or _OF_POSITION * motion.tolerance(name)
        seen = [((reading.sent + reading.received) / 2, reading.values[name]) for reading in readings if reading.values]
        if speed := goes_on(seen, slope, _beside(most, noise.slope_room)):
            return f"{name} by {speed:.3g} per second, on and on"
    return ""


def crept(readings: Sequence[Reading], motion: MotionMap, resting: Resting) -> str:
    """Return the same of the last readings, where they last long enough to tell."""
    last = [reading for reading in readings if reading.sent >= readings[-1].sent - 1.5 * CREEPS_S]
    return creeping(last, motion, resting) if last and last[-1].sent - last[0].sent >= CREEPS_S else ""


def _beside(most: float, room: Callable[[Sequence[Sample]], float]) -> Callable[[Sequence[Sample]], float]:
    return lambda samples: most + room(samples)


def _middle(samples: Sequence[Sample]) -> float:
    return median(value for _, value in samples)
