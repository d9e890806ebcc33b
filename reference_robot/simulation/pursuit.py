"""Pure pursuit: velocities that drive a robot along a path and turn it to the final yaw.

A robot that cannot turn on the spot turns as a car does in a narrow street: to and fro on two arcs.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from reference_robot.kinematics import Kinematics
from reference_robot.simulation.kinematics import within, wrap
from reference_robot.simulation.office import Floats

_TO_AND_FRO: Final = 0.03  # m to either side of where a robot turns that cannot do so on the spot
_LOOKAHEAD: Final = 0.4  # m
EXACT: Final = (0.03, 0.02)  # m, rad
_SLOWEST_TURN: Final = 0.3  # rad/s of a robot that turns to and fro
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

    def __init__(
        self, path: Floats, tolerances: tuple[float, float] = EXACT, kinematics: Kinematics | None = None
    ) -> None:
        self._path = path
        self._kinematics = kinematics or Kinematics()
        self._turned_at: tuple[float, float] | None = None
        self._sense = 1.0
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
            self._turned_at = float(goal_x), float(goal_y)
            arrived = abs(error) < self._straight
            turn = 3.0 * error + math.copysign(0.1, error)
            return self._turn(0.0 if arrived else turn, off, (x, y, yaw), arrived=arrived)
        target_x, target_y, remaining = self._target(x, y)
        course = wrap(math.atan2(target_y - y, target_x - x) - yaw)
        if abs(course) > _TURN_ON_SPOT:
            return self._turn(3.0 * course, remaining, (x, y, yaw))
        self._turned_at = None
        # Slower near the goal, so that the robot stops there, and off the course, so that it cuts no corners.
        linear = min(self._kinematics.cruise, 2.5 * off + 0.05) * math.cos(course) ** 4
        return Command(linear, within(3.0 * course, self._kinematics.turn), remaining, arrived=False)

    def _turn(
        self, angular: float, remaining: float, pose: tuple[float, float, float], *, arrived: bool = False
    ) -> Command:
        """Return the velocity that turns the robot where it is."""
        turn = within(angular, self._kinematics.turn)
        if not self._kinematics.min_radius or arrived:
            return Command(0.0, turn, remaining, arrived)
        x, y, yaw = pose
        self._turned_at = self._turned_at or (x, y)
        ahead = (x - self._turned_at[0]) * math.cos(yaw) + (y - self._turned_at[1]) * math.sin(yaw)
        if abs(ahead) > _TO_AND_FRO:
            self._sense = -math.copysign(1.0, ahead)
        speed = 1.02 * self._kinematics.min_radius * max(abs(turn), _SLOWEST_TURN)
        return Command(self._sense * speed, math.copysign(max(abs(turn), _SLOWEST_TURN), turn), remaining, arrived)

    def _target(self, x: float, y: float) -> tuple[float, float, float]:
        """Return x and y of the path pose that lies the lookahead distance ahead, and the remaining path length."""
        window = self._path[self._nearest : self._nearest + _SEARCH_AHEAD, :2]
        distances = np.hypot(*(window - (x, y)).T)
        self._nearest += int(distances.argmin())
        ahead = self._left <= self._left[self._nearest] - _LOOKAHEAD
        target = self._path[int(ahead.argmax()) if ahead.any() else -1]
        return float(target[0]), float(target[1]), float(self._left[self._nearest] + distances.min())
