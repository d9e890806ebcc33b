"""Driving straight ahead: what is asked for is reached, measured alike everywhere, and moves the pose."""

import pytest

from conformance.rest.interface import RestInterface
from conformance.robot.drive import BusyError, Drive
from conformance.robot.goals import make_room
from conformance.robot.robot import Robot, Velocity
from conformance.robot.stopping import bring_to_rest

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
def test_straight_drive(api: RestInterface) -> None:
    """Ahead for less than a second, and a stop."""
    reason = bring_to_rest(api)
    if reason:
        pytest.skip(reason)
    robot = Robot(api)
    if not robot.actuated(0):
        pytest.skip("the statement says that the robot cannot drive straight ahead")
    make_room(robot)
    drive = Drive(robot)
    try:
        drive.look()
        ahead = Velocity(_direction(robot) * 0.6 * robot.limits.linear_m_s)
        if not drive.command(ahead):
            return
        reached = drive.reach(ahead, "rest-resources/velocity-converges")
        drive.keep(0.4 if reached else 0.0)
        drive.stop(ahead)
    except BusyError as busy:
        pytest.skip(str(busy))
    drive.judge_motion()


def _direction(robot: Robot) -> int:
    """Ahead where the arena has room for it, else back."""
    pose = robot.map_pose()
    return 1 if pose is None or robot.in_arena(pose.ahead(robot.limits.linear_m_s)) else -1
