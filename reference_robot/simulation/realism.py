"""What a real robot does otherwise than arithmetic: its wheels slip, its odometry is late, noisy and drifts.

Pure: everything is drawn from one seed, so a seed is a robot. The figures are those of small indoor robots with wheel
encoders, a gyroscope and a localisation that puts the pose right now and then.
"""

import math
import random
from collections import deque
from dataclasses import dataclass, replace
from typing import Final

from reference_robot.simulation.kinematics import Accelerations, Motion, wrap

# A command takes so long from the web services to the wheels, s.
_EARLIEST_S: Final = 0.05
_LATEST_S: Final = 0.2
# Standard deviations at rest: m, rad, m/s, rad/s; in motion a share of the speed comes on top of the last two.
_POSITION_M: Final = 0.003
_HEADING_RAD: Final = 0.003
_LINEAR_M_S: Final = 0.004
_ANGULAR_RAD_S: Final = 0.01
_IN_MOTION: Final = 0.01
# Localisation puts the pose right once in so long, s, and then is off by this, m.
_SELDOM_S: Final = 30.0
_AFTER_JUMP_M: Final = 0.03

# How near to a goal navigation has to come that is told of the robot's place so seldom and so late: m, rad.
NEAR_ENOUGH: Final = (0.08, 0.06)

_ACCELERATIONS: Final = Accelerations(linear=2.0, angular=8.0)


@dataclass(frozen=True)
class Character:
    """What is one robot's own.

    Attributes:
        odometry_hz: 5 to 20.
        slip: share of the way that the wheels turn and the body does not move.
        drift: share by which each turn is told too great or too small.
    """

    odometry_hz: float
    slip: float
    drift: float


class Realism:
    """The imperfections of one robot; ``seed`` chooses them.

    Attributes:
        character: what stays as it is.
        accelerations: what its drive can do.
    """

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)  # noqa: S311 - no secret
        draw = self._random.uniform
        self.character = Character(odometry_hz=draw(5.0, 20.0), slip=draw(0.0, 0.03), drift=draw(-0.02, 0.02))
        self.accelerations = _ACCELERATIONS
        self._next_jump_s = self._random.expovariate(1 / _SELDOM_S)

    def lateness(self) -> float:
        """How long one command is on its way, s."""
        return self._random.uniform(_EARLIEST_S, _LATEST_S)

    def slipped(self, before: Motion, after: Motion) -> Motion:
        """Where the body is when its wheels have gone from one place to another."""
        stays = self.character.slip
        return replace(after, x=after.x - stays * (after.x - before.x), y=after.y - stays * (after.y - before.y))

    def believed(self, belief: Motion, before: Motion, after: Motion, body: Motion, seconds: float) -> Motion:
        """Where the robot believes to be after a step of its wheels, by encoders, gyroscope and localisation.

        Args:
            belief: the same after the step before.
            before: where the body was before the step.
            after: where the wheels would have taken it.
            body: where the body really is now.
            seconds: how long the step was.
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
        """One sample of the odometry."""
        off = self._random.gauss
        return Motion(
            belief.x + off(0, _POSITION_M),
            belief.y + off(0, _POSITION_M),
            wrap(belief.yaw + off(0, _HEADING_RAD)),
            belief.linear + off(0, _LINEAR_M_S + _IN_MOTION * abs(belief.linear)),
            belief.angular + off(0, _ANGULAR_RAD_S + _IN_MOTION * abs(belief.angular)),
        )


class Delayed:
    """Commands on their way, which arrive in their order, each at its time."""

    def __init__(self) -> None:
        self._underway: deque[tuple[float, tuple[float, float]]] = deque()

    def send(self, arrives: float, command: tuple[float, float]) -> None:
        """Send a command (m/s, rad/s) that arrives then, s, or right after the one before it."""
        if self._underway:
            arrives = max(arrives, self._underway[-1][0])
        self._underway.append((arrives, command))

    def arrived(self, now: float) -> tuple[float, tuple[float, float]] | None:
        """Take what has arrived by now: the newest command, and when it came; None where nothing has."""
        newest = None
        while self._underway and self._underway[0][0] <= now:
            newest = self._underway.popleft()
        return newest
