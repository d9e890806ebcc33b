"""A robot that is not ours: a node in a process of its own, which tells what reaches it over ROS.

Run as ``python foreign_robot.py DOMAIN Twist|TwistStamped [silent] [planner]``. It prints one JSON object a line:
``ready``, then ``delivery``, ``velocity``, ``goal`` and ``cancel`` as they come. Each line on its stdin is a command:
``{"odometry": {"x": …, "covariance": …}}`` publishes that odometry over and over,
``{"transform": [x, y, yaw]}`` tells how its odometry lies in the map, ``{"finish": true}`` ends the goal,
``{"current_goal": …}`` tells of one that another client sent, ``{"tell_next_goal_as": …}`` tells of the next one that
comes, and of no later one. After each it tells ``obeyed``. With ``planner`` it tells ``plan`` of each one that it is
asked for.
"""

import json
import math
import struct
import sys
import threading
import time
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist, TwistStamped
from mybot_delivery_app.msg import DeliveryRequestMsg
from nav2_msgs.action import ComputePathToPose, NavigateToPose
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import MultiThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as rclpy_c
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

_UNREACHABLE_X = 1000.0


def tell(**event: Any) -> None:
    sys.stdout.write(json.dumps(event) + "\n")
    sys.stdout.flush()


def bits(value: float) -> str:
    return struct.pack(">d", value).hex()


def transform(parent: str, child: str, x: float, y: float, yaw: float) -> TransformStamped:
    told = TransformStamped(child_frame_id=child)
    told.header.frame_id = parent
    told.transform.translation.x, told.transform.translation.y = x, y
    told.transform.rotation.z, told.transform.rotation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return told


