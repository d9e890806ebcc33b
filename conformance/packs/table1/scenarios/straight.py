"""Driving straight ahead and back: very slowly, and at the highest declared speed."""

import random
from typing import Final

from conformance.packs.table1.robot.abilities import AHEAD
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.goals import make_room
from conformance.packs.table1.robot.motion_map import By
from conformance.packs.table1.robot.robot import Robot, Velocity
from conformance.packs.table1.robot.velocity_range import direction, fastest, reach, slowest
from conformance.packs.table1.scenarios.trace import Driven
from conformance.scenarios.scenario import NotPossibleError, partial_trace, scenario
from conformance.scenarios.stage import Need
from conformance.verdict.run import Run

_WAYS: Final[tuple[By, ...]] = ("velocity", "linear", "xml")


@scenario(needs={Need.REST, Need.MOTION})
def straight(robot: Robot, run: Run) -> Driven:
    """Drive ahead for less than a second, back to the start, and stop."""
    if not robot.actuated(0):
        raise NotPossibleError("the statement says that the robot cannot drive straight ahead")
    make_room(robot)
    drive = Drive(robot)
    with partial_trace(lambda: Driven(drive.whole)):
        _play(robot, drive, run)
    return Driven(drive.whole)


def _play(robot: Robot, drive: Drive, run: Run) -> None:
    drive.look()
    reach(drive, slowest(robot))
    sign = direction(robot)
    ahead = Velocity(linear_x=fastest(robot, AHEAD, sign))
    reached = reach(drive, ahead)
    drive.keep(0.2 if reached else 0.0)
    back = Velocity(linear_x=fastest(robot, AHEAD, -sign))
    if not any(back):
        # a robot without a reverse gear stops where it is
        back = ahead
    elif reached := reach(drive, back):
        drive.keep(0.2)
    # Forth and back with each path that commands a velocity; at quick, the seed chooses one.
    ways = [random.Random(f"{run.seed}/stop").choice(_WAYS)] if run.effort.name == "quick" else _WAYS  # noqa: S311
    for by in ways if reached else ():
        if by != ways[0]:
            back = Velocity(*(-part for part in back))
            drive.refresh(back)
        if not drive.stop(back, by) or not robot.reverses:
            return
