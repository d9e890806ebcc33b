"""Velocities that a robot can drive, by its statement: components, speeds, and the narrowest circle."""

import math
from collections.abc import Sequence
from typing import Final

from conformance.packs.table1.limits import Limits
from conformance.packs.table1.statement import Motion

#: Indexes into Velocity of the components that a wheeled robot has: ahead, and about the vertical axis.
AHEAD, ABOUT = 0, 5
# Components of a velocity, the one that needs least room first.
_BY_ROOM: Final = (ABOUT, AHEAD, 1, 2, 3, 4)
# A circle this much wider than the narrowest is driveable despite rounding.
_WIDER: Final = 1.02


def drivable(limits: Limits, motion: Motion, velocity: Sequence[float]) -> tuple[float, ...]:
    """Return the velocity (six components) that a robot can drive instead of one that it may be unable to drive.

    A component that is not actuated becomes zero. A robot without a reverse gear drives ahead instead. A robot that
    cannot turn on the spot turns in its narrowest circle. Where the speed of the wheels limits a curve, both parts
    become smaller.
    """
    fitted = [_within(limits, motion, component, value) for component, value in enumerate(velocity)]
    radius, separation = motion.min_radius_m, motion.wheel_separation_m
    if radius and fitted[ABOUT] and abs(fitted[AHEAD]) < radius * abs(fitted[ABOUT]):
        least = math.copysign(_WIDER * radius * abs(fitted[ABOUT]), fitted[AHEAD] or 1.0)
        fitted[AHEAD] = _within(limits, motion, AHEAD, least)
        fitted[ABOUT] = turn_beside(limits, motion, fitted[AHEAD], fitted[ABOUT])
    if separation and fitted[AHEAD] and fitted[ABOUT]:
        wheel = abs(fitted[AHEAD]) + abs(fitted[ABOUT]) * separation / 2
        share = min(1.0, _wheels(limits) / wheel)
        fitted[AHEAD], fitted[ABOUT] = share * fitted[AHEAD], share * fitted[ABOUT]
    return tuple(fitted)


def turn_beside(limits: Limits, motion: Motion, ahead: float, turn: float) -> float:
    """Return the turning rate of ``turn`` or less, rad/s, that a robot can have while it drives at ``ahead``, m/s."""
    most = abs(turn)
    if motion.min_radius_m:
        most = min(most, abs(ahead) / (_WIDER * motion.min_radius_m))
    if motion.wheel_separation_m:
        most = min(most, max(0.0, _wheels(limits) - abs(ahead)) * 2 / motion.wheel_separation_m)
    return math.copysign(most, turn)


def _wheels(limits: Limits) -> float:
    """Return the greatest speed of a wheel, m/s."""
    return max(map(abs, limits.range_of(AHEAD)))


def can_move(motion: Motion, component: int) -> bool:
    """Return whether a robot can move in a component (index into Velocity)."""
    part, axis = divmod(component, len("xyz"))
    return f"{('linear', 'angular')[part]}.{'xyz'[axis]}" in motion.actuated


def handiest(motion: Motion) -> int:
    """Return the component in which a robot can move with the least room."""
    return next((component for component in _BY_ROOM if can_move(motion, component)), ABOUT)


def _within(limits: Limits, motion: Motion, component: int, value: float) -> float:
    """Return a component clipped to its range, or in the other direction if the robot has only that one."""
    if not can_move(motion, component):
        return 0.0
    least, greatest = limits.range_of(component)
    if (value < 0 and not least) or (value > 0 and not greatest):
        value = -value
    return max(least, min(greatest, value))
