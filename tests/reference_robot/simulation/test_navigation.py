"""Navigation on the graph: goals are reached, cancelled, displaced and refused; plans are exact."""

import itertools
import json
import math
import time

import pytest
from action_msgs.msg import GoalStatus
from nav2_msgs.action import ComputePathToPose
from nav_msgs.msg import Odometry
from observer import Observer, pose, until

from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime
from reference_robot.simulation.delivery import Delivery, DeliveryRequests
from reference_robot.simulation.messages import Localisation
from reference_robot.simulation.navigation import PATIENCE_S, Navigation, Progress
from reference_robot.simulation.office import DEPOT, OFFICE, SOURCE
from reference_robot.simulation.planner import Planner


def test_a_goal_is_reached_with_feedback_and_shown_while_it_is_active(robot):
    goal = pose(71.0, 36.0, 2.0)
    handle = robot.send(goal)
    assert handle.accepted
    shown = until(lambda: robot.current_goal)
    assert shown["goal_id"] == bytes(handle.goal_id.uuid).hex()
    assert (shown["status"], shown["pose"]["header"]["frame_id"]) == (GoalStatus.STATUS_EXECUTING, "map")
    assert shown["pose"]["pose"]["position"] == {"x": 71.0, "y": 36.0, "z": 0.0}
    assert robot.end_of(handle) == GoalStatus.STATUS_SUCCEEDED
    until(lambda: robot.current_goal is None)
    until(lambda: robot.rests)
    assert robot.is_at(71.0, 36.0, 2.0)
    left = [message.feedback.distance_remaining for message in robot.feedback]
    assert len(left) >= 2
    assert left[0] > left[-1] > 0


@pytest.mark.parametrize("robot", [{"time_scale": 1.0}], indirect=True)
def test_a_cancelled_goal_leaves_the_robot_at_rest_within_the_settle_time(robot):
    for _ in range(10):
        handle = robot.send(pose(81.0, 39.0))
        until(lambda: robot.velocity[0] > 0.5)
        cancelled_at = time.monotonic()
        assert len(robot.ask(handle.cancel_goal_async).goals_canceling) == 1
        assert robot.end_of(handle) == GoalStatus.STATUS_CANCELED
        until(lambda: robot.rests)
        took_s = robot.odometry[-1][0] - cancelled_at
        if took_s < 0.6:
            break  # a machine that was busy delays what is measured
    assert took_s < 0.6
    until(lambda: robot.current_goal is None)
    here = robot.pose
    later = len(robot.odometry) + 10
    until(lambda: len(robot.odometry) > later)
    assert robot.pose == here


def test_a_newer_goal_displaces_an_older_one_which_ends_aborted(robot):
    older = robot.send(pose(81.0, 39.0))
    until(lambda: robot.velocity[0] > 0.3)
    newer = robot.send(pose(66.0, 37.0, 1.0))
    assert robot.end_of(older) == GoalStatus.STATUS_ABORTED
    until(lambda: robot.current_goal["goal_id"] == bytes(newer.goal_id.uuid).hex())
    assert robot.end_of(newer) == GoalStatus.STATUS_SUCCEEDED
    assert robot.is_at(66.0, 37.0, 1.0)


@pytest.mark.parametrize("unreachable", [(0.0, 0.0), (82.0, 47.0), (72.0, 35.0), (math.nan, 38.0)])
def test_an_unreachable_goal_is_refused_and_the_reason_is_told(robot, unreachable):
    assert not robot.send(pose(*unreachable)).accepted
    told = json.loads(until(lambda: robot.rejections)[-1])
    assert "goal" in told["reason"]
    assert told["pose"]["pose"]["position"]["y"] == unreachable[1]
    assert robot.current_goal is None


def test_a_goal_in_an_unknown_frame_or_without_orientation_is_refused(robot):
    assert not robot.send(pose(70.0, 38.7, frame_id="moon")).accepted
    until(lambda: robot.rejections and "'moon'" in robot.rejections[-1])
    skewed = pose(70.0, 38.7)
    skewed.pose.orientation.w = 0.5
    assert not robot.send(skewed).accepted
    until(lambda: "length" in robot.rejections[-1])


