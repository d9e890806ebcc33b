"""The probe's ROS node: subscribes to deliveries and velocity commands, and reads the ROS graph."""

import threading
import time
from collections import deque
from typing import Any, Final

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from mybot_delivery_app.msg import DeliveryRequestMsg
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from conformance.packs.table1.delivery import COORDINATES

_NAME: Final = "roaas_probe"
_STEP_S: Final = 0.05
_DEPTH: Final = 1000
_STAMPED: Final = "geometry_msgs/msg/TwistStamped"


class ProbeNode:
    """A ROS node that records the robot's deliveries and velocity commands.

    Args:
        domain_id: the robot's ROS domain.
        delivery_topic, cmd_vel_topic: full topic names.
    """

    def __init__(self, domain_id: int, delivery_topic: str, cmd_vel_topic: str) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(_NAME, context=self._context, start_parameter_services=False, enable_rosout=False)
        self._delivery_topic, self._cmd_vel_topic = delivery_topic, cmd_vel_topic
        # Filled by the executor's thread, emptied by the one that answers: deque's ends are safe for that.
        self._deliveries: deque[list[Any]] = deque()
        self._velocities: deque[list[str]] = deque()
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)
        self._thread.start()

    def find(self, seconds: float) -> int:
        """Wait for the robot's publishers, then subscribe.

        Returns:
            Number of nodes and publishers in the domain; 0 means that this is not the robot's domain. Publishers count
            too, as they may be discovered before their nodes' names.
        """
        topics = (self._delivery_topic, self._cmd_vel_topic)
        until = time.monotonic() + seconds
        while time.monotonic() < until and not all(self._node.count_publishers(topic) for topic in topics):
            time.sleep(_STEP_S)
        self._listen()
        # A subscription is of use when both ends know of it.
        time.sleep(4 * _STEP_S)
        nodes = sum(name != _NAME for name in self._node.get_node_names())
        found: int = nodes + sum(self._node.count_publishers(topic) for topic in topics)
        return found

    def deliveries(self) -> dict[str, Any]:
        """Return the messages received on the delivery topic since the last call, each after the time it came."""
        return {"deliveries": _emptied(self._deliveries)}

    def velocities(self) -> dict[str, Any]:
        """Return the messages received on the velocity topic since the last call, each after the time it came."""
        return {"velocities": _emptied(self._velocities)}

    def graph(self) -> dict[str, Any]:
        """Return the published topics with their types."""
        topics = self._node.get_topic_names_and_types()
        return {"topics": {name: types for name, types in topics if self._node.count_publishers(name)}}

    def close(self) -> None:
        """Destroy the node."""
        self._executor.shutdown()
        self._thread.join(2)
        self._node.destroy_node()
        self._context.try_shutdown()

    def _listen(self) -> None:
        self._node.create_subscription(
            DeliveryRequestMsg, self._delivery_topic, self._delivery_came, self._quality(self._delivery_topic)
        )
        types = dict(self._node.get_topic_names_and_types()).get(self._cmd_vel_topic, [])
        if _STAMPED in types:
            self._node.create_subscription(
                TwistStamped, self._cmd_vel_topic, self._stamped_came, self._quality(self._cmd_vel_topic)
            )
        else:
            self._node.create_subscription(
                Twist, self._cmd_vel_topic, self._velocity_came, self._quality(self._cmd_vel_topic)
            )

    def _quality(self, topic: str) -> QoSProfile:
        """Return a reliable QoS, or best effort where a publisher is, as a reliable subscriber hears none."""
        publishers = self._node.get_publishers_info_by_topic(topic)
        best_effort = any(one.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT for one in publishers)
        reliability = ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
        return QoSProfile(depth=_DEPTH, reliability=reliability)

    def _delivery_came(self, message: Any) -> None:
        values = [float(getattr(message, name)).hex() for name in COORDINATES]
        self._deliveries.append([time.monotonic().hex(), message.message_code, *values])

    def _stamped_came(self, message: Any) -> None:
        self._velocity_came(message.twist)

    def _velocity_came(self, twist: Any) -> None:
        values = [float(getattr(part, axis)).hex() for part in (twist.linear, twist.angular) for axis in "xyz"]
        self._velocities.append([time.monotonic().hex(), *values])

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except (ExternalShutdownException, ShutdownException):
            return


def _emptied(messages: deque[Any]) -> list[Any]:
    taken = []
    while messages:
        taken.append(messages.popleft())
    return taken
