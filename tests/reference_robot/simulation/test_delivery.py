"""The delivery application on the graph: missions drive, wait, overflow, fail and are called off."""

import json

import pytest
from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from mybot_delivery_app.msg import DeliveryRequestMsg
from observer import pose, until
from rclpy.qos import qos_profile_action_status_default
from std_msgs.msg import String
from unique_identifier_msgs.msg import UUID

from conformance.papers_robot.delivery import EXAMPLE
from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime
from reference_robot.simulation.delivery import Delivery, DeliveryRequests
from reference_robot.simulation.messages import MISSION_REPORTS
from reference_robot.simulation.office import DEPOT, DESTINATION, SOURCE

FAST = pytest.mark.parametrize("robot", [{"time_scale": 20.0}], indirect=True)
NEAR = ((69.0, 38.7), (69.0, 39.2), (68.3, 38.7))  # a mission of a few seconds


@FAST
def test_the_papers_coffee_goes_source_destination_depot(robot):
    robot.request(SOURCE, DESTINATION, DEPOT)
    until(lambda: robot.states == ["done"])
    goals = {goal["goal_id"]: goal["pose"]["pose"]["position"] for goal in map(json.loads, filter(None, robot.goals))}
    assert [(position["x"], position["y"]) for position in goals.values()] == [SOURCE, DESTINATION, DEPOT]
    assert robot.is_at(*DEPOT)
    (mission,) = robot.missions
    assert mission["request"] == EXAMPLE | {"message_code": 4}
    assert any('"active"' in report for report in robot.reports)


@FAST
def test_a_request_with_another_code_is_ignored(robot):
    robot.request(*NEAR, code=5)
    robot.request(*NEAR, code=0)
    robot.request(*NEAR, code=3)
    until(lambda: robot.states == ["done"])


def test_what_was_cancelled_before_the_application_came_drops_nothing(domain_id):
    names, states = RosNames(), {}

    def note(report):
        states.update((mission["number"], mission["state"]) for mission in json.loads(report.data)["missions"])

    def cancelled(*octets):
        goals = [GoalInfo(goal_id=UUID(uuid=[octet] * 16)) for octet in octets]
        statuses.publish(
            GoalStatusArray(
                status_list=[GoalStatus(goal_info=goal, status=GoalStatus.STATUS_CANCELED) for goal in goals]
            )
        )

    with RosRuntime(domain_id) as ros, RosRuntime(domain_id) as there:
        node = there.create_node("navigation_and_client")
        requests = node.create_publisher(DeliveryRequestMsg, names.topics.delivery, 10)
        statuses = node.create_publisher(
            GoalStatusArray, f"{names.actions.navigate_to_pose}/_action/status", qos_profile_action_status_default
        )
        node.create_subscription(String, names.topics.missions, note, MISSION_REPORTS)
        delivery = Delivery(ros.create_node("delivery", apart=True), DeliveryRequests(ros, names), names)
        ros.start()
        there.start()
        until(requests.get_subscription_count)
        requests.publish(DeliveryRequestMsg(message_code=4))
        until(lambda: list(states.values()) == ["queued"])
        cancelled(1)
        requests.publish(DeliveryRequestMsg(message_code=3))
        until(lambda: list(states.values()) == ["queued", "queued"])
        cancelled(1, 2)
        until(lambda: list(states.values()) == ["dropped", "dropped"])
        assert delivery


@FAST
def test_a_stop_outside_the_map_fails_its_mission_and_the_next_one_runs(robot):
    robot.request((0.0, 0.0), NEAR[1], NEAR[2])
    robot.request((float("nan"), 1.0), NEAR[1], NEAR[2])
    robot.request(*NEAR)
    until(lambda: robot.states == ["failed", "failed", "done"])
    assert [mission["reason"] for mission in robot.missions] == ["the navigation refused a leg"] * 2 + [""]


def test_a_cancel_from_outside_fails_the_mission_and_drops_the_queue(robot):
    for _ in range(3):
        robot.request(SOURCE, DESTINATION, DEPOT)
    until(lambda: robot.states == ["active", "queued", "queued"])
    until(lambda: robot.velocity[0] > 0.3)
    assert len(robot.cancel_all().goals_canceling) == 1
    until(lambda: robot.states == ["failed", "dropped", "dropped"])
    until(lambda: robot.rests and robot.current_goal is None)


def test_a_mission_waits_while_somebody_elses_goal_is_active(robot):
    handle = robot.send(pose(70.5, 38.7))
    until(lambda: robot.current_goal)
    robot.request(*NEAR)
    until(lambda: robot.states == ["queued"])
    assert robot.end_of(handle) == GoalStatus.STATUS_SUCCEEDED
    until(lambda: robot.states == ["done"])


def test_a_goal_that_displaces_a_mission_drops_the_queue(robot):
    robot.request(SOURCE, DESTINATION, DEPOT)
    robot.request(*NEAR)
    until(lambda: robot.states == ["active", "queued"] and robot.current_goal)
    handle = robot.send(pose(67.0, 38.7))
    until(lambda: robot.states == ["failed", "dropped"])
    assert robot.end_of(handle) == GoalStatus.STATUS_SUCCEEDED


def test_cancelling_somebody_elses_goal_drops_the_missions_that_wait(robot):
    handle = robot.send(pose(60.5, 38.7))
    until(lambda: robot.current_goal)
    robot.request(*NEAR)
    until(lambda: robot.states == ["queued"])
    assert len(robot.cancel_all().goals_canceling) == 1
    assert robot.end_of(handle) == GoalStatus.STATUS_CANCELED
    until(lambda: robot.states == ["dropped"])
    until(lambda: robot.rests and robot.current_goal is None)
