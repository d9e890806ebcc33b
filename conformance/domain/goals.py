"""Where a robot may be sent."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from conformance.domain.geometry import Pose
from conformance.domain.plan import ask, reachable

if TYPE_CHECKING:
    from conformance.domain.robot import Robot


def choose_goals(robot: Robot, distance: float, count: int) -> list[Pose]:
    """So many different poses about ``distance`` metres from the robot (nearer where the statement says so).

    Poses to which the robot has a plan, or that lie on the way to one. Ends the check that asks, as one that cannot be
    judged, where the robot has no plan to anywhere near; a robot that answers no such question is sent straight ahead.
    """
    here = robot.map_pose() or Pose(0.0, 0.0, 0.0)
    reach = min(distance, robot.statement.motion.radius_m) if robot.statement.motion.arena is None else distance
    goals = reachable(robot, here, reach, count)
    if not goals:
        goals = [here.ahead(reach)]
        _, _, exchange = ask(robot, goals[0])
        if exchange.response is not None and 400 <= exchange.response.status < 500:  # noqa: PLR2004 - RFC 9110 15.5
            pytest.skip("the robot has no plan to any pose around it")
    for part in range(1, count):
        if len(goals) < count:
            share = 1 - part / (count + 1)
            x, y = (one + share * (other - one) for one, other in zip(here[:2], goals[0][:2], strict=True))
            goals.append(Pose(x, y, goals[0].yaw))
    return goals
