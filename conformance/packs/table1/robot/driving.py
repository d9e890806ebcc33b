"""A drive for checks that both talk and judge: its trace is judged when the drive ends, also after an exception."""

from collections.abc import Iterator
from contextlib import contextmanager

from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_rules import judge_drive
from conformance.packs.table1.robot.robot import Robot


@contextmanager
def driving(robot: Robot, *, way: bool = False) -> Iterator[Drive]:
    """Yield a drive and judge its trace at the end; ``way``: also whether the pose followed the velocity."""
    drive = Drive(robot)
    try:
        yield drive
    finally:
        judge_drive(robot.judge, drive.whole, robot.limits, way=way)
