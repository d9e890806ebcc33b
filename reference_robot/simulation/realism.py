"""The motion of a body, exact and as of a real robot: slipping wheels, odometry that is slow, noisy and drifts.

All values are drawn from one seed, so that a seed always gives the same robot. The values are typical for small indoor
robots with wheel encoders, a gyroscope and a localisation that corrects the pose from time to time.

All values of motion are in SI units; angles in radians, counter-clockwise; poses in the map frame.
"""

import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from reference_robot.kinematics import Accelerations, Kinematics

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


# Shortest and longest delay of a command between the web services and the wheels, s.
_EARLIEST_S: Final = 0.05
_LATEST_S: Final = 0.2
# Standard deviations at rest; in motion a share of the speed is added to those of the velocities.
_POSITION_M: Final = 0.003
_HEADING_RAD: Final = 0.003
_LINEAR_M_S: Final = 0.004
_ANGULAR_RAD_S: Final = 0.01
_IN_MOTION: Final = 0.01
# The mean time between two corrections of the pose by localisation, s, and the remaining error, m.
_SELDOM_S: Final = 30.0
_AFTER_JUMP_M: Final = 0.03
# The tolerances at a goal (m, rad) of a navigation whose odometry is this slow and late.
NEAR_ENOUGH: Final = (0.08, 0.06)
#: The drive of a robot with such imperfections.
IMPERFECT: Final = Kinematics(accelerations=Accelerations(linear=2.0, angular=8.0))


@dataclass(frozen=True)
class Character:
    """The constant imperfections of one robot.

    Attributes:
        odometry_hz: Rate of odometry messages, 5 to 20 Hz.
        slip: The share of the wheels' way by which the body moves less.
        drift: The relative error of every measured turn.
    """

    odometry_hz: float
    slip: float
    drift: float


class Realism:
    """A generator of one robot's imperfections; ``seed`` selects the robot.

    Attributes:
        character: The robot's constant imperfections.
    """

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)  # noqa: S311 - not for cryptography
        draw = self._random.uniform
        self.character = Character(odometry_hz=draw(5.0, 20.0), slip=draw(0.0, 0.03), drift=draw(-0.02, 0.02))
        self._next_jump_s = self._random.expovariate(1 / _SELDOM_S)

    def lateness(self) -> float:
        """Return a random delay of one velocity command, in seconds."""
        return self._random.uniform(_EARLIEST_S, _LATEST_S)

    def slipped(self, before: Motion, after: Motion) -> Motion:
        """Return the body's true motion when slipping wheels turn as far as the way from ``before`` to ``after``."""
        stays = self.character.slip
        return replace(after, x=after.x - stays * (after.x - before.x), y=after.y - stays * (after.y - before.y))

    def estimate(self, belief: Motion, before: Motion, after: Motion, body: Motion, seconds: float) -> Motion:
        """Return the motion that the robot estimates after one step, from encoders, gyroscope and localisation.

        Args:
            belief: The estimate after the previous step.
            before: Where the body was before the step.
            after: Where the body would be now if the wheels did not slip.
            body: Where the body really is now.
            seconds: The duration of the step.
        """
        way = math.hypot(after.x - before.x, after.y - before.y) * math.copysign(1.0, after.linear)
        turned = wrap(after.yaw - before.yaw) * (1 + self.character.drift)
        middle = belief.yaw + turned / 2
        x, y = belief.x + way * math.cos(middle), belief.y + way * math.sin(middle)
        yaw = wrap(belief.yaw + turned)
        self._next_jump_s -= seconds
        if self._next_jump_s < 0:
            self._next_jump_s = self._random.expovariate(1 / _SELDOM_S)
            off = self._random.gauss
            x, y, yaw = body.x + off(0, _AFTER_JUMP_M), body.y + off(0, _AFTER_JUMP_M), body.yaw
        return Motion(x, y, yaw, after.linear, after.angular)

    def noisy(self, belief: Motion) -> Motion:
        """Return an estimated motion with measurement noise added, as one odometry message reports it."""
        off = self._random.gauss
        return Motion(
            belief.x + off(0, _POSITION_M),
            belief.y + off(0, _POSITION_M),
            wrap(belief.yaw + off(0, _HEADING_RAD)),
            belief.linear + off(0, _LINEAR_M_S + _IN_MOTION * abs(belief.linear)),
            belief.angular + off(0, _ANGULAR_RAD_S + _IN_MOTION * abs(belief.angular)),
        )


class Delayed:
    """A queue of velocity commands, each of which arrives at a given time; the order is kept."""

    def __init__(self) -> None:
        self._underway: deque[tuple[float, tuple[float, ...]]] = deque()

    def send(self, arrives: float, command: tuple[float, ...]) -> None:
        """Queue a command (a setpoint of ``advance``) that arrives at a time, s, but not before the previous one."""
        if self._underway:
            arrives = max(arrives, self._underway[-1][0])
        self._underway.append((arrives, command))

    def take_arrived(self, now: float) -> tuple[float, tuple[float, ...]] | None:
        """Remove all commands that have arrived by ``now``; return the newest with its arrival time, or None."""
        newest = None
        while self._underway and self._underway[0][0] <= now:
            newest = self._underway.popleft()
        return newest
