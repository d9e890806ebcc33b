"""Where the robot is, as its odometry says."""

from collections.abc import Callable

from nav_msgs.msg import Odometry
from rclpy.node import Node

from reference_robot.names import RosNames
from reference_robot.simulation.messages import PoseError, yaw_of
from reference_robot.simulation.planner import Pose


class Localisation:
    """The robot's last known pose in the map frame, with which the odometry frame coincides.

    Attributes:
        on_update: Called with the pose after each odometry message.
    """

    def __init__(self, node: Node, names: RosNames) -> None:
        self.on_update: Callable[[Pose], None] | None = None
        self._pose: Pose | None = None
        node.create_subscription(Odometry, names.topics.odom, self._take, 1)

    def pose(self) -> Pose:
        """Return x, y (m) and yaw (rad).

        Raises:
            PoseError: No odometry has come yet.
        """
        if self._pose is None:
            raise PoseError("the robot does not know yet where it is")
        return self._pose

    def _take(self, odometry: Odometry) -> None:
        pose = odometry.pose.pose
        self._pose = (pose.position.x, pose.position.y, yaw_of(pose.orientation))
        if self.on_update is not None:
            self.on_update(self._pose)
