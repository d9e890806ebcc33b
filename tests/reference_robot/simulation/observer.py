"""What another program on the graph sees of the robot, and how it commands it."""

import json
import math
import time

from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from mybot_delivery_app.msg import DeliveryRequestMsg
from nav2_msgs.action import ComputePathToPose, NavigateToPose
from nav_msgs.msg import Odometry
from nav_msgs.srv import GetPlan
from rclpy.action import ActionClient
from std_msgs.msg import String

from conformance.papers_robot.delivery import COORDINATES
from reference_robot.simulation.messages import LATCHED, MISSION_REPORTS, quaternion_of, yaw_of

_PATIENCE_S = 60.0


def until(condition, seconds=_PATIENCE_S):
    """Wait for a condition and return its value."""
    deadline = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < deadline, f"not within {seconds} s: {condition}"
        time.sleep(0.002)
    return value


def pose(x, y, yaw=0.0, frame_id="map"):
    stamped = PoseStamped()
    stamped.header.frame_id = frame_id
    stamped.pose.position.x, stamped.pose.position.y = float(x), float(y)
    stamped.pose.orientation = quaternion_of(yaw)
    return stamped


class Observer:
    """A node with a view of every topic, service and action of the robot."""

    def __init__(self, ros, names):
        self.ros = ros
        node = self.node = ros.create_node("observer")
        topics = names.topics
        self.odometry = []  # (monotonic time of arrival, message)
        self.goals, self.rejections, self.reports, self.feedback = [], [], [], []
        velocity = TwistStamped if names.velocity.message == "TwistStamped" else Twist
        self.velocities = node.create_publisher(velocity, topics.cmd_vel, 10)
        self.requests = node.create_publisher(DeliveryRequestMsg, topics.delivery, 100)
        self.navigate = ActionClient(node, NavigateToPose, names.actions.navigate_to_pose)
        self.compute = ActionClient(node, ComputePathToPose, names.actions.compute_path_to_pose)
        self.plans = node.create_client(GetPlan, names.services.get_plan)
        # What an operator's tool uses to stop the robot, whoever set it going.
        self.cancels = node.create_client(CancelGoal, f"{names.actions.navigate_to_pose}/_action/cancel_goal")
        node.create_subscription(
            Odometry, topics.odom, lambda message: self.odometry.append((time.monotonic(), message)), 50
        )
        for topic, seen in ((topics.current_goal, self.goals), (topics.last_rejection, self.rejections)):
            node.create_subscription(String, topic, lambda message, seen=seen: seen.append(message.data), LATCHED)
        node.create_subscription(
            String, topics.missions, lambda message: self.reports.append(message.data), MISSION_REPORTS
        )

    def is_connected(self):
        heard = (self.velocities.get_subscription_count, self.requests.get_subscription_count)
        served = (self.navigate.server_is_ready, self.compute.server_is_ready, self.plans.service_is_ready)
        return self.odometry and self.goals and all(each() for each in (*heard, *served))

    @property
    def pose(self):
        now = self.odometry[-1][1].pose.pose
        return now.position.x, now.position.y, yaw_of(now.orientation)

    @property
    def velocity(self):
        now = self.odometry[-1][1].twist.twist
        return now.linear.x, now.angular.z

    @property
    def rests(self):
        return self.velocity == (0.0, 0.0)

    @property
    def current_goal(self):
        return json.loads(self.goals[-1]) if self.goals[-1] else None

    @property
    def states(self):
        """States of the missions, oldest first."""
        return [mission["state"] for mission in self.missions]

    @property
    def missions(self):
        """Missions as they were told last, oldest first."""
        latest = {}
        for report in map(json.loads, list(self.reports)):
            latest |= {mission["number"]: mission for mission in report["missions"]}
        return [latest[number] for number in sorted(latest)]

    def command(self, linear, angular=0.0):
        twist = Twist()
        twist.linear.x, twist.angular.z = linear, angular
        stamped = self.velocities.msg_type is TwistStamped
        self.velocities.publish(TwistStamped(twist=twist) if stamped else twist)

    def await_future(self, future):
        until(future.done)
        return future.result()

    def ask(self, call, *arguments):
        """Make an asynchronous call in the executor's thread and return what it brings.

        Made in another thread, rclpy's action client loses an answer that comes before the call returns.
        """
        return self.await_future(self.await_future(self.node.executor.create_task(call, *arguments)))

    def send(self, goal):
        """Send a NavigateToPose goal and return its handle."""
        return self.ask(self.navigate.send_goal_async, NavigateToPose.Goal(pose=goal), self.feedback.append)

    def cancel_all(self):
        """Cancel every goal, whoever sent it: an id and a stamp of zeros (action_msgs/CancelGoal)."""
        return self.ask(self.cancels.call_async, CancelGoal.Request())

    def end_of(self, handle):
        """Wait for a goal's end and return its status."""
        return self.ask(handle.get_result_async).status

    def plan(self, goal, start=None, tolerance=0.0):
        request = GetPlan.Request(goal=goal, tolerance=tolerance)
        if start is not None:
            request.start = start
        return self.ask(self.plans.call_async, request).plan

    def request(self, source, destination, depot, code=4):
        coordinates = dict(zip(COORDINATES, map(float, (*depot, *destination, *source)), strict=True))
        self.requests.publish(DeliveryRequestMsg(message_code=code, **coordinates))

    def is_at(self, x, y, yaw=None):
        here = self.pose
        return math.dist(here[:2], (x, y)) < 0.06 and (
            yaw is None or abs(math.remainder(here[2] - yaw, math.tau)) < 0.06
        )
