"""XML, text and JSON of one moment while the robot moves, and when it has come to rest elsewhere.

At rest where a robot began, most of its values are zero, and none has ever been another. What a format told before a
change may be what it tells first afterwards: so after each change the first reading counts, and what is out by it after
each of several changes is judged. One may be out because a sample of the odometry came in between.
"""

import time
from functools import partial
from typing import Final

import pytest

from conformance.rest.applicable import reads
from conformance.rest.calls import JSON, Call
from conformance.rest.formats import Found, judge_disagreement, judge_same_values, one_turn
from conformance.rest.interface import RestInterface
from conformance.robot.drive import Drive
from conformance.robot.goal import await_goal, await_none, goal_body, put_goal
from conformance.robot.goals import choose_goals, make_room
from conformance.robot.robot import GOAL_PATH, LINEAR, POSE, STILL, VELOCITY, Robot, Velocity
from conformance.verdict.effort import Effort

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]
# First readings that are out after so many changes of one kind are no chance.
_CHANGES: Final = 3


@pytest.mark.requirement("rest-formats/same-values")
def test_formats_in_motion(api: RestInterface, robot: Robot, effort: Effort) -> None:
    """On an arc, and at rest after it, every value of pose and velocity is the same in all formats."""
    calls = [call for call in reads(api) if call.operation.template in {POSE, VELOCITY, LINEAR} and _others(call)]
    if effort.name == "quick" or not calls:
        return  # the formats are compared at rest in any case
    make_room(robot)
    drive = Drive(robot)
    arc = robot.share_of_limits(0.3, -0.4)
    # What every first reading so far was out by, of each resource after each kind of change.
    suspects: dict[tuple[str, bool], Found] = {}
    for change in range(_CHANGES):
        # There and back, which needs no more room.
        moving = Velocity(*(-part if change % 2 else part for part in arc))
        for wanted in (moving, STILL):
            drive.command(wanted)
            drive.reach(wanted)
            time.sleep(robot.sample_s if change else 0.0)
            for call in calls:
                key = (call.operation.id, wanted == STILL)
                drive.command(wanted)
                found = one_turn(api, call, _others(call))[0]
                before = suspects.get(key, {}) if change else found
                suspects[key] = {place: item for place, item in found.items() if place in before}
            for call in () if change else calls:
                judge_same_values(api, call, _others(call), partial(drive.command, wanted))
        if not any(suspects.values()):
            return
    by_id = {call.operation.id: call for call in calls}
    for (id_, _), left in suspects.items():
        for item in left.values():
            judge_disagreement(api, by_id[id_], item, item.exchange)


@pytest.mark.requirement("rest-formats/same-values")
def test_formats_of_goals(api: RestInterface, robot: Robot, effort: Effort) -> None:
    """One goal after another is the same in all formats, from the first reading on."""
    calls = [call for call in reads(api) if call.operation.template == GOAL_PATH and _others(call)]
    if effort.name == "quick" or not calls:
        return  # one goal is looked at in any case
    left: Found | None = None
    for number, pose in enumerate(choose_goals(robot, 1.5, 1 + _CHANGES)):
        body = goal_body(pose, robot.statement.motion.frame, f"formats {number}")
        put_goal(robot, body)
        await_goal(robot, body)
        time.sleep(robot.settle_s if left else 0.0)
        found, _ = one_turn(api, calls[0], _others(calls[0]))
        if not number:
            continue  # there was none before
        left = found if left is None else {place: item for place, item in found.items() if place in left}
        if not left:
            break
    for item in (left or {}).values():
        judge_disagreement(api, calls[0], item, item.exchange)
    robot.delete_goal()
    await_none(robot)


def _others(call: Call) -> list[str]:
    """The formats of a resource besides JSON."""
    return [name for name in call.operation.formats if name != JSON]
