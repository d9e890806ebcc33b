"""Where a robot may be sent."""

from __future__ import annotations

from typing import TYPE_CHECKING

from conformance.domain.geometry import Pose
from conformance.domain.plan import reachable

if TYPE_CHECKING:
    from conformance.domain.robot import Robot


def choose_goals(robot: Robot, distance: float, count: int) -> list[Pose]:
    """So many different poses about ``distance`` metres from the robot (nearer where the statement says so).

    Poses to which the robot has a plan; where it has too few, what is missing lies straight ahead.
    """
    here = robot.map_pose() or Pose(0.0, 0.0, 0.0)
    reach = min(distance, robot.statement.motion.radius_m) if robot.statement.motion.arena is None else distance
    goals = reachable(robot, here, reach, count)
    while len(goals) < count:
        goals.append(here.ahead(reach / (1 + len(goals))))
    return goals
