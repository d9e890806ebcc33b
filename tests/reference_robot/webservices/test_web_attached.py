"""In front of a robot that is not ours: Nav2's nodes in processes of their own, which others use as well."""

import asyncio
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from web_messages import delivery_path, fault_of, goal, query_envelope, twist
from web_robot import ForeignRobot, RosProcess, Served, eventually, problem, ros_environment, running_robot

from conformance.papers_robot.delivery import EXAMPLE
from reference_robot import ros
from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime
from reference_robot.webservices.configuration import WebSettings
from reference_robot.webservices.nodes.calls import RosCalls
from reference_robot.webservices.nodes.publishers import RobotPublishersNode
from reference_robot.webservices.nodes.subscribers import RobotSubscribersNode
from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.robot.goals import Goals
from reference_robot.webservices.robot.velocity import Velocity

POSE, VELOCITY, GOAL, HEALTH = "/robot/pose/", "/robot/velocity/", "/robot/navigation/action/goal/", "/robot/health/"
PLAN = "/robot/navigation/service/plan?x=1&y=2"
HOLD = 0.4
EXECUTING = 2  # action_msgs/GoalStatus
LEASE = str(Path(__file__).with_name("short_lease.xml"))


class Nav2:
    """The robot: its processes."""

    def __init__(self, domain_id: int) -> None:
        self.domain = str(domain_id)
        self.base = RosProcess("nav2_nodes.py", self.domain, "base", "TwistStamped")
        self.navigator = self.navigation()
        self.client = RosProcess("nav2_nodes.py", self.domain, "client")

    def navigation(self) -> RosProcess:
        return RosProcess("nav2_nodes.py", self.domain, "navigator", FASTRTPS_DEFAULT_PROFILES_FILE=LEASE)


@pytest.fixture(scope="module")
def nav2(module_domain_id: int) -> Iterator[Nav2]:
    robot = Nav2(module_domain_id)
    yield robot
    for process in (robot.base, robot.navigator, robot.client):
        process.close()


