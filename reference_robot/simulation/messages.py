"""Conversions between ROS messages and the plain values of the simulation, such as the pose in the latest odometry."""

import math
from typing import TYPE_CHECKING, Any, Final

from geometry_msgs.msg import PoseStamped, Quaternion
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header

from reference_robot.names import Frames, RosNames
from reference_robot.simulation.planner import Pose

if TYPE_CHECKING:
    from collections.abc import Callable

_UNIT_TOLERANCE: Final = 1e-3  # of a quaternion's length, as in the contract

# How long an action server keeps a goal's result, as in Nav2. rclpy's default of 900 s slows every change of a goal's
# state down, because each status report contains all goals that are kept.
RESULT_TIMEOUT_S: Final = 10

# For state: the publisher keeps its last message, and late subscribers receive it at once.
LATCHED: Final = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)

# Each report contains only changes, so late subscribers receive the last hundred reports.
MISSION_REPORTS: Final = QoSProfile(
    depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


class PoseError(ValueError):
    """An error for a pose that cannot be used; the message names the invalid value."""


def yaw_of(quaternion: Quaternion) -> float:
    """Return the rotation of a quaternion about the z axis, in radians."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def quaternion_of(yaw: float) -> Quaternion:
    """Return the unit quaternion of a rotation by ``yaw`` radians about the z axis."""
    return Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))


def pose_of(stamped: PoseStamped, frames: Frames) -> Pose:
    """Return x, y (m) and yaw (rad) of a PoseStamped in the map or odometry frame, which coincide.

    Raises:
        PoseError: The frame is unknown, or the orientation is not a unit quaternion.
    """
    known = (frames.map, frames.odom)
    if stamped.header.frame_id not in known:
        raise PoseError(f"frame_id {stamped.header.frame_id!r} is unknown; the robot knows {', '.join(known)}")
    turn = stamped.pose.orientation
    length = math.hypot(turn.x, turn.y, turn.z, turn.w)
    if not abs(length - 1.0) <= _UNIT_TOLERANCE:  # in this form NaN fails too
        raise PoseError(f"the orientation's length is {length:g}, not 1")
    return stamped.pose.position.x, stamped.pose.position.y, yaw_of(turn)


def stamped_pose(pose: Pose, header: Header) -> PoseStamped:
    """Return a PoseStamped with the given x, y (m), yaw (rad) and header."""
    message = PoseStamped(header=header)
    message.pose.position.x, message.pose.position.y = float(pose[0]), float(pose[1])
    message.pose.orientation = quaternion_of(float(pose[2]))
    return message


def plain(stamped: PoseStamped) -> dict[str, Any]:
    """Return a PoseStamped as nested dicts with its ROS field names, ready for JSON."""
    stamp, position, turn = stamped.header.stamp, stamped.pose.position, stamped.pose.orientation
    return {
        "header": {"stamp": {"sec": stamp.sec, "nanosec": stamp.nanosec}, "frame_id": stamped.header.frame_id},
        "pose": {
            "position": {"x": position.x, "y": position.y, "z": position.z},
            "orientation": {"x": turn.x, "y": turn.y, "z": turn.z, "w": turn.w},
        },
    }


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
