"""Driving straight ahead: what is asked for is reached, measured alike everywhere, and moves the pose."""

import pytest

from conformance.robot.drive import Drive
from conformance.robot.goals import make_room
from conformance.robot.robot import Robot, Velocity

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]


@pytest.mark.requirement(
    "rest-resources/velocity-put",
    "rest-resources/velocity-converges",
    "rest-resources/velocity-odometry",
    "rest-resources/linear-agrees",
    "rest-resources/pose-motion",
    "safety/stop",
    "safety/limits-hold",
)
def test_straight_drive(robot: Robot) -> None:
    """Ahead for less than a second, and a stop."""
    if not robot.actuated(0):
        pytest.skip("the statement says that the robot cannot drive straight ahead")
    make_room(robot)
    drive = Drive(robot)
    drive.look()
    ahead = Velocity(_direction(robot) * 0.6 * robot.limits.linear_m_s)
    if not drive.command(ahead):
        return
    reached = drive.reach(ahead, "rest-resources/velocity-converges")
    drive.keep(0.4 if reached else 0.0)
    drive.stop(ahead)
    drive.judge_motion()


def _direction(robot: Robot) -> int:
    """Ahead where the arena has room for it, else back."""
    pose = robot.map_pose()
    return 1 if pose is None or robot.in_arena(pose.ahead(robot.limits.linear_m_s)) else -1
