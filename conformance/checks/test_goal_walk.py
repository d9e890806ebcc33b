"""Goals in any order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from conformance.domain.goal_walk import machine
from conformance.domain.goals import choose_goals
from conformance.domain.robot import Robot
from conformance.domain.walk import Walk
from conformance.target.stillness import bring_to_rest

if TYPE_CHECKING:
    from conformance.effort import Effort
    from conformance.explore import Explorer
    from conformance.session import Session

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
def test_goal_walk(roaas: Session, effort: Effort, explore: Explorer) -> None:
    """Whatever clients do with goals, in whatever order, the one that was put last is the active one."""
    reason = bring_to_rest(roaas)
    if reason:
        pytest.skip(reason)
    walk = Walk(Robot(roaas), 0.4 * effort.budget_s)
    poses = choose_goals(walk.robot, 1.5, 2)
    explore.machine(machine(walk, poses), cases=20, steps=effort.cases(12))
    if walk.silence:
        raise walk.silence
