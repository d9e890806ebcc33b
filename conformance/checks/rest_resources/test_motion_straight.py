"""Driving straight ahead and back, and turning left and right, as fast as the robot says that it can."""

from typing import Final

import pytest

from conformance.robot.drive import Drive
from conformance.robot.goals import make_room
from conformance.robot.robot import Robot, Velocity

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]
# Where no limits are declared the robot may be slower than the figures that it is judged by.
_UNDECLARED: Final = 0.6


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
    fastest = _direction(robot) * _fastest(robot, 0)
    reached = _reach(drive, Velocity(linear_x=fastest))
    drive.keep(0.2 if reached else 0.0)
    back = Velocity(linear_x=-fastest)
    if _reach(drive, back):
        drive.keep(0.2)
        drive.stop(back)
    drive.judge_motion()


@pytest.mark.requirement("rest-resources/velocity-range", "rest-resources/pose-rotation", "safety/limits-hold")
def test_fast_turns(robot: Robot) -> None:
    """To the left, as fast ahead at the same time as it goes where the limits say so, and to the right on the spot."""
    if not robot.actuated(5):
        pytest.skip("the statement says that the robot cannot turn on the spot")
    drive = Drive(robot)
    drive.look()
    ahead = 0.0
    if robot.actuated(0) and robot.limit_declared(0) and robot.limit_declared(5):
        make_room(robot)
        ahead = _direction(robot) * _fastest(robot, 0)
    for linear, sign in ((ahead, 1), (0.0, -1)):
        if not _reach(drive, Velocity(linear_x=linear, angular_z=sign * _fastest(robot, 5))):
            break
    drive.judge_motion()


def _fastest(robot: Robot, component: int) -> float:
    return robot.limit_of(component) * (1.0 if robot.limit_declared(component) else _UNDECLARED)


def _reach(drive: Drive, velocity: Velocity) -> bool:
    """Whether a velocity is taken and reached; judged as one of the range that the robot declares."""
    if not drive.command(velocity):
        exchange = drive.trace.commands[-1].exchange
        expected = f"{velocity} to be taken, which is within the declared limits"
        return drive.robot.judge.check(
            "rest-resources/velocity-range", holds=False, exchange=exchange, expected=expected, cause=exchange.came
        )
    return drive.reach(velocity, "rest-resources/velocity-converges", "rest-resources/velocity-range")


def _direction(robot: Robot) -> int:
    """Ahead where the arena has room for it, else back."""
    pose = robot.map_pose()
    return 1 if pose is None or robot.in_arena(pose.ahead(robot.limits.linear_m_s)) else -1
