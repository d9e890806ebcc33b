"""Velocities in any order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from conformance.domain.goals import make_room
from conformance.domain.robot import Robot
from conformance.domain.velocity_walk import machine
from conformance.domain.walk import Walk
from conformance.target.stillness import bring_to_rest

if TYPE_CHECKING:
    from conformance.effort import Effort
    from conformance.explore import Explorer
    from conformance.session import Session

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
def test_velocity_walk(roaas: Session, effort: Effort, explore: Explorer) -> None:
    """Whatever is asked for, in whatever order, is what the robot does, and its pose follows."""
    reason = bring_to_rest(roaas)
    if reason:
        pytest.skip(reason)
    robot = Robot(roaas)
    make_room(robot)
    walk = Walk(robot, 0.8 * effort.budget_s)
    explore.machine(machine(walk), cases=10, steps=effort.cases(12))
    walk.drive.judge_motion()
    if walk.silence:
        raise walk.silence
