"""The motion of a differential-drive body: velocity limits, acceleration limits, exact integration of arcs.

All values are in SI units; angles in radians, counter-clockwise; poses in the map frame.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

_STRAIGHT: Final = 1e-6  # rad turned in a step; below it an arc's radius is numerically meaningless


# The limits of the drive. With these accelerations every permitted velocity is reached from every other within 0.45 s,
# which is less than the declared settle time of 0.6 s.
MAX_LINEAR: Final = 0.7  # m/s
MAX_ANGULAR: Final = 2.5  # rad/s


@dataclass(frozen=True)
class Accelerations:
    """The largest accelerations of a drive: linear in m/s², angular in rad/s²."""

    linear: float = 4.0
    angular: float = 12.0


_USUAL: Final = Accelerations()


@dataclass(frozen=True)
class Motion:
    """The body's pose (x, y in m, yaw in rad, -π to π) and velocity (m/s forward, rad/s)."""

    x: float
    y: float
    yaw: float
    linear: float = 0.0
    angular: float = 0.0


def wrap(angle: float) -> float:
    """Return an equivalent angle between -π and π."""
    return math.remainder(angle, math.tau)


def within(value: float, bound: float) -> float:
    """Return the value, limited to the range from -bound to bound."""
    return max(-bound, min(bound, value))


def advance(
    motion: Motion,
    setpoint: tuple[float, float],
    seconds: float,
    is_free: Callable[[float, float], bool],
    accelerations: Accelerations = _USUAL,
) -> Motion:
    """Return the motion after ``seconds`` of approaching a velocity setpoint (m/s, rad/s) within the limits.

    If a wall is in the way, the body keeps its position while the wheels go on turning: the velocity is what wheel
    encoders would measure.
    """
    linear = _approach(motion.linear, within(setpoint[0], MAX_LINEAR), accelerations.linear * seconds)
    angular = _approach(motion.angular, within(setpoint[1], MAX_ANGULAR), accelerations.angular * seconds)
    turned = angular * seconds
    distance = linear * seconds
    # The chord of the arc: its direction is the mean heading, its length distance · sin(a/2) / (a/2).
    half = turned / 2
    chord = distance * (math.sin(half) / half if abs(turned) > _STRAIGHT else 1.0)
    x = motion.x + chord * math.cos(motion.yaw + half)
    y = motion.y + chord * math.sin(motion.yaw + half)
    if chord and not is_free(x, y):
        x, y = motion.x, motion.y
    return Motion(x, y, wrap(motion.yaw + turned), linear, angular)


def _approach(value: float, target: float, step: float) -> float:
    return target if abs(target - value) <= step else value + math.copysign(step, target - value)
