"""Random sequences of goal requests."""

import pytest

from conformance.packs.table1.robot.goal_walk import GoalMachine
from conformance.packs.table1.robot.goals import choose_goals
from conformance.packs.table1.robot.robot import Robot
from conformance.packs.table1.robot.walk import Walk
from conformance.verdict.effort import Effort
from conformance.verdict.explorer import Explorer

pytestmark = [pytest.mark.phase("motion"), pytest.mark.needs("rest"), pytest.mark.motion]


@pytest.mark.requirement(
    "rest-resources/goal-put",
    "rest-resources/goal-get",
    "rest-resources/goal-none",
    "rest-resources/goal-repeat",
    "rest-resources/goal-conflict",
    "rest-resources/goal-preempt",
    "rest-resources/goal-delete",
    "rest-resources/goal-delete-none-success",
)
def test_goal_walk(robot: Robot, effort: Effort, explore: Explorer) -> None:
    """Run the goal state machine: after every sequence of requests the goal sent last must be the active one."""
    walk = Walk(robot, 0.4 * effort.budget_s)
    poses = choose_goals(walk.robot, 1.5, 2)
    explore.machine(lambda: GoalMachine(walk, poses), cases=20, steps=effort.cases(12))
    explore.left_out(walk.left_out)
    if walk.unreachable:
        raise walk.unreachable
