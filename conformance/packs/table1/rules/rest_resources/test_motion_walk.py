"""Velocities in any order, where the turns before have made room for them."""

import pytest

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.goals import make_room
from conformance.packs.table1.robot.robot import Robot, Velocity
from conformance.packs.table1.robot.velocity_walk import VelocityMachine, room_for
from conformance.packs.table1.robot.walk import Walk
from conformance.verdict.effort import Effort
from conformance.verdict.explorer import Explorer

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]


@pytest.mark.requirement(
    "rest-resources/velocity-put",
    "rest-resources/velocity-converges",
    "rest-resources/linear-put",
    "rest-resources/linear-keeps-angular",
    "rest-resources/pose-motion",
    "rest-resources/pose-rotation",
    "safety/refused-keeps",
    "safety/limits-hold",
)
def test_velocity_walk(robot: Robot, effort: Effort, explore: Explorer) -> None:
    """Whatever is asked for, in whatever order, is what the robot does, and its pose follows."""
    make_room(robot, room_for(robot.limits))
    # Zero is not a value that can be refused, however it is signed.
    Drive(robot).command(Velocity(-0.0, -0.0, -0.0, -0.0, -0.0, -0.0))
    walk = Walk(robot, 0.8 * effort.budget_s)
    explore.machine(lambda: VelocityMachine(walk), cases=10, steps=effort.cases(12))
    explore.left_out(walk.left_out)
    walk.drive.judge_motion()
    if walk.unreachable:
        raise walk.unreachable
