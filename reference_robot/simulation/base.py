"""The robot's base: obeys velocity commands, moves the body, reports odometry, and stops when commands cease."""

import math
import time
from typing import Final

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile

from reference_robot.kinematics import Kinematics
from reference_robot.names import RosNames
from reference_robot.simulation.frames import FramePublisher
from reference_robot.simulation.kinematics import Motion, advance
from reference_robot.simulation.odometry import SerializedOdometry
from reference_robot.simulation.office import BODY_RADIUS, DEPOT, OFFICE
from reference_robot.simulation.realism import IMPERFECT, Delayed, Realism

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
            node.create_subscription(TwistStamped, names.topics.cmd_vel, self._receive_stamped, newest)
        else:
            node.create_subscription(Twist, names.topics.cmd_vel, self._receive, newest)
        node.create_timer(max(_PERIOD_S / time_scale, _SHORTEST_PERIOD_S), self._step)

    def _receive_stamped(self, command: TwistStamped) -> None:
        self._receive(command.twist)

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
        command = self._commands.arrived(now)
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
        self._belief = self._realism.believed(self._belief, before, after, self.motion, seconds)
        period = 1 / (self._realism.character.odometry_hz * self._time_scale)
        if now - self._reported_at >= period:
            self._reported_at = max(self._reported_at + period, now - period)
            self._report(self._realism.noisy(self._belief))

    def _report(self, motion: Motion) -> None:
        stamp = divmod(self._clock.now().nanoseconds, _NANOSECONDS)
        self._publisher.publish(self._odometry.filled(stamp, motion))
        self._frames.publish(stamp, motion)
