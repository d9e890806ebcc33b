"""The motion of a body: velocity limits, acceleration limits, exact integration of arcs.

All values are in SI units; angles in radians, counter-clockwise; poses in the map frame.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from reference_robot.kinematics import Kinematics

_STRAIGHT: Final = 1e-6  # rad turned in a step; below it an arc's radius is numerically meaningless


# The limits of the drive. With these accelerations every permitted velocity is reached from every other within 0.45 s,
# which is less than the declared settle time of 0.6 s.
MAX_LINEAR: Final = 0.7  # m/s
MAX_ANGULAR: Final = 2.5  # rad/s

_USUAL: Final = Kinematics()


@dataclass(frozen=True)
class Motion:
    """The body's pose (x, y in m, yaw in rad, -π to π) and velocity (m/s forward, rad/s, m/s to the left)."""

    x: float
    y: float
    yaw: float
    linear: float = 0.0
    angular: float = 0.0
    lateral: float = 0.0


def wrap(angle: float) -> float:
    """Return an equivalent angle between -π and π."""
    return math.remainder(angle, math.tau)


def within(value: float, bound: float) -> float:
    """Return the value, limited to the range from -bound to bound."""
    return max(-bound, min(bound, value))


def advance(
    motion: Motion,
    setpoint: tuple[float, ...],
    seconds: float,
    is_free: Callable[[float, float], bool],
    kinematics: Kinematics = _USUAL,
) -> Motion:
    """Return the motion after ``seconds`` of approaching a velocity setpoint within the limits.

    The setpoint is (m/s ahead, rad/s) or (m/s ahead, rad/s, m/s to the left).

    If a wall is in the way, the body keeps its position while the wheels go on turning: the velocity is what wheel
    encoders would measure.
    """
    accelerations = kinematics.accelerations
    ahead = within(setpoint[0] if kinematics.reverses else max(0.0, setpoint[0]), MAX_LINEAR)
    linear = _approach(motion.linear, ahead, accelerations.linear * seconds)
    angular = _approach(motion.angular, within(setpoint[1], MAX_ANGULAR), accelerations.angular * seconds)
    if kinematics.min_radius:
        angular = within(angular, abs(linear) / kinematics.min_radius)
    aside = within(setpoint[2] if setpoint[2:] else 0.0, kinematics.max_lateral)
    lateral = _approach(motion.lateral, aside, accelerations.linear * seconds)
    turned = angular * seconds
    distance = linear * seconds
    # The chord of the arc: its direction is the mean heading, its length distance · sin(a/2) / (a/2).
    half = turned / 2
    bow = math.sin(half) / half if abs(turned) > _STRAIGHT else 1.0
    chord, across, heading = distance * bow, lateral * seconds * bow, motion.yaw + half
    x = motion.x + chord * math.cos(heading) - across * math.sin(heading)
    y = motion.y + chord * math.sin(heading) + across * math.cos(heading)
    if (chord or across) and not is_free(x, y):
        x, y = motion.x, motion.y
    return Motion(x, y, wrap(motion.yaw + turned), linear, angular, lateral)


def _approach(value: float, target: float, step: float) -> float:
    return target if abs(target - value) <= step else value + math.copysign(step, target - value)
