"""The robot's base: obeys velocity commands, moves, reports odometry and frames, and stops without commands."""

import array
import math
import struct
import time
from typing import Final

import numpy as np
from geometry_msgs.msg import TransformStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from tf2_msgs.msg import TFMessage

from reference_robot.kinematics import Kinematics
from reference_robot.names import RosNames
from reference_robot.simulation.messages import LATCHED, quaternion_of
from reference_robot.simulation.office import BODY_RADIUS, DEPOT, OFFICE
from reference_robot.simulation.realism import IMPERFECT, Delayed, Motion, Realism, advance

_RESOLUTION_M: Final = 0.05
_OCCUPIED: Final = 100  # probability in percent (nav_msgs/OccupancyGrid)
_TRANSFORMS_S: Final = 0.1  # between transforms; tf2 interpolates, and 50 Hz would cost as much time as the odometry
_TRANSFORMS: Final = 100  # queue depth, as in tf2's broadcaster


class FramePublisher:
    """A publisher of the transform odom → base at 10 Hz and, once and latched, of the identity map → odom."""

    def __init__(self, node: Node, names: RosNames) -> None:
        self._base = TransformStamped(child_frame_id=names.frames.base)
        self._base.header.frame_id = names.frames.odom
        self._message = TFMessage(transforms=[self._base])
        self._published_at = -math.inf
        self._moving = node.create_publisher(TFMessage, names.topics.tf, _TRANSFORMS)
        self._static = node.create_publisher(TFMessage, names.topics.tf_static, LATCHED)
        identity = TransformStamped(child_frame_id=names.frames.odom)  # the default quaternion is the identity
        identity.header.stamp = node.get_clock().now().to_msg()
        identity.header.frame_id = names.frames.map
        self._static.publish(TFMessage(transforms=[identity]))

    def publish(self, stamp: tuple[int, int], motion: Motion) -> None:
        """Publish the transform of the base at a time (seconds, nanoseconds), at most ten times a second."""
        now = time.monotonic()
        if now - self._published_at < _TRANSFORMS_S:
            return
        self._published_at = now
        base = self._base
        base.header.stamp.sec, base.header.stamp.nanosec = stamp
        base.transform.translation.x, base.transform.translation.y = motion.x, motion.y
        base.transform.rotation = quaternion_of(motion.yaw)
        self._moving.publish(self._message)


class MapServer:
    """A publisher of the office's map: one latched OccupancyGrid, as from Nav2's map_server."""

    def __init__(self, node: Node, names: RosNames) -> None:
        west, south, east, north = OFFICE.bounds
        columns, rows = (round(length / _RESOLUTION_M) for length in (east - west, north - south))
        cells = np.zeros((rows, columns), dtype=np.int8)
        for box in np.round((OFFICE.boxes - (west, south, west, south)) / _RESOLUTION_M).astype(int):
            left, bottom, right, top = box
            cells[bottom:top, left:right] = _OCCUPIED
        grid = OccupancyGrid()
        grid.header.stamp = grid.info.map_load_time = node.get_clock().now().to_msg()
        grid.header.frame_id = names.frames.map
        grid.info.resolution = _RESOLUTION_M
        grid.info.width, grid.info.height = columns, rows
        grid.info.origin.position.x, grid.info.origin.position.y = west, south
        grid.data = array.array("b", cells.tobytes())
        self._publisher = node.create_publisher(OccupancyGrid, names.topics.map, LATCHED)
        self._publisher.publish(grid)


HOLD_S: Final = 1.0  # how long a setpoint is valid, by the wall clock at every time scale
_PERIOD_S: Final = 0.02  # 50 Hz of simulated time
_SHORTEST_PERIOD_S: Final = 0.004  # of real time; above a time scale of 5 the steps become longer instead
_NANOSECONDS: Final = 10**9
_LONGEST_STEP_S: Final = 0.1  # of simulated time: after a delay of the process the robot does not jump ahead

# Variances (m², rad²) of x, y and yaw, typical for a wheeled base with encoders; other coordinates are fixed.
_POSE_COVARIANCE: Final = [0.0] * 36
_TWIST_COVARIANCE: Final = [0.0] * 36
for _axis, _variance in ((0, 1e-4), (7, 1e-4), (35, 1e-3)):
    _POSE_COVARIANCE[_axis] = _variance
    _TWIST_COVARIANCE[_axis] = _variance

# rclpy serializes an odometry message field by field, with 72 covariances, in 9 µs. Overwriting the 15 numbers that
# change takes 1 µs: the base publishes 50 messages a second and does little else while it stands still.
# CDR (OMG DDS-RTPS 2.3, 10): four bytes of encapsulation, with the little-endian flag in the second's last bit; then
# the stamp, two strings of any length, and doubles to the end: pose and 36 covariances, twist and 36 covariances.
_STAMP_AT: Final = 4
_LITTLE_ENDIAN: Final = 1
_POSE: Final = "7d"  # x, y, z; x, y, z, w
_TWIST: Final = "6d"  # x, y, z; x, y, z
_COVARIANCE: Final = 36 * 8  # bytes


