"""The robot's present pose, read from its odometry topic."""

from collections.abc import Callable

from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from reference_robot.names import RosNames
from reference_robot.simulation.messages import PoseError, yaw_of
from reference_robot.simulation.planner import Pose


class Localisation:
    """A subscriber that knows the robot's latest pose in the map frame, which coincides with the odometry frame.

    Odometry is kept serialized and is only deserialized in ``pose``, which nobody calls while the robot is idle.

    Attributes:
        on_update: Called after each odometry message.
    """

    def __init__(self, node: Node, names: RosNames) -> None:
        self.on_update: Callable[[], None] | None = None
        self._serialized = b""
        node.create_subscription(Odometry, names.topics.odom, self._receive, 1, raw=True)

    def pose(self) -> Pose:
        """Return the robot's x, y (m) and yaw (rad).

        Raises:
            PoseError: No odometry has been received yet.
        """
        if not self._serialized:
            raise PoseError("the robot has not received its first odometry yet")
        pose = deserialize_message(self._serialized, Odometry).pose.pose
        return pose.position.x, pose.position.y, yaw_of(pose.orientation)

    def _receive(self, serialized: bytes) -> None:
        self._serialized = serialized
        if self.on_update is not None:
            self.on_update()
