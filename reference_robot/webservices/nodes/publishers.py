"""RobotPublishersNode: the ROS node through which the web services send messages, goals and cancellations."""

from time import monotonic
from typing import Any, Final

from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from mybot_delivery_app.msg import DeliveryRequestMsg
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation as rclpy_c
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from reference_robot.deliveries import DeliveryRequest
from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime

# Each accepted request is exactly one message (contract, ROS side): keep every message until it is acknowledged.
_DELIVERY_QOS: Final = QoSProfile(history=HistoryPolicy.KEEP_ALL)
# A KEEP_ALL writer of Fast DDS holds 5,000 messages. If it is full, publish waits for acknowledgements. That takes
# milliseconds or, with a reader that has fallen behind, blocks the event loop for 0.1 s and fails. Publishing then
# pauses for so many seconds. wait_for_all_acked does not help: readers acknowledge only every 3 s on their own.
_RECOVERY: Final = 0.5
# Only the newest velocity counts; an older one that waited in a queue must not drive the robot.
_VELOCITY_QOS: Final = QoSProfile(depth=1)
_LAST_WORD: Final = Duration(seconds=0.5)  # time for a robot to receive its last velocity
_VELOCITY_TYPES: Final[dict[str, Any]] = {
    "geometry_msgs/msg/Twist": Twist,
    "geometry_msgs/msg/TwistStamped": TwistStamped,
}


class RobotPublishersNode:
    """The ROS node with all publishers and with the clients of the navigation action."""

    def __init__(self, ros: RosRuntime, names: RosNames) -> None:
        self.node = ros.create_node("robot_publishers")
        self._names = names
        self._delivery = self.node.create_publisher(DeliveryRequestMsg, names.topics.delivery, _DELIVERY_QOS)
        # rclpy's Publisher does the same, but takes 0.4 µs more per call to guard against its own destruction. This
        # publisher is destroyed only after all serving has ended.
        self._count_readers = self._delivery.handle.get_subscription_count
        self._publish_serialized = self._delivery.handle.publish_raw
        self._behind_until = 0.0
        self._velocity: dict[str, Any] = {}
        self._navigation = ActionClient(self.node, NavigateToPose, names.actions.navigate_to_pose)
        self._cancel = self.node.create_client(CancelGoal, f"{names.actions.navigate_to_pose}/_action/cancel_goal")
        if names.velocity.message != "auto":
            self._velocity_publisher(f"geometry_msgs/msg/{names.velocity.message}")

    # The delivery application

    def delivery_is_served(self) -> bool:
        """Return whether any node subscribes to delivery requests."""
        return bool(self._count_readers())

    def publish_delivery(self, request: DeliveryRequest) -> bool:
        """Publish a delivery request; return False without publishing while the subscribers cannot keep up."""
        now = monotonic()
        if now < self._behind_until:
            return False
        try:
            self._publish_serialized(request.serialize())
        except rclpy_c.RCLError:
            self._behind_until = now + _RECOVERY
            return False
        return True

    # Velocity

    def find_velocity_subscribers(self) -> bool:
        """Return whether a robot subscribes to velocity commands; create the publisher of the type that it needs.

        The subscriber determines the type: Twist for Nav2 in Jazzy, TwistStamped for a TurtleBot 3.
        """
        if any(publisher.get_subscription_count() for publisher in self._velocity.values()):
            return True
        if self._names.velocity.message == "auto":
            topic = self.node.resolve_topic_name(self._names.topics.cmd_vel)
            for endpoint in self.node.get_subscriptions_info_by_topic(topic):
                if endpoint.topic_type in _VELOCITY_TYPES:
                    self._velocity_publisher(endpoint.topic_type)
        return any(publisher.get_subscription_count() for publisher in self._velocity.values())

    def publish_velocity(self, twist: Twist) -> bool:
        """Publish a velocity command in each type that has subscribers; return False if publishing failed."""
        sent = True
        for kind, publisher in self._velocity.items():
            if not publisher.get_subscription_count():
                continue
            if _VELOCITY_TYPES[kind] is Twist:
                sent &= _publish(publisher, twist)
            else:
                stamped = TwistStamped(twist=twist)
                stamped.header.stamp = self.node.get_clock().now().to_msg()
                stamped.header.frame_id = self._names.frames.base
                sent &= _publish(publisher, stamped)
        return sent

    def await_velocity_taken(self) -> None:
        """Wait until all robots have received the last velocity command, but at most half a second."""
        for publisher in self._velocity.values():
            publisher.wait_for_all_acked(_LAST_WORD)

    def _velocity_publisher(self, kind: str) -> None:
        if kind not in self._velocity:
            self._velocity[kind] = self.node.create_publisher(
                _VELOCITY_TYPES[kind], self._names.topics.cmd_vel, _VELOCITY_QOS
            )

    # Navigation

    def navigation_is_served(self) -> bool:
        """Return whether an action server for NavigateToPose goals is running."""
        return bool(self._navigation.server_is_ready())

    def send_goal(self, identity: bytes, pose: PoseStamped) -> Future:
        """Send a goal with a 16-byte UUID, from the executor's thread; the future holds rclpy's ClientGoalHandle."""
        return self._navigation.send_goal_async(NavigateToPose.Goal(pose=pose), goal_uuid=UUID(uuid=list(identity)))

    def cancel_goal(self, identity: bytes) -> Future:
        """Cancel the goal of any client; the future holds a CancelGoal response."""
        request = CancelGoal.Request()
        request.goal_info.goal_id.uuid = list(identity)
        return self._cancel.call_async(request)

    def cancel_all_goals(self) -> Future:
        """Cancel all goals of all clients: an id and a stamp of zeros (action_msgs/CancelGoal)."""
        return self._cancel.call_async(CancelGoal.Request())


def _publish(publisher: Any, message: Any) -> bool:
    """Publish a message; return False if the middleware could not accept it within its own deadline."""
    try:
        publisher.publish(message)
    except rclpy_c.RCLError:
        return False
    return True
