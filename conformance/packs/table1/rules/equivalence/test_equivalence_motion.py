"""Pose and velocity over REST and over SOAP, while the robot moves and when it has come to rest.

What SOAP told before the robot began to move, or to rest, may be what it tells first afterwards: so after each change
the first reading counts. A good robot's may be out as well, by one odometry message that one interface has and the
other has not yet: then everything is done again, and only what is out after each change is judged.
"""

from functools import partial
from typing import Final

import pytest

from conformance.api.soap.service import SoapService
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_rules import judge_drive
from conformance.packs.table1.robot.goals import make_room
from conformance.packs.table1.robot.robot import STILL, Robot, Velocity
from conformance.packs.table1.robot.state_over_soap import STATES, compare, difference, judge_difference
from conformance.transport.exchange import Exchange

pytestmark = [pytest.mark.needs("rest", "subscribers"), pytest.mark.phase("motion"), pytest.mark.motion]
# First readings that are out after so many changes of one kind are no chance.
_CHANGES: Final = 3
# How often a state is compared that stays as it is.
_TIMES: Final = 4


@pytest.mark.requirement("equivalence/pose", "equivalence/velocity")
def test_pose_and_velocity_in_motion(robot: Robot, subscribers: SoapService) -> None:
    """On an arc, where no component of the velocity that a robot has is zero, and at rest after it."""
    make_room(robot)
    drive = Drive(robot)
    arc = robot.share_of_limits(0.3, -0.4)
    # What every first reading so far was out by, of each state after each kind of change.
    suspects: dict[tuple[str, bool], tuple[str, Exchange] | None] = {
        (name, moves): None for name in STATES for moves in (True, False)
    }
    for change in range(_CHANGES):
        # There and back, which needs no more room.
        moving = Velocity(*(-part if change % 2 else part for part in arc))
        for wanted in (moving, STILL):
            suspects = _first_readings(drive, subscribers, wanted, change, suspects)
            for _ in range(0 if change else _TIMES if wanted == moving else 1):
                for name in STATES:
                    compare(robot, subscribers, name, partial(drive.command, wanted))
        if not suspects:
            break
    judge_drive(robot.judge, drive.trace, robot.limits)
    for (name, _), seen in suspects.items():
        if seen is not None:
            judge_difference(robot, name, *seen)


def _first_readings(
    drive: Drive,
    subscribers: SoapService,
    wanted: Velocity,
    change: int,
    suspects: dict[tuple[str, bool], tuple[str, Exchange] | None],
) -> dict[tuple[str, bool], tuple[str, Exchange] | None]:
    """Let the robot take up a velocity, and read for the first time what is suspected; give what is so still."""
    drive.command(wanted)
    drive.reach(wanted)
    # The first time as soon as may be; then when both interfaces must have heard of it.
    pause_s = drive.robot.sample_s if change else 0.0
    drive.clock.sleep(pause_s)
    left = dict(suspects)
    for name, moves in suspects:
        if moves == (wanted != STILL):
            drive.command(wanted)
            problem, exchange = difference(drive.robot, subscribers, name, pause_s)
            left.pop((name, moves))
            if problem:
                left[name, moves] = (problem, exchange)
    return left
