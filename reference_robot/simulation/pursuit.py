"""Pure pursuit: velocities that drive a differential-drive robot along a path and turn it to the final yaw."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from reference_robot.simulation.kinematics import within, wrap
from reference_robot.simulation.office import Floats

CRUISE: Final = 0.6  # m/s, below the base's limit
_TURN: Final = 1.8  # rad/s
_LOOKAHEAD: Final = 0.4  # m
EXACT: Final = (0.03, 0.02)  # m, rad
_DRIFT: Final = 0.1  # m from the goal beyond which a robot that turns on the spot drives again
_TURN_ON_SPOT: Final = 0.6  # rad off the course beyond which the robot stops and turns
_SEARCH_AHEAD: Final = 8  # path poses among which the nearest is searched


@dataclass(frozen=True)
class Command:
    """A velocity to drive with (m/s, rad/s), the remaining path length (m), and whether the goal is reached."""

    linear: float
    angular: float
    remaining: float
    arrived: bool


class Pursuit:
    """A controller that follows a planned path, (k, 3) poses, to its end within tolerances (m, rad)."""

    def __init__(self, path: Floats, tolerances: tuple[float, float] = EXACT) -> None:
        self._path = path
        self._near, self._straight = tolerances
        pieces = np.hypot(*np.diff(path[:, :2], axis=0).T)
        self._left = np.append(np.cumsum(pieces[::-1])[::-1], 0.0)
        self._nearest = 0
        self._turning = False

    def command(self, x: float, y: float, yaw: float) -> Command:
        """Return the next velocity for a robot at the given pose."""
        goal_x, goal_y, goal_yaw = self._path[-1]
        off = math.dist((x, y), (goal_x, goal_y))
        if off < self._near:
            self._turning = True
        elif off > _DRIFT:
            self._turning = False
        if self._turning:
            error = wrap(goal_yaw - yaw)
            arrived = abs(error) < self._straight
            return Command(0.0, 0.0 if arrived else within(2.5 * error, _TURN), off, arrived)
        target_x, target_y, remaining = self._target(x, y)
        course = wrap(math.atan2(target_y - y, target_x - x) - yaw)
        angular = within(3.0 * course, _TURN)
        if abs(course) > _TURN_ON_SPOT:
            return Command(0.0, angular, remaining, arrived=False)
        # Slower near the goal, so that the robot stops there, and off the course, so that it cuts no corners.
        linear = min(CRUISE, 1.5 * off + 0.02) * math.cos(course) ** 4
        return Command(linear, angular, remaining, arrived=False)

    def _target(self, x: float, y: float) -> tuple[float, float, float]:
        """Return x and y of the path pose that lies the lookahead distance ahead, and the remaining path length."""
        window = self._path[self._nearest : self._nearest + _SEARCH_AHEAD, :2]
        distances = np.hypot(*(window - (x, y)).T)
        self._nearest += int(distances.argmin())
        ahead = self._left <= self._left[self._nearest] - _LOOKAHEAD
        target = self._path[int(ahead.argmax()) if ahead.any() else -1]
        return float(target[0]), float(target[1]), float(self._left[self._nearest] + distances.min())
