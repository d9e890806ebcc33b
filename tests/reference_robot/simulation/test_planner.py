"""Plans: exact ends, small steps, no walls touched, and a reason where there is none."""

import itertools
import math
import time

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from nav2_msgs.action import ComputePathToPose

from reference_robot.kinematics import KINEMATICS
from reference_robot.simulation.navigation import Pursuit
from reference_robot.simulation.office import BODY_RADIUS, DEPOT, DESTINATION, OFFICE, SOURCE
from reference_robot.simulation.planner import CLEARANCE, STEP, PlanError, PlanFailure, Planner
from reference_robot.simulation.realism import Motion, advance

PLANNER = Planner(OFFICE)
SOLID = OFFICE.grown(BODY_RADIUS)
poses = st.tuples(st.floats(55, 83), st.floats(30, 48), st.floats(-math.pi, math.pi))


def planned(start, goal):
    assume(SOLID.is_free(*start[:2]))
    try:
        return PLANNER.plan(start, goal)
    except PlanError:
        assume(False)


@given(poses, poses)
@settings(deadline=None)
def test_a_plan_has_exact_ends_and_small_steps_and_clears_the_walls(start, goal):
    path = planned(start, goal)
    assert (tuple(path[0]), tuple(path[-1])) == (start, goal)
    for (x, y, _), (next_x, next_y, _) in itertools.pairwise(path):
        assert math.dist((x, y), (next_x, next_y)) <= STEP + 1e-9
    assert OFFICE.grown(BODY_RADIUS - 1e-6).free_lines(path[:-1, :2], path[1:, :2]).all()


@given(poses, poses)
@settings(deadline=None)
def test_a_plan_is_no_longer_than_its_way_back(start, goal):
    assume(OFFICE.grown(CLEARANCE).is_free(*start[:2]))
    there = planned(start, goal)
    back = PLANNER.plan(goal, start)
    lengths = [np.hypot(*np.diff(path[:, :2], axis=0).T).sum() for path in (there, back)]
    assert lengths[0] == pytest.approx(lengths[1])
    assert lengths[0] >= math.dist(start[:2], goal[:2]) - 1e-9


@given(poses, poses, st.sampled_from(list(KINEMATICS.values())))
@settings(deadline=None, max_examples=25)
def test_pursuit_drives_a_plan_to_its_end(start, goal, kinematics):
    path = planned(start, goal)
    motion, pursuit = Motion(*start), Pursuit(path, kinematics=kinematics)
    late = [(0.0, 0.0)] * 2  # steps by which commands reach the base later
    for _ in range(20_000):
        command = pursuit.command(motion.x, motion.y, motion.yaw)
        if command.arrived:
            break
        late.append((command.linear, command.angular))
        motion = advance(motion, late.pop(0), 0.02, SOLID.is_free, kinematics)
    assert command.arrived
    # Who turns to and fro is not exactly where it turned.
    assert math.dist((motion.x, motion.y), goal[:2]) < (0.12 if kinematics.min_radius else 0.05)
    assert abs(math.remainder(motion.yaw - goal[2], math.tau)) < 0.05


@pytest.mark.parametrize(("start", "goal"), list(itertools.permutations([SOURCE, DESTINATION, DEPOT], 2)))
def test_the_papers_places_reach_each_other_quickly(start, goal):
    began = time.perf_counter()
    PLANNER.plan((*start, 0.0), (*goal, 1.0))
    assert time.perf_counter() - began < 5  # a millisecond on a quiet machine


def test_a_goal_where_the_robot_stands_is_a_turn():
    assert PLANNER.plan((*DEPOT, 0.0), (*DEPOT, 1.5)).tolist() == [[*DEPOT, 0.0], [*DEPOT, 1.5]]


@pytest.mark.parametrize(
    ("start", "goal", "failure"),
    [
        (DEPOT, (82.0, 47.0), PlanFailure.NO_VALID_PATH),  # the lift shaft
        (DEPOT, (90.0, 40.0), PlanFailure.GOAL_OUTSIDE_MAP),
        (DEPOT, (math.nan, 40.0), PlanFailure.GOAL_OUTSIDE_MAP),
        (DEPOT, (60.0, math.inf), PlanFailure.GOAL_OUTSIDE_MAP),
        (DEPOT, (72.0, 35.0), PlanFailure.GOAL_OCCUPIED),  # in a wall
        (DEPOT, (72.2, 35.0), PlanFailure.GOAL_OCCUPIED),  # too near to it
        ((0.0, 0.0), DEPOT, PlanFailure.START_OUTSIDE_MAP),
        ((72.0, 35.0), DEPOT, PlanFailure.START_OCCUPIED),
    ],
)
def test_without_a_way_the_reason_names_the_pose(start, goal, failure):
    with pytest.raises(PlanError, match=r"start \(" if goal is DEPOT else r"goal \(") as caught:
        PLANNER.plan((*start, 0.0), (*goal, 0.0))
    assert caught.value.failure is failure


def test_a_goal_near_a_wall_is_moved_within_the_tolerance():
    path = PLANNER.plan((*DEPOT, 0.0), (71.8, 35.0, 0.7), tolerance=0.3)
    assert math.dist(path[-1, :2], (71.8, 35.0)) <= 0.3
    assert OFFICE.grown(CLEARANCE).is_free(*path[-1, :2])
    assert path[-1, 2] == 0.7


def test_failures_carry_nav2s_numbers():
    for failure in PlanFailure:
        assert getattr(ComputePathToPose.Result, failure.name) == failure
