"""The transform from the map to the odometry frame, as the robot's localisation publishes it (REP 105)."""

from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from tf2_msgs.msg import TFMessage

from reference_robot.names import RosNames

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
