"""Fast serialization of odometry messages, in which only the numbers change.

rclpy serializes a message field by field, with 72 covariances, in 9 µs. Overwriting the 15 numbers that change takes 1
µs. The base publishes 50 messages a second and does little else while it stands still.
"""

import math
import struct
from typing import Final

from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message

from reference_robot.simulation.kinematics import Motion

# CDR (OMG DDS-RTPS 2.3, 10): four bytes of encapsulation, with the little-endian flag in the second's last bit; then
# the stamp, two strings of any length, and doubles to the end: pose and 36 covariances, twist and 36 covariances.
_STAMP_AT: Final = 4
_LITTLE_ENDIAN: Final = 1
_POSE: Final = "7d"  # x, y, z; x, y, z, w
_TWIST: Final = "6d"  # x, y, z; x, y, z
_COVARIANCE: Final = 36 * 8  # bytes


class SerializedOdometry:
    """A serialized nav_msgs/Odometry, made from ``message``, whose stamp, pose and velocity can be replaced."""

    def __init__(self, message: Odometry) -> None:
        self._data = bytearray(serialize_message(message))
        order = "<" if self._data[1] & _LITTLE_ENDIAN else ">"
        self._stamp, self._pose, self._twist = (struct.Struct(order + form) for form in ("iI", _POSE, _TWIST))
        self._twist_at = len(self._data) - _COVARIANCE - self._twist.size
        self._pose_at = self._twist_at - _COVARIANCE - self._pose.size

    def filled(self, stamp: tuple[int, int], motion: Motion) -> bytes:
        """Return the serialized message with a stamp (seconds, nanoseconds) and a motion filled in."""
        data, half = self._data, motion.yaw / 2
        self._stamp.pack_into(data, _STAMP_AT, *stamp)
        turn = (0.0, 0.0, math.sin(half), math.cos(half))
        self._pose.pack_into(data, self._pose_at, motion.x, motion.y, 0.0, *turn)
        self._twist.pack_into(data, self._twist_at, motion.linear, motion.lateral, 0.0, 0.0, 0.0, motion.angular)
        return bytes(data)