class ForeignRobot(Node):
    def __init__(self, context: Context, velocity: type, *, silent: bool) -> None:
        super().__init__("foreign_robot", context=context)
        self.odometry = None if silent else Odometry()
        self._tf = self.create_publisher(TFMessage, "/tf", 100)
        self.transforms = TFMessage(transforms=[transform("odom", "base_link", 1.0, 2.0, 3.0)])
        self.tells_goal_as: dict[str, Any] | None = None
        self.finished = threading.Event()
        self._latest_goal: Any = None
        group = ReentrantCallbackGroup()
        self._publisher = self.create_publisher(Odometry, "odom", 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._current_goal = self.create_publisher(String, "navigation/current_goal", latched)
        self.create_timer(0.02, self._publish, callback_group=group)
        self.create_subscription(
            DeliveryRequestMsg, "/DeliveryRequestMsg/from_json", self._delivery, QoSProfile(depth=1000)
        )
        self.create_subscription(velocity, "cmd_vel", self._velocity, 10)
        calls = {"goal_callback": self._goal, "cancel_callback": self._cancel, "callback_group": group}
        self._server = ActionServer(self, NavigateToPose, "navigate_to_pose", self._drive, **calls)

    def _publish(self) -> None:
        odometry = self.odometry
        if odometry is not None:
            odometry.header.stamp = self.get_clock().now().to_msg()
            self._publisher.publish(odometry)
        self._tf.publish(self.transforms)

    def _delivery(self, message: DeliveryRequestMsg) -> None:
        fields = message.get_fields_and_field_types()
        tell(
            delivery={
                name: bits(value) if isinstance(value := getattr(message, name), float) else value for name in fields
            }
        )

    def _velocity(self, message: Any) -> None:
        twist = message.twist if isinstance(message, TwistStamped) else message
        tell(velocity={"type": type(message).__name__, "x": twist.linear.x, "z": twist.angular.z})

    def _goal(self, goal: NavigateToPose.Goal) -> GoalResponse:
        pose = goal.pose
        self.finished.clear()
        tell(goal={"frame_id": pose.header.frame_id, "x": pose.pose.position.x, "w": pose.pose.orientation.w})
        return GoalResponse.REJECT if pose.pose.position.x == _UNREACHABLE_X else GoalResponse.ACCEPT

    def _cancel(self, handle: Any) -> CancelResponse:
        tell(cancel={"x": handle.request.pose.pose.position.x})
        return CancelResponse.ACCEPT

    def _drive(self, handle: Any) -> NavigateToPose.Result:
        self._latest_goal = handle
        if self.tells_goal_as:
            told = self.tells_goal_as | {"goal_id": bytes(handle.goal_id.uuid).hex()}
            self._current_goal.publish(String(data=json.dumps(told)))
            self.tells_goal_as = None
        while handle.status != GoalStatus.STATUS_CANCELING:
            if self._latest_goal is not handle:
                handle.abort()  # another goal has preempted this one
                return NavigateToPose.Result()
            if self.finished.wait(0.01):
                handle.succeed()
                return NavigateToPose.Result()
        handle.canceled()
        return NavigateToPose.Result()

    def plan_like_nav2(self) -> None:
        """Offer no GetPlan service, but the action of Nav2's planner."""
        self._planner = ActionServer(self, ComputePathToPose, "compute_path_to_pose", self._plan)

    def _plan(self, handle: Any) -> ComputePathToPose.Result:
        goal, result = handle.request, ComputePathToPose.Result()
        if goal.goal.pose.position.x == _UNREACHABLE_X:
            handle.abort()
            return result
        tell(plan={"use_start": goal.use_start, "frame_id": goal.goal.header.frame_id})
        start = goal.start if goal.use_start else PoseStamped()
        start.header.frame_id = result.path.header.frame_id = "map"
        result.path.poses = [start, goal.goal]
        handle.succeed()
        return result

    def obey(self, command: dict[str, Any]) -> None:
        if "odometry" in command:
            odometry = Odometry()
            odometry.header.frame_id, odometry.child_frame_id = "odom", "base_link"
            odometry.pose.pose.position.x = command["odometry"]["x"]
            odometry.pose.covariance[35] = command["odometry"]["covariance"]
            odometry.twist.twist.linear.x = command["odometry"]["x"] / 10
            self.odometry = odometry
        if "transform" in command:
            self.transforms.transforms = [
                transform("map", "elsewhere", 9.0, 9.0, 0.0),
                transform("map", "odom", *command["transform"]),
            ]
        if "current_goal" in command:
            self._current_goal.publish(String(data=json.dumps(command["current_goal"])))
        if "tell_next_goal_as" in command:
            self.tells_goal_as = command["tell_next_goal_as"]
        if "finish" in command:
            self.finished.set()


def _keep_spinning(executor: MultiThreadedExecutor) -> None:
    while True:
        try:
            executor.spin()
        except (rclpy_c.RCLError, InvalidHandle):
            continue  # an action server was destroyed while the executor, in this thread, was about to wait for it
        return


def spin(node: Any, context: Context) -> tuple[MultiThreadedExecutor, threading.Thread]:
    """Spin a node and have it obey each line of stdin, until that ends. Returns its executor, in its thread."""
    executor = MultiThreadedExecutor(4, context=context)
    executor.add_node(node)
    spinner = threading.Thread(target=_keep_spinning, args=(executor,), daemon=True)
    spinner.start()
    tell(ready=True)
    for line in sys.stdin:
        node.obey(json.loads(line))
        tell(obeyed=True)
    return executor, spinner


def main() -> None:
    domain, velocity, *rest = sys.argv[1:]
    context = Context()
    rclpy.init(args=[], context=context, domain_id=int(domain))
    robot = ForeignRobot(context, {"Twist": Twist, "TwistStamped": TwistStamped}[velocity], silent="silent" in rest)
    if "planner" in rest:
        robot.plan_like_nav2()
    executor, spinner = spin(robot, context)
    robot.finished.set()
    time.sleep(0.05)
    executor.shutdown()
    spinner.join(2)
    robot.destroy_node()
    context.try_shutdown()


if __name__ == "__main__":
    main()
