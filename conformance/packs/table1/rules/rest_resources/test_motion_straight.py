"""Driving straight ahead and back: hardly at all, and as fast as the robot says that it can."""

import pytest

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.goals import make_room
from conformance.packs.table1.robot.robot import Robot, Velocity
from conformance.packs.table1.robot.velocity_range import direction, fastest, reach, slowest

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]


@pytest.mark.requirement(
    "rest-resources/velocity-put",
    "rest-resources/velocity-converges",
    "rest-resources/velocity-range",
    "rest-resources/velocity-odometry",
    "rest-resources/linear-agrees",
    "rest-resources/pose-motion",
    "safety/stop",
    "safety/limits-hold",
)
def test_straight_drive(robot: Robot) -> None:
    """Ahead for less than a second, back where it came from, and a stop."""
    if not robot.actuated(0):
        pytest.skip("the statement says that the robot cannot drive straight ahead")
    make_room(robot)
    drive = Drive(robot)
    drive.look()
    reach(drive, slowest(robot))
    ahead = Velocity(linear_x=direction(robot) * fastest(robot, 0))
    reached = reach(drive, ahead)
    drive.keep(0.2 if reached else 0.0)
    back = Velocity(linear_x=-ahead.linear_x)
    if reach(drive, back):
        drive.keep(0.2)
        drive.stop(back)
    drive.judge_motion()
