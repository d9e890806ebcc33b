"""How a differential-drive body moves: velocity limits, acceleration limits, exact integration of arcs.

SI units throughout; angles in radians, counter-clockwise, poses in the map frame.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

_STRAIGHT: Final = 1e-6  # rad turned in a step; below it an arc's radius is numerically meaningless


@dataclass(frozen=True)
class Limits:
    """What the drive can do: m/s, rad/s, m/s², rad/s².

    The accelerations let any permitted velocity follow any other within 0.45 s, which is inside the
    0.6 s settle time that the robot declares.
    """

    linear: float = 0.7
    angular: float = 2.5
    linear_acceleration: float = 4.0
    angular_acceleration: float = 12.0


@dataclass(frozen=True)
class Motion:
    """Pose (x, y in m, yaw in rad, -π to π) and velocity (m/s forward, rad/s) of the body."""

    x: float
    y: float
    yaw: float
    linear: float = 0.0
    angular: float = 0.0


def wrap(angle: float) -> float:
    """Bring an angle into -π to π."""
    return math.remainder(angle, math.tau)


def within(value: float, bound: float) -> float:
    """Clamp a value to ± bound."""
    return max(-bound, min(bound, value))


def advance(
    motion: Motion,
    setpoint: tuple[float, float],
    seconds: float,
    limits: Limits,
    is_free: Callable[[float, float], bool],
) -> Motion:
    """Move on for some seconds towards a velocity setpoint (m/s, rad/s), which is clamped to the limits.

    Against a wall the body stays where it is while its wheels go on turning: the velocity is the one
    that wheel encoders would measure.
    """
    linear = _approach(motion.linear, within(setpoint[0], limits.linear), limits.linear_acceleration * seconds)
    angular = _approach(motion.angular, within(setpoint[1], limits.angular), limits.angular_acceleration * seconds)
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