class Base:
    """A ROS node's base that subscribes to velocity commands and publishes odometry.

    ``time_scale`` makes the base up to 25 times faster than real time. With ``realism`` the wheels slip, and the
    odometry is as inexact as a real robot's.

    Attributes:
        motion: The true pose and velocity of the body at present.
    """

    def __init__(
        self,
        node: Node,
        names: RosNames,
        time_scale: float = 1.0,
        realism: Realism | None = None,
        kinematics: Kinematics | None = None,
    ) -> None:
        self.motion = Motion(*DEPOT, 0.0)
        self._realism = realism
        self._belief = self.motion
        self._kinematics = kinematics or (IMPERFECT if realism else Kinematics())
        self._node = node
        self._clock = node.get_clock()
        self._time_scale = time_scale
        self._solid = OFFICE.grown(BODY_RADIUS)
        self._commands = Delayed()
        self._setpoint: tuple[float, ...] = (0.0, 0.0)
        self._commanded_at = -math.inf
        self._moved_at = self._reported_at = time.monotonic()
        odometry = Odometry(child_frame_id=names.frames.base)
        odometry.header.frame_id = names.frames.odom
        odometry.pose.covariance = _POSE_COVARIANCE
        odometry.twist.covariance = _TWIST_COVARIANCE
        self._odometry = SerializedOdometry(odometry)
        self._publisher = node.create_publisher(Odometry, names.topics.odom, 10)
        self._frames = FramePublisher(node, names)
        newest = QoSProfile(depth=1)
        if names.velocity.message == "TwistStamped":
            node.create_subscription(
                TwistStamped, names.topics.cmd_vel, lambda stamped: self._receive(stamped.twist), newest
            )
        else:
            node.create_subscription(Twist, names.topics.cmd_vel, self._receive, newest)
        node.create_timer(max(_PERIOD_S / time_scale, _SHORTEST_PERIOD_S), self._step)

    def _receive(self, command: Twist) -> None:
        setpoint = (command.linear.x, command.angular.z, command.linear.y)
        if not all(map(math.isfinite, setpoint)):
            self._node.get_logger().warning(f"refused a velocity command of {setpoint}", throttle_duration_sec=1.0)
            return
        late = self._realism.lateness() / self._time_scale if self._realism else 0.0
        self._commands.send(time.monotonic() + late, setpoint)

    def _step(self) -> None:
        now = time.monotonic()
        seconds = min((now - self._moved_at) * self._time_scale, _LONGEST_STEP_S)
        self._moved_at = now
        command = self._commands.take_arrived(now)
        if command is not None:
            self._commanded_at, self._setpoint = command
        if now - self._commanded_at > HOLD_S:
            self._setpoint = (0.0, 0.0)
        before = self.motion
        after = advance(before, self._setpoint, seconds, self._solid.is_free, self._kinematics)
        if self._realism is None:
            self.motion = after
            self._report(after)
            return
        self.motion = self._realism.slipped(before, after)
        self._belief = self._realism.estimate(self._belief, before, after, self.motion, seconds)
        period = 1 / (self._realism.character.odometry_hz * self._time_scale)
        if now - self._reported_at >= period:
            self._reported_at = max(self._reported_at + period, now - period)
            self._report(self._realism.noisy(self._belief))

    def _report(self, motion: Motion) -> None:
        stamp = divmod(self._clock.now().nanoseconds, _NANOSECONDS)
        self._publisher.publish(self._odometry.fill(stamp, motion))
        self._frames.publish(stamp, motion)


class SerializedOdometry:
    """A serialized nav_msgs/Odometry, made from ``message``, whose stamp, pose and velocity can be replaced."""

    def __init__(self, message: Odometry) -> None:
        self._data = bytearray(serialize_message(message))
        order = "<" if self._data[1] & _LITTLE_ENDIAN else ">"
        self._stamp, self._pose, self._twist = (struct.Struct(order + form) for form in ("iI", _POSE, _TWIST))
        self._twist_at = len(self._data) - _COVARIANCE - self._twist.size
        self._pose_at = self._twist_at - _COVARIANCE - self._pose.size

    def fill(self, stamp: tuple[int, int], motion: Motion) -> bytes:
        """Return the serialized message with a stamp (seconds, nanoseconds) and a motion filled in."""
        data, half = self._data, motion.yaw / 2
        self._stamp.pack_into(data, _STAMP_AT, *stamp)
        turn = (0.0, 0.0, math.sin(half), math.cos(half))
        self._pose.pack_into(data, self._pose_at, motion.x, motion.y, 0.0, *turn)
        self._twist.pack_into(data, self._twist_at, motion.linear, motion.lateral, 0.0, 0.0, 0.0, motion.angular)
        return bytes(data)
