"""The base: takes velocity commands, moves the body, reports odometry, and stops when commands cease."""

import math
import time
from typing import Final

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile

from reference_robot.names import RosNames
from reference_robot.simulation.kinematics import Motion, advance
from reference_robot.simulation.messages import quaternion_of
from reference_robot.simulation.office import BODY_RADIUS, DEPOT, OFFICE

HOLD_S: Final = 1.0  # a setpoint is good for this long, by the wall clock whatever the time scale
_PERIOD_S: Final = 0.02  # 50 Hz of simulated time
_SHORTEST_PERIOD_S: Final = 0.004  # of real time: a time scale beyond 5 makes the steps longer instead
_LONGEST_STEP_S: Final = 0.1  # of simulated time: a robot whose process was held up does not jump ahead

# Variances (m², rad²) of x, y and yaw as a wheeled base with encoders has them; the rest cannot move.
_POSE_COVARIANCE: Final = [0.0] * 36
_TWIST_COVARIANCE: Final = [0.0] * 36
for _axis, _variance in ((0, 1e-4), (7, 1e-4), (35, 1e-3)):
    _POSE_COVARIANCE[_axis] = _variance
    _TWIST_COVARIANCE[_axis] = _variance


class Base:
    """A differential-drive base on the ROS graph; ``time_scale`` makes it up to 25 times faster than real time.

    Attributes:
        motion: The body's pose and velocity now.
    """

    def __init__(self, node: Node, names: RosNames, time_scale: float = 1.0) -> None:
        self.motion = Motion(*DEPOT, 0.0)
        self._node = node
        self._clock = node.get_clock()
        self._time_scale = time_scale
        self._solid = OFFICE.grown(BODY_RADIUS)
        self._setpoint = (0.0, 0.0)
        self._commanded_at = -math.inf
        self._moved_at = time.monotonic()
        # One message for all: publishing copies it out.
        self._odometry = Odometry(child_frame_id=names.frames.base)
        self._odometry.header.frame_id = names.frames.odom
        self._odometry.pose.covariance = _POSE_COVARIANCE
        self._odometry.twist.covariance = _TWIST_COVARIANCE
        self._publisher = node.create_publisher(Odometry, names.topics.odom, 10)
        newest = QoSProfile(depth=1)
        if names.velocity.message == "TwistStamped":
            node.create_subscription(TwistStamped, names.topics.cmd_vel, self._take_stamped, newest)
        else:
            node.create_subscription(Twist, names.topics.cmd_vel, self._take, newest)
        node.create_timer(max(_PERIOD_S / time_scale, _SHORTEST_PERIOD_S), self._step)

    def _take_stamped(self, command: TwistStamped) -> None:
        self._take(command.twist)

    def _take(self, command: Twist) -> None:
        setpoint = (command.linear.x, command.angular.z)
        if not all(map(math.isfinite, setpoint)):
            self._node.get_logger().warning(f"refused a velocity command of {setpoint}", throttle_duration_sec=1.0)
            return
        self._setpoint = setpoint
        self._commanded_at = time.monotonic()

    def _step(self) -> None:
        now = time.monotonic()
        seconds = min((now - self._moved_at) * self._time_scale, _LONGEST_STEP_S)
        self._moved_at = now
        if now - self._commanded_at > HOLD_S:
            self._setpoint = (0.0, 0.0)
        self.motion = advance(self.motion, self._setpoint, seconds, self._solid.is_free)
        self._report()

    def _report(self) -> None:
        motion, odometry = self.motion, self._odometry
        odometry.header.stamp = self._clock.now().to_msg()
        position = odometry.pose.pose.position
        position.x, position.y = motion.x, motion.y
        odometry.pose.pose.orientation = quaternion_of(motion.yaw)
        odometry.twist.twist.linear.x = motion.linear
        odometry.twist.twist.angular.z = motion.angular
        self._publisher.publish(odometry)
