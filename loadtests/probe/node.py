"""The probe's ROS node: receives deliveries as the application does, or publishes them without any web service."""

import threading
import time
from collections.abc import Callable
from typing import Any

import rclpy
from mybot_delivery_app.msg import DeliveryRequestMsg
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from conformance.packs.table1.delivery import MESSAGE_FIELDS

_DISCOVERY_S = 6.0
_STEP_S = 0.02
_DEPTH = 1000


class DeliveryNode:
    """A ROS node on the topic of deliveries.

    Args:
        domain_id: the robot's ROS domain.
        topic: full name.
        say: receives each delivery, on the executor's thread.
    """

    def __init__(self, domain_id: int, topic: str, say: Callable[[dict[str, Any]], None]) -> None:
        self._topic = topic
        self._say = say
        self._publisher: Any = None
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node("roaas_load", context=self._context, start_parameter_services=False, enable_rosout=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)
        self._thread.start()

    def listen(self) -> str | None:
        """Subscribe in the application's place, once there is a publisher; returns the problem, if there is one."""
        if not self._found(lambda: self._node.count_publishers(self._topic)):
            return f"nothing publishes {self._topic} in ROS domain {self._context.get_domain_id()}"
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        best_effort = any(one.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT for one in publishers)
        reliability = ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
        self._node.create_subscription(
            DeliveryRequestMsg, self._topic, self._came, QoSProfile(depth=_DEPTH, reliability=reliability)
        )
        return None

    def publish_to(self) -> str | None:
        """Become a publisher, once there is a subscriber; returns the problem, if there is one."""
        self._publisher = self._node.create_publisher(DeliveryRequestMsg, self._topic, QoSProfile(depth=_DEPTH))
        if not self._found(self._publisher.get_subscription_count):
            return f"nothing subscribes to {self._topic} in ROS domain {self._context.get_domain_id()}"
        return None

    def publish(self, values: list[str]) -> int:
        """Publish a delivery; returns when that began."""
        code, *places = (float.fromhex(value) for value in values)
        message = DeliveryRequestMsg(**dict(zip(MESSAGE_FIELDS, (int(code), *places), strict=True)))
        began = time.monotonic_ns()
        self._publisher.publish(message)
        return began

    def close(self) -> None:
        """Remove the node from the ROS graph."""
        self._executor.shutdown()
        self._thread.join(2)
        self._node.destroy_node()
        self._context.try_shutdown()

    def _came(self, message: Any) -> None:
        at = time.monotonic_ns()
        self._say({"at_ns": at, "values": [float(getattr(message, name)).hex() for name in MESSAGE_FIELDS]})

    @staticmethod
    def _found(count: Callable[[], int]) -> bool:
        until = time.monotonic() + _DISCOVERY_S
        while not count():
            if time.monotonic() > until:
                return False
            time.sleep(_STEP_S)
        return True

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except (ExternalShutdownException, ShutdownException):
            return
