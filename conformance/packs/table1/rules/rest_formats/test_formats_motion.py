"""XML, text and JSON must agree in motion, at rest elsewhere, for several goals and for several plans.

At rest at the start most values are zero. A format that serves old values shows them first after a change; so the first
reading after each change counts, and a fault must show after each of several changes. One difference may be an odometry
sample that came between two reads.
"""

from collections.abc import Iterator
from functools import partial
from typing import Final

import pytest

from conformance.api.rest.applicable import reads
from conformance.api.rest.calls import JSON, Call
from conformance.api.rest.formats import Found, judge_disagreement, judge_same_values, one_turn
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import require_valid
from conformance.documents.representation import UnreadableError, by_itself
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.goal import await_goal, await_none, goal_body, put_goal
from conformance.packs.table1.robot.goals import choose_goals, make_room
from conformance.packs.table1.robot.plan import reachable
from conformance.packs.table1.robot.robot import GOAL_PATH, LINEAR, PLAN, POSE, STILL, VELOCITY, Robot, Velocity
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge

pytestmark = pytest.mark.needs("rest")
# First readings that are out after so many changes of one kind are no chance.
_CHANGES: Final = 3
_QUOTED: Final = "rest-formats/text-quoted"
# A text, which YAML takes for a number where it is not quoted.
_DIGITS: Final = "123"
# Over a slow link, or a robot that arrives soon, a goal may be over when it is read.
_TRIES: Final = 3


@pytest.mark.phase("motion")
@pytest.mark.motion
@pytest.mark.requirement("rest-formats/same-values")
def test_formats_in_motion(api: RestInterface, robot: Robot, effort: Effort) -> None:
    """Compare pose and velocity in all formats while the robot drives an arc, and at rest after it."""
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
            robot.clock.sleep(robot.sample_s if change else 0.0)
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


@pytest.mark.phase("motion")
@pytest.mark.motion
@pytest.mark.requirement("rest-formats/same-values")
def test_formats_of_goals(api: RestInterface, robot: Robot, effort: Effort) -> None:
    """PUT several goals and compare each in all formats, from the first reading on."""
    call = _reader(api, GOAL_PATH)
    if effort.name == "quick" or call is None:
        return  # one goal is looked at in any case

    def put() -> Iterator[Call]:
        for number, pose in enumerate(choose_goals(robot, 1.5, 1 + _CHANGES)):
            body = goal_body(pose, robot.statement.motion.frame, f"formats {number}")
            put_goal(robot, body)
            await_goal(robot, body)
            # Where the goal before was out, this one gets the time that commands may take.
            robot.clock.sleep(robot.settle_s if number > 1 else 0.0)
            yield call

    _judge_first(api, put())
    robot.delete_goal()
    await_none(robot)


@pytest.mark.phase("motion")
@pytest.mark.motion
@pytest.mark.requirement(_QUOTED)
def test_an_id_of_digits(api: RestInterface, robot: Robot, judge: Judge) -> None:
    """PUT a distant goal whose id is digits: YAML text must show the id as a string."""
    if "text/plain" not in _others(_reader(api, GOAL_PATH)):
        judge.unclaimed(_QUOTED, "the goal is not described as plain text")
        return
    body = goal_body(choose_goals(robot, 1.5, 1)[0], robot.statement.motion.frame, _DIGITS)
    for _ in range(_TRIES):
        put_goal(robot, body)
        await_goal(robot, body)
        exchange = robot.rest.send("GET", GOAL_PATH, headers=(("Accept", "text/plain"),))
        if exchange.response.ok:
            break
    else:
        judge.skip(_QUOTED, f"a goal with the id {_DIGITS} was never there when it was read")
        return
    robot.delete_goal()
    await_none(robot)
    try:
        shown = by_itself(exchange.response.body)
    except UnreadableError:
        shown = None  # which is judged where all formats are compared
    goal_id = shown.get("goal_id") if isinstance(shown, dict) else None
    judge.check(
        _QUOTED,
        not (isinstance(goal_id, dict) and isinstance(goal_id.get("id"), int | float)),
        exchange,
        f"the id {_DIGITS} in quotation marks, as ros2 topic echo prints it",
        found="a number",
    )


@pytest.mark.phase("resting")
@pytest.mark.requirement("rest-formats/same-values")
def test_formats_of_plans(api: RestInterface, robot: Robot, effort: Effort) -> None:
    """Request several plans and compare each in all formats, from the first reading on."""
    call = _reader(api, PLAN)
    here = robot.map_pose()
    if effort.name == "quick" or call is None or here is None:
        return  # one plan is looked at in any case
    goals = reachable(robot, here, max(1.0, robot.statement.motion.radius_m), 3)

    def ask() -> Iterator[Call]:
        for number in range(1 + _CHANGES if goals else 0):
            goal, start = goals[number % len(goals)], goals[(number + 1) % len(goals)]
            given = {"x": goal.x, "y": goal.y, "yaw": 0.3 * number}
            given |= {"start_x": start.x, "start_y": start.y, "start_yaw": -0.4 * number}
            asked = call
            for name, value in given.items():
                asked = asked.having(name, repr(value))
            require_valid(api.run.contract, "GET", asked.path)
            yield asked

    _judge_first(api, ask())


def _judge_first(api: RestInterface, changes: Iterator[Call]) -> None:
    """Judge the first reading after each change: a difference fails that shows after each change but the first."""
    left: Found | None = None
    for number, call in enumerate(changes):
        found, exchange = one_turn(api, call, _others(call))
        if number:
            left = found if left is None else {place: item for place, item in found.items() if place in left}
        if left == {}:
            if exchange.response.ok:
                judge_disagreement(api, call, None, exchange)
            return
    for item in (left or {}).values():
        judge_disagreement(api, call, item, item.exchange)


def _reader(api: RestInterface, template: str) -> Call | None:
    """Return the GET of a resource that has several formats, or None."""
    return next((call for call in reads(api) if call.operation.template == template and _others(call)), None)


def _others(call: Call | None) -> list[str]:
    """Return the formats of a resource other than JSON."""
    return [name for name in call.operation.formats if name != JSON] if call else []
