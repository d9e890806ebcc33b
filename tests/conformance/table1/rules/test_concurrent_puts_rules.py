"""Rules on several clients that put at one moment, by traces made by hand."""

import pytest
from toy_messages import exchange

from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.goal_trace import ConcurrentGoal, GoalRead
from conformance.packs.table1.robot.motion_map import speeds_of
from conformance.packs.table1.robot.robot import Velocity
from conformance.packs.table1.rules.rest_resources import test_several_clients as rules
from conformance.packs.table1.statement import Statement
from conformance.scenarios.motion.trace import Command, Drive, Reading
from conformance.verdict.run import Run

_STATEMENT = Statement(declared=DeclaredLimits(settle_s=1.0, hold_s=3.0, tolerance_abs=0.02))
_ONE, _OTHER = Velocity(linear_x=0.5, angular_z=-0.5), Velocity(linear_x=-0.5, angular_z=0.5)


def _goal(*statuses, differs="", cancelled=("no goal",)):
    reads = tuple(GoalRead(exchange(), one) for one in cancelled)
    return ConcurrentGoal(tuple(map(exchange, statuses)), GoalRead(exchange(), differs), reads)


@pytest.mark.parametrize(
    ("goal", "holds"),
    [
        (_goal(201, 200, 204), [True, True, True]),
        (_goal(202, 202, 202), [True, True, True]),
        (_goal(201, 201, 200), [False, True, True]),
        (_goal(200, 200), [False, True, True]),
        (_goal(201, 409), [False, True, True]),
        (_goal(201, differs="position.x 1 for 2"), [True, False, True]),
        (_goal(201, cancelled=("no goal", "")), [True, True, True, False]),
        (ConcurrentGoal((exchange(201),), None), [True]),
    ],
)
def test_one_goal_of_several_clients_is_one_goal(goal, holds):
    assert [one.holds for one in rules.goal_concurrent.outcomes((goal,), {}.__getitem__)] == holds


def _velocities(ahead, turn, *, at=1.5, accepted=(_ONE, _OTHER)):
    made = tuple(Command(0.0, 0.1, speeds_of(one), exchange()) for one in accepted)
    read = tuple(
        Reading(at + 0.02 * n, at + 0.02 * n, {}, None, exchange(), {"ahead": ahead, "turn": turn}) for n in range(9)
    )
    return Drive("", {}, made, read, None, ())


@pytest.mark.parametrize(
    ("drive", "shown"),
    [
        (_velocities(-0.5, 0.5), [True]),
        (_velocities(0.5, 0.5), [False]),
        (_velocities(0.5, 0.5, at=0.5), []),  # the robot has not had its time
        (_velocities(0.0, 0.0), [False]),
        (_velocities(0.0, 0.0, at=2.99), []),  # the velocity may have ended
        (_velocities(0.0, 0.0, accepted=()), []),
    ],
)
def test_one_velocity_of_several_clients_is_reached(drive, shown):
    found = rules.one_velocity_is_reached.outcomes((drive,), {"run": Run(statement=_STATEMENT)}.__getitem__)
    assert [one.holds for one in found] == shown