def check_plan(plan, start, goal):
    assert plan.header.frame_id == goal.header.frame_id
    points = [(item.pose.position.x, item.pose.position.y) for item in plan.poses]
    assert points[0] == pytest.approx(start, abs=1e-9)
    assert plan.poses[-1].pose == goal.pose
    assert all(item.header.frame_id == goal.header.frame_id for item in plan.poses)
    assert max(math.dist(a, b) for a, b in itertools.pairwise(points)) <= 0.25


def test_compute_path_to_pose_plans_or_says_why_not(robot):
    def compute(goal, start=None):
        message = ComputePathToPose.Goal(goal=goal, use_start=start is not None)
        if start is not None:
            message.start = start
        return robot.ask(robot.ask(robot.compute.send_goal_async, message).get_result_async)

    goal = pose(*SOURCE, 0.3)
    found = compute(goal)
    assert found.status == GoalStatus.STATUS_SUCCEEDED
    assert found.result.error_code == ComputePathToPose.Result.NONE
    check_plan(found.result.path, DEPOT, goal)
    check_plan(compute(pose(*DEPOT), start=goal).result.path, SOURCE, pose(*DEPOT))
    refused = compute(pose(82.0, 47.0))
    assert refused.status == GoalStatus.STATUS_ABORTED
    assert refused.result.error_code == ComputePathToPose.Result.NO_VALID_PATH
    assert "82" in refused.result.error_msg


def test_a_goal_without_progress_is_aborted_and_fails_one_mission(domain_id):
    names = RosNames()
    with RosRuntime(domain_id) as ros:
        observer = Observer(ros, names)
        node = ros.create_node("navigation")
        planner, localisation = Planner(OFFICE), Localisation(node, names)
        navigation = Navigation(node, names, planner, localisation, time_scale=40.0)  # patience: half a second
        delivery = Delivery(ros.create_node("delivery", apart=True), DeliveryRequests(ros, names), names)
        stuck = Odometry()  # a base that does not move, whatever it is told
        stuck.pose.pose = pose(*DEPOT).pose
        odometry = node.create_publisher(Odometry, names.topics.odom, 1)
        node.create_timer(0.02, lambda: odometry.publish(stuck))
        ros.start()
        until(
            lambda: (
                observer.odometry and observer.navigate.server_is_ready() and observer.requests.get_subscription_count()
            )
        )
        handle = observer.send(pose(*SOURCE))
        ended = observer.ask(handle.get_result_async)
        assert (ended.status, ended.result.error_code) == (GoalStatus.STATUS_ABORTED, 105)
        assert ended.result.error_msg == "no progress in 20 s"
        until(lambda: observer.current_goal is None)
        for _ in range(2):
            observer.request(SOURCE, DEPOT, DEPOT)
        until(lambda: observer.states == ["failed", "failed"])
        reasons = [mission["reason"] for mission in observer.missions]
        assert reasons == ["the navigation gave up a leg: no progress in 20 s"] * 2
        assert navigation  # kept while they serve
        assert delivery


_STEP_S = 0.02


@pytest.mark.parametrize("time_scale", [1.0, 5.0])
def test_a_way_that_gets_no_shorter_lacks_progress_after_its_patience(time_scale):
    progress, now = Progress(7.0, time_scale), 7.0
    while not progress.is_lacking(3.0, now):
        now += _STEP_S
    assert (now - 7.0) * time_scale == pytest.approx(PATIENCE_S, abs=3 * time_scale * _STEP_S)


def test_a_way_that_gets_shorter_does_not():
    progress = Progress(0.0, 1.0)
    assert not any(progress.is_lacking(100.0 - 0.001 * step, _STEP_S * step) for step in range(10_000))


def test_whoever_is_held_up_fails_at_nothing():
    progress = Progress(0.0, 30.0)
    assert not progress.is_lacking(3.0, _STEP_S)
    assert not progress.is_lacking(3.0, 5.0)
    assert not progress.is_lacking(3.0, 5.0 + _STEP_S)
