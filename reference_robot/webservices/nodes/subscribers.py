"""RobotSubscribersNode: the ROS node through which the web services receive the robot's state."""

from collections import deque
from collections.abc import Callable
from functools import partial
from time import monotonic
from typing import Any, Final

from nav2_msgs.action import ComputePathToPose
from nav_msgs.msg import Odometry
from nav_msgs.srv import GetPlan
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from reference_robot.goal_statuses import GoalStatuses
from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime

_LATCHED_QOS: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_MISSION_REPORTS: Final = 200
_MISSIONS_QOS: Final = QoSProfile(depth=_MISSION_REPORTS, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_NAVIGATION_PACKAGES: Final = frozenset({"nav_msgs", "nav2_msgs", "map_msgs", "slam_toolbox"})


class RobotSubscribersNode:
    """The ROS node with all subscribers, the queries of the ROS graph, and the clients of the planners.

    Callbacks run in the executor's thread and only store the last message: one reference, which the event loop's thread
    reads. Messages are interpreted when a request needs them.

    Attributes:
        ros: The runtime of the node; while its threads hang, the stored messages are out of date.
        odometry: The last odometry, serialized (None before the first), and its time of arrival by ``time.monotonic``.
        on_odometry: Called with each serialized odometry message, in the executor's thread.
        mission_reports: Reports of changed missions as JSON (see ``names.toml``), oldest first; readers remove them.
        goals: The goals of the robot's navigation, from every client.
        map_transform: The transform from the map to the odometry frame.
        current_goal: The active goal as JSON, empty if there is none; None if the robot does not publish it, as Nav2.
        last_rejection: The last refused goal and the reason, as JSON; empty before the first refusal.
    """

    def __init__(self, ros: RosRuntime, names: RosNames) -> None:
        self.node = ros.create_node("robot_subscribers")
        self.ros = ros
        self._namespace = self.node.get_namespace().rstrip("/") + "/"  # a graph may contain several robots
        self.odometry: tuple[bytes | None, float] = (None, 0.0)
        self.on_odometry: Callable[[bytes], None] = lambda _: None
        self.mission_reports: deque[str] = deque(maxlen=_MISSION_REPORTS)
        self.current_goal: str | None = None
        self.last_rejection = ""
        self.goals = GoalStatuses(self.node, names.actions.navigate_to_pose)
        self.map_transform = MapTransform(self.node, names)
        topics = names.topics
        self.node.create_subscription(Odometry, topics.odom, self._keep_odometry, qos_profile_sensor_data, raw=True)
        self.node.create_subscription(
            String, topics.missions, lambda report: self.mission_reports.append(report.data), _MISSIONS_QOS
        )
        for name in ("current_goal", "last_rejection"):
            keep = partial(self._keep_text, name)
            self.node.create_subscription(String, getattr(topics, name), keep, _LATCHED_QOS)
        self._planner_service = self.node.create_client(GetPlan, names.services.get_plan)
        self._planner_action = ActionClient(self.node, ComputePathToPose, names.actions.compute_path_to_pose)

    def _keep_odometry(self, serialized: bytes) -> None:
        self.on_odometry(serialized)
        self.odometry = serialized, monotonic()

    def _keep_text(self, attribute: str, message: String) -> None:
        setattr(self, attribute, message.data)

    # The graph

    def sensors(self) -> list[dict[str, str]]:
        """Return name, topic and type of each sensor_msgs topic in the robot's namespace that has a publisher."""
        return [
            {"name": topic.removeprefix("/"), "topic": topic, "type": types[0]}
            for topic, types in sorted(self.node.get_topic_names_and_types())
            if topic.startswith(self._namespace)
            and types[0].startswith("sensor_msgs/msg/")
            and self.node.count_publishers(topic)
        ]

    def navigation_services(self) -> list[dict[str, str]]:
        """Return name and type of each navigation service in the robot's namespace, except those inside actions."""
        return [
            {"name": name, "type": types[0]}
            for name, types in sorted(self.node.get_service_names_and_types())
            if name.startswith(self._namespace)
            and types[0].partition("/")[0] in _NAVIGATION_PACKAGES
            and "/_" not in name
            and self.node.count_services(name)  # a service name without a server has only clients
        ]

    # Planning

    def plan_service_is_served(self) -> bool:
        """Return whether a GetPlan service is running; Nav2 in Jazzy has none."""
        return bool(self._planner_service.service_is_ready())

    def plan_action_is_served(self) -> bool:
        """Return whether a ComputePathToPose action server is running."""
        return bool(self._planner_action.server_is_ready())

    def ask_plan_service(self, request: GetPlan.Request) -> Future:
        """Call the GetPlan service; the future holds the response."""
        return self._planner_service.call_async(request)

    def ask_plan_action(self, goal: ComputePathToPose.Goal) -> Future:
        """Send a ComputePathToPose goal, from the executor's thread; the future holds rclpy's ClientGoalHandle."""
        return self._planner_action.send_goal_async(goal)


_MOVING: Final = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
_STATIC: Final = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class MapTransform:
    """A subscriber that keeps the latest transform from the map to the odometry frame.

    Only one transform is needed out of the many that a robot publishes up to a hundred times a second. So there is no
    tf2 listener: a message is deserialized only if its bytes contain the map's frame id, which takes a hundredth of the
    time.

    Attributes:
        latest: The last geometry_msgs/Transform; None before the first.
    """

    def __init__(self, node: Node, names: RosNames) -> None:
        self.latest: Any = None
        self._parent = names.frames.map
        self._child = names.frames.odom
        self._mark = self._parent.encode() + b"\0"  # CDR strings end with a zero byte
        node.create_subscription(TFMessage, names.topics.tf, self._receive, _MOVING, raw=True)
        node.create_subscription(TFMessage, names.topics.tf_static, self._receive, _STATIC, raw=True)

    def _receive(self, serialized: bytes) -> None:
        if self._mark in serialized:
            for stamped in deserialize_message(serialized, TFMessage).transforms:
                if (stamped.header.frame_id, stamped.child_frame_id) == (self._parent, self._child):
                    self.latest = stamped.transform
