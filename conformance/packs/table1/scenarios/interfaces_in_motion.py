"""Pose and velocity over REST and over SOAP, while the robot moves and when it has come to rest.

What SOAP told before the robot began to move, or to rest, may be what it tells first afterwards: so after each change
the first reading counts. A good robot's may be out as well, by one odometry message that one interface has and the
other has not yet: then everything is done again, and only what is out after each change is recorded.
"""

from dataclasses import replace
from functools import partial
from typing import Final

from conformance.api.soap.service import SoapService
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.goals import make_room
from conformance.packs.table1.robot.robot import STILL, Robot, Velocity
from conformance.packs.table1.robot.state_over_soap import STATES, StateRead, compare, for_good, read_state
from conformance.scenarios.scenario import PartialTraceError, scenario
from conformance.scenarios.stage import Need

# First readings that are out after so many changes of one kind are no chance.
_CHANGES: Final = 3
# How often a state is compared that stays as it is.
_TIMES: Final = 4
# What every first reading so far was out by, of each state while the robot moves or is at rest; None: nothing was read.
_Suspects = dict[tuple[str, bool], StateRead | None]


@scenario(needs={Need.REST, Need.SUBSCRIBERS, Need.MOTION})
def interfaces_in_motion(robot: Robot, subscribers: SoapService) -> tuple[StateRead, ...]:
    """Read pose and velocity on an arc, where each component that the robot has is not zero, and at rest after it."""
    make_room(robot)
    reads: list[StateRead] = []
    try:
        _play(robot, subscribers, reads)
    except Exception as error:
        raise PartialTraceError(tuple(reads)) from error
    return tuple(reads)


def _play(robot: Robot, subscribers: SoapService, reads: list[StateRead]) -> None:
    drive = Drive(robot)
    arc = robot.share_of_limits(0.3, -0.4)
    suspects: _Suspects = {(name, moves): None for name in STATES for moves in (True, False)}
    for change in range(_CHANGES):
        # There and back, which needs no more room.
        moving = Velocity(*(-part if change % 2 else part for part in arc))
        for wanted in (moving, STILL):
            drive.command(wanted)
            drive.reach(wanted)
            # The first time as soon as may be; then when both interfaces must have heard of it.
            pause_s = robot.sample_s if change else 0.0
            drive.clock.sleep(pause_s)
            for name in [name for name, moves in suspects if moves == (wanted != STILL)]:
                drive.command(wanted)
                read = read_state(robot, subscribers, name, pause_s)
                del suspects[name, wanted != STILL]
                if read is not None:
                    reads += for_good([read])
                    suspects |= {(name, wanted != STILL): read} if read.differs else {}
            for _ in range(0 if change else _TIMES if wanted == moving else 1):
                for name in STATES:
                    # A state that differs costs three tries each time.
                    if not any(one.name == name and (one.broken or one.differs) for one in reads):
                        reads += compare(robot, subscribers, name, partial(drive.command, wanted))
        if not suspects:
            break
    reads += (replace(one, broken="") for one in suspects.values() if one is not None)
