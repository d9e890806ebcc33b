"""The probe's ROS node: hears deliveries and velocity commands, and reads the ROS graph."""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from mybot_delivery_app.msg import DeliveryRequestMsg
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

_NAME: Final = "roaas_probe"
_DISCOVERY_S: Final = 10.0
_STEP_S: Final = 0.02
# A subscription is of use when both ends know of it.
_MATCHED_S: Final = 0.2
_DEPTH: Final = 1000
_STAMPED: Final = "geometry_msgs/msg/TwistStamped"
_FIELDS: Final = tuple(DeliveryRequestMsg.get_fields_and_field_types())


class ProbeNode:
    """A ROS node on the robot's topics.

    Args:
        domain_id: the robot's ROS domain.
        delivery_topic: full name of the topic of deliveries.
        cmd_vel_topic: full name of the topic of velocity commands; None: they are not heard.
    """

    def __init__(self, domain_id: int, delivery_topic: str, cmd_vel_topic: str | None) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(_NAME, context=self._context, start_parameter_services=False, enable_rosout=False)
        self._delivery_topic, self._cmd_vel_topic = delivery_topic, cmd_vel_topic
        # Filled by the executor's thread, emptied by the one that answers: deque's ends are safe for that.
        self._heard: dict[str, deque[list[Any]]] = {"deliveries": deque(), "velocities": deque()}
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)
        self._thread.start()

    def observe(self) -> str:
        """Subscribe once the robot's publishers are there; return the problem, or empty.

        Publishers count as well as nodes, as they may be discovered before their nodes' names.
        """
        topics = [topic for topic in (self._delivery_topic, self._cmd_vel_topic) if topic]
        count = self._node.count_publishers
        self._awaited(lambda: all(map(count, topics)))
        nodes = sum(name != _NAME for name in self._node.get_node_names())
        if not nodes + sum(map(count, topics)):
            return f"no ROS node is found in domain {self._context.get_domain_id()}"
        self._subscribe(DeliveryRequestMsg, self._delivery_topic, self._delivery_came)
        if self._cmd_vel_topic:
            stamped = _STAMPED in dict(self._node.get_topic_names_and_types()).get(self._cmd_vel_topic, [])
            came = (lambda message: self._velocity_came(message.twist)) if stamped else self._velocity_came
            self._subscribe(TwistStamped if stamped else Twist, self._cmd_vel_topic, came)
        time.sleep(_MATCHED_S)
        return ""

    def answer(self, question: str) -> dict[str, Any]:
        """Return the messages of a kind received since the last call, or the published topics with their types."""
        what = question.strip()
        if what in self._heard:
            heard = self._heard[what]
            return {what: [heard.popleft() for _ in range(len(heard))]}
        if what == "graph":
            topics = self._node.get_topic_names_and_types()
            return {"topics": {name: types for name, types in topics if self._node.count_publishers(name)}}
        return {"problem": f"not understood: {what!r}"}

    def close(self) -> None:
        """Remove the node from the ROS graph."""
        self._executor.shutdown()
        self._thread.join(2)
        self._node.destroy_node()
        self._context.try_shutdown()

    def _subscribe(self, kind: type, topic: str, came: Callable[[Any], None]) -> None:
        """Subscribe reliably, or with best effort where a publisher is so, as a reliable subscriber hears none."""
        publishers = self._node.get_publishers_info_by_topic(topic)
        best_effort = any(one.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT for one in publishers)
        reliability = ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
        self._node.create_subscription(kind, topic, came, QoSProfile(depth=_DEPTH, reliability=reliability))

    def _delivery_came(self, message: Any) -> None:
        at_ns = time.monotonic_ns()
        self._came("deliveries", at_ns, [getattr(message, name) for name in _FIELDS])

    def _velocity_came(self, twist: Any) -> None:
        at_ns = time.monotonic_ns()
        self._came(
            "velocities", at_ns, [getattr(part, axis) for part in (twist.linear, twist.angular) for axis in "xyz"]
        )

    def _came(self, what: str, at_ns: int, values: list[float]) -> None:
        self._heard[what].append([at_ns, *(float(value).hex() for value in values)])

    @staticmethod
    def _awaited(there: Callable[[], Any]) -> None:
        until = time.monotonic() + _DISCOVERY_S
        while not there() and time.monotonic() <= until:
            time.sleep(_STEP_S)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except (ExternalShutdownException, ShutdownException):
            return