@pytest.fixture(scope="module")
def attached(nav2: Nav2, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    config = tmp_path_factory.mktemp("config") / "robot.toml"
    config.write_text(f'[web]\nhold = {HOLD}\n[velocity]\nmessage = "TwistStamped"\n')
    with running_robot(int(nav2.domain), "--attach", f"--config={config}") as served:
        health = eventually(lambda: (now := served.call("GET", HEALTH).json())["healthy"] and now)
        assert health["odometry"]["age"] < 1
        eventually(lambda: served.call("GET", HEALTH).json()["navigation"] == {"available": True, "state": "active"})
        eventually(lambda: served.call("GET", HEALTH).json()["velocity"]["available"])
        yield served


@contextmanager
def delivery_application(domain: str) -> Iterator[None]:
    command = [sys.executable, "-m", "reference_robot", "--delivery-only", f"--domain-id={domain}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=ros_environment()) as application:
        try:
            assert application.stdout.readline() == f"ready delivery=/DeliveryRequestMsg/from_json domain={domain}\n"
            yield
        finally:
            application.terminate()
            ended = application.wait(60)
    assert ended == 0


def test_odometry_older_than_a_second_is_none(attached, nav2):
    assert attached.call("GET", POSE).status_code == 200
    nav2.base.do(odometry=None)
    began = time.monotonic()
    eventually(lambda: attached.call("GET", POSE).status_code == 503)
    assert 0.9 < time.monotonic() - began < 60
    for path in (POSE, VELOCITY, VELOCITY + "linear/"):
        assert "s old" in problem(attached.call("GET", path), 503)
    for operation in ("GetPose", "GetVelocity"):
        assert fault_of(attached.soap(query_envelope(operation), url=attached.subscribers)) == "Server"
    health = attached.call("GET", HEALTH).json()
    assert not health["healthy"]
    assert not health["odometry"]["available"]
    assert health["odometry"]["age"] > 1
    assert health["ros"]["available"]
    nav2.base.do(odometry=2.0)
    eventually(lambda: attached.call("GET", POSE).status_code == 200)


def test_health_is_described_and_comes_in_every_format(attached):
    assert HEALTH in attached.call("GET", "/openapi.json").json()["paths"]
    assert 'path="robot/health/"' in attached.call("GET", "/application.wadl").text
    for accept in ("application/json", "application/xml", "text/plain"):
        answer = attached.call("GET", HEALTH, headers={"Accept": accept})
        assert "healthy" in answer.text
        assert "true" in answer.text


def test_a_velocity_that_is_not_renewed_ends_with_zero(attached, nav2):
    nav2.base.forget()
    renewed = began = time.monotonic()
    while renewed - began < 2 * HOLD:
        last, renewed = renewed, time.monotonic()
        assert attached.call("PUT", VELOCITY, json=twist(x=0.2)).status_code == 200
        velocity = nav2.base.next("velocity")
        # This machine stood still for so long that the velocity before was not renewed in time.
        if velocity["x"] == 0.0:
            assert time.monotonic() - last > HOLD
            velocity = nav2.base.next("velocity")
        assert (velocity["x"], velocity["frame"]) == (0.2, "base_link")
        time.sleep(HOLD / 4)
    assert nav2.base.next("velocity")["x"] == 0.0
    assert HOLD < time.monotonic() - renewed < 30 * HOLD
    # Once, and not at all where the client has stopped the robot itself.
    assert attached.call("PUT", VELOCITY, json=twist(x=0.1)).status_code == 200
    assert attached.call("PUT", VELOCITY, json=twist(x=0.0)).status_code == 200
    assert [nav2.base.next("velocity")["x"] for _ in range(2)] == [0.1, 0.0]
    time.sleep(1.5 * HOLD)
    assert nav2.base.heard_nothing()


def test_somebody_else_s_goal_is_shown_not_fought_and_cancelled(attached, nav2):
    assert attached.call("PUT", VELOCITY, json=twist(x=0.1)).status_code == 200
    assert nav2.base.next("velocity")["x"] == 0.1
    nav2.client.do(goal=3.5)
    assert nav2.navigator.next("goal") == 3.5
    identity = nav2.client.next("accepted")
    shown = eventually(lambda: (a := attached.call("GET", GOAL)).is_success and a.json())
    assert shown["goal_id"]["id"] == identity
    assert shown["goal_id"]["stamp"]["sec"] > 0
    assert shown["goal"]["target_pose"]["header"]["frame_id"] == ""  # in no frame: it is not known where it leads
    eventually(lambda: attached.call("GET", GOAL).json()["status"]["code"] == 2)
    assert "unknown" in shown["status"]["text"]
    assert identity in attached.soap(query_envelope("GetGoal"), url=attached.subscribers).text
    assert attached.call("PUT", VELOCITY, json=twist()).status_code == 409
    time.sleep(1.5 * HOLD)
    assert nav2.base.heard_nothing()  # the watchdog leaves the robot to the navigation
    assert attached.call("DELETE", GOAL).status_code == 204
    assert attached.call("GET", GOAL).status_code == 404
    assert nav2.navigator.next("cancel") == 3.5
    assert nav2.client.next("ended") == 5
    # Somebody else's goal displaces ours.
    assert attached.call("PUT", GOAL, json=goal("ours", x=1.0)).status_code == 201
    assert attached.call("DELETE", GOAL).status_code == 204
    assert [nav2.navigator.next(kind) for kind in ("goal", "cancel")] == [1.0, 1.0]


def test_a_delete_overtakes_a_put_that_waits(attached, nav2):
    nav2.navigator.do(answers=False)
    answers = []
    waiting = threading.Thread(target=lambda: answers.append(attached.call("PUT", GOAL, json=goal("first", x=7.0))))
    waiting.start()
    assert nav2.navigator.next("goal") == 7.0
    assert attached.call("DELETE", GOAL).status_code == 204
    assert not answers, "the PUT still waits"
    nav2.navigator.do(answers=True)
    waiting.join()
    assert answers[0].status_code == 409
    assert "DELETE" in answers[0].json()["detail"]
    assert nav2.navigator.next("cancel") == 7.0
    assert attached.call("GET", GOAL).status_code == 404
    assert attached.call("PUT", GOAL, json=goal("second", x=8.0)).status_code == 201
    assert nav2.navigator.next("goal") == 8.0
    assert attached.call("DELETE", GOAL).status_code == 204
    assert nav2.navigator.next("cancel") == 8.0


def test_a_navigator_that_is_not_active_is_503(attached, nav2):
    nav2.navigator.do(state="inactive")
    assert "bt_navigator is inactive" in problem(attached.call("PUT", GOAL, json=goal("early")), 503)
    assert attached.call("GET", HEALTH).json()["navigation"]["state"] == "inactive"
    assert "planner_server is inactive" in problem(attached.call("GET", PLAN), 503)
    nav2.navigator.do(state="active")
    eventually(lambda: attached.call("GET", PLAN).status_code == 200)
    assert nav2.navigator.next("goal") == 3.0
    assert nav2.navigator.heard_nothing()


@pytest.mark.parametrize("sender", ["client", "web"])
def test_goals_end_with_their_server_and_the_next_one_is_found(attached, nav2, sender):
    if sender == "client":
        nav2.client.do(goal=5.0)
        nav2.client.next("accepted")
    else:
        assert attached.call("PUT", GOAL, json=goal("ours", x=5.0)).status_code == 201
    eventually(lambda: attached.call("GET", GOAL).is_success)
    nav2.navigator.kill()
    nav2.navigator = nav2.navigation()  # at once: the dead one is still on the graph
    eventually(lambda: attached.call("GET", GOAL).status_code == 404)
    # Until both ends know each other, a server may take a goal and be unable to tell its client: 202, and no goal.
    eventually(lambda: attached.call("PUT", GOAL, json=goal("again", x=6.0)).status_code in {200, 201})
    nav2.navigator.forget_until("goal")
    nav2.navigator.forget()
    eventually(lambda: attached.call("GET", GOAL).is_success)
    assert attached.call("GET", GOAL).json()["goal_id"]["id"] == "again"
    eventually(lambda: attached.call("GET", PLAN).status_code == 200)
    assert attached.call("DELETE", GOAL).status_code == 204
    nav2.navigator.forget_until("cancel")


def test_a_foreign_robot_delivers(attached, nav2):
    nav2.navigator.forget()
    with delivery_application(nav2.domain):
        eventually(lambda: attached.call("PUT", delivery_path()).status_code == 204)
        for x in (EXAMPLE["source_x"], EXAMPLE["destination_x"], EXAMPLE["depot_x"]):
            assert nav2.navigator.next("goal") == x
            eventually(lambda: attached.call("GET", GOAL).is_success)
            nav2.navigator.do(finish=True)
        eventually(lambda: attached.call("GET", "/robot/app/delivery/").json()[0]["state"] == "done")
        # A mission that is called off drops those that wait; somebody else's goal lets them wait.
        for _ in range(2):
            assert attached.call("PUT", delivery_path()).status_code == 204
        nav2.navigator.forget_until("goal")
        eventually(lambda: attached.call("GET", GOAL).is_success)
        assert attached.call("DELETE", GOAL).status_code == 204
        nav2.navigator.forget_until("cancel")
        eventually(
            lambda: (
                [entry["state"] for entry in attached.call("GET", "/robot/app/delivery/").json()[:2]]
                == ["dropped", "failed"]
            )
        )
        assert attached.call("PUT", GOAL, json=goal("ours", x=1.0)).status_code == 201
        assert nav2.navigator.next("goal") == 1.0
        # That it is being driven to both hear by one message; an order that overtakes it would be driven instead.
        eventually(lambda: attached.call("GET", GOAL).json()["status"]["code"] == EXECUTING)
        assert attached.call("PUT", delivery_path()).status_code == 204
        assert nav2.navigator.heard_nothing()
        nav2.navigator.do(finish=True)
        assert nav2.navigator.next("goal") == EXAMPLE["source_x"]
        # A navigation that dies ends its mission, and the next one finds another navigation.
        nav2.navigator.kill()
        nav2.navigator = nav2.navigation()
        eventually(lambda: attached.call("GET", "/robot/app/delivery/").json()[0]["state"] == "failed")
        assert "no longer running" in attached.call("GET", "/robot/app/delivery/").json()[0]["reason"]
        assert attached.call("PUT", delivery_path()).status_code == 204
        assert nav2.navigator.next("goal") == EXAMPLE["source_x"]
        eventually(lambda: attached.call("GET", GOAL).is_success)
    assert attached.call("DELETE", GOAL).status_code == 204
    nav2.navigator.forget_until("cancel")


def test_the_robot_is_stopped_before_the_web_services_end(attached, nav2):
    """The last test of this module: it ends them."""
    nav2.base.forget()
    assert attached.call("PUT", VELOCITY, json=twist(x=0.3)).status_code == 200
    attached.process.terminate()
    assert [nav2.base.next("velocity")["x"] for _ in range(2)] == [0.3, 0.0]
    assert attached.process.wait(60) == 0


def test_a_ros_thread_that_hangs_is_noticed(domain_id, monkeypatch):
    monkeypatch.setattr(ros, "HUNG_S", 0.8)
    with RosRuntime(domain_id) as runtime:
        subscribers = RobotSubscribersNode(runtime, RosNames())
        goals = Goals(publishers=None, subscribers=subscribers, calls=None, navigator=None, frames=RosNames().frames)
        runtime.start()
        time.sleep(1.0)
        assert not runtime.hangs()  # with nothing to do
        hanging, go_on = threading.Event(), threading.Event()

        def hang() -> None:
            hanging.set()
            go_on.wait(60)

        subscribers.node.executor.create_task(hang)
        hanging.wait(60)
        eventually(runtime.hangs)
        with pytest.raises(Problem, match="ROS has been silent") as unknown:
            goals.current()
        assert unknown.value.status == 503
        go_on.set()
        eventually(lambda: not runtime.hangs())


def test_a_robot_whose_ros_thread_hangs_is_stopped(domain_id, monkeypatch):
    """A busy machine lets the thread seem to hang; an operator's stop must not wait for it."""
    monkeypatch.setattr(ros, "HUNG_S", 0.5)
    names, go_on = RosNames(), threading.Event()
    with RosRuntime(domain_id) as runtime, ForeignRobot(domain_id, "Twist") as robot:
        publishers, subscribers = RobotPublishersNode(runtime, names), RobotSubscribersNode(runtime, names)
        calls = RosCalls(publishers.node.executor, 60.0)
        goals = Goals(publishers, subscribers, calls, navigator=None, frames=names.frames)
        velocity = Velocity(publishers, None, WebSettings(), goals.is_active)
        runtime.start()
        eventually(publishers.find_velocity_subscribers)
        eventually(publishers.navigation_is_served)
        subscribers.node.executor.create_task(lambda: go_on.wait(60))
        eventually(runtime.hangs)
        with pytest.raises(Problem, match="the goal is unknown"):
            asyncio.run(velocity.command(twist(x=0.1)))
        asyncio.run(velocity.command(twist(x=0.0)))
        assert robot.next("velocity")["x"] == 0.0

        async def cancel() -> None:
            asyncio.get_running_loop().call_later(0.1, go_on.set)
            await goals.cancel()

        asyncio.run(cancel())
