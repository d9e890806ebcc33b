"""Whether a device rests: by its velocity, and by where it is while time passes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from statistics import median
from typing import Final

from conformance.measures.samples import FARTHEST, SEVERAL, Noise, Sample, goes_on, scatter, slope
from conformance.scenarios.motion.trace import Reading, Resting
from conformance.statement.motion_map import MotionMap

#: Shortest time that shows whether a device creeps, s.
CREEPS_S: Final = 1.0
# Time in which a device that has rested is seen to creep, s.
_SETS_OUT_S: Final = 0.6
# These shares of its tolerance of speed, and of position, by default, how fast a device may seem to move at rest.
_OF_SPEED: Final = 0.1
_OF_POSITION: Final = 0.2
_Rate = Callable[[Sequence[Sample]], float | None]


def at_rest(readings: Sequence[Reading], motion: MotionMap) -> Resting:
    """Return the noise of a device at rest, measured or at least as its map declares.

    How fast it seems to move counts as noise, unless the map declares that: the device may creep already.
    """
    axes = {}
    for name, axis in motion.state.axes.items():
        seen = [(reading.sent, reading.values[name]) for reading in readings if reading.values]
        rate = (slope(seen) or 0.0) if axis.rest is not None else 0.0
        axes[name] = Noise.of([value - rate * (moment - seen[0][0]) for moment, value in seen], axis.noise)
    declared = motion.velocity.axes if motion.velocity else {}
    speeds = {
        name: Noise.of([reading.speeds[name] for reading in readings if reading.speeds], declared[name].noise)
        for name in motion.speeds
    }
    # Of a velocity that is measured, its offset.
    still = {name: noise if declared[name].rest is None else noise._replace(off=0.0) for name, noise in speeds.items()}
    return Resting(axes, still)


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
    for said, seen, rate, most in _seen_of(readings, motion, resting):
        if speed := goes_on(seen, rate, most):
            return f"{said} {speed:.3g} per second, on and on"
    return ""


def may_creep(readings: Sequence[Reading], motion: MotionMap, resting: Resting) -> bool:
    """Return whether all readings together show an axis that moves, but are too few to show that it keeps moving."""
    return any(
        len(seen) >= 2 * SEVERAL and abs(rate(seen) or 0.0) > most(seen)
        for _, seen, rate, most in _seen_of(readings, motion, resting)
    )


def _seen_of(
    readings: Sequence[Reading], motion: MotionMap, resting: Resting
) -> Iterator[tuple[str, list[Sample], _Rate, Callable[[Sequence[Sample]], float]]]:
    """Yield for each axis its name, its samples, a function for their rate, and one for the greatest rate at rest."""
    declared = motion.velocity.axes if motion.velocity else {}

    def noisier(noise: Noise, seen: Sequence[Sample]) -> Noise:
        """Return the greater noise: before any move, or of these samples. A few samples at rest may show too little."""
        return noise._replace(sigma=max(noise.sigma, scatter(seen)))

    for name, noise in resting.speeds.items():
        most = declared[name].rest or _OF_SPEED * motion.speed_tolerance(name)
        seen = [(reading.sent, reading.speeds[name]) for reading in readings if reading.speeds]
        yield (
            f"{name} at",
            seen,
            lambda samples: median(value for _, value in samples),
            _beside(most, noisier(noise, seen).room),
        )
    for name, noise in resting.axes.items():
        most = motion.state.axes[name].rest or _OF_POSITION * motion.tolerance(name)
        seen = [((reading.sent + reading.received) / 2, reading.values[name]) for reading in readings if reading.values]
        yield f"{name} by", seen, slope, _beside(most, noisier(noise, seen).slope_room)


def crept(readings: Sequence[Reading], motion: MotionMap, resting: Resting) -> str:
    """Return the same as `creeping`, for the last readings, if they last long enough."""
    last = [reading for reading in readings if reading.sent >= readings[-1].sent - 1.5 * CREEPS_S]
    return creeping(last, motion, resting) if last and last[-1].sent - last[0].sent >= CREEPS_S else ""


def set_out(readings: Sequence[Reading], motion: MotionMap, resting: Resting) -> str:
    """Return the axes that rested, and then moved on for a while, however slowly, as text; empty if there is none."""
    for said, seen, rate, most in _seen_of(readings, motion, resting):
        rested = False
        for begin in range(0, len(seen), SEVERAL):
            window = [sample for sample in seen[begin:] if sample[0] <= seen[begin][0] + _SETS_OUT_S]
            if window[-1][0] - seen[begin][0] < _SETS_OUT_S / 2 or len(window) < 2 * SEVERAL:
                break
            speed = goes_on(window, rate, most)
            if rested and abs(speed) > 2 * most(window):
                return f"{said} {speed:.3g} per second for {_SETS_OUT_S:g} s"
            rested = rested or abs(rate(window) or 0.0) <= most(window)
    return ""


def _beside(most: float, room: Callable[[Sequence[Sample]], float]) -> Callable[[Sequence[Sample]], float]:
    return lambda samples: most + room(samples)
