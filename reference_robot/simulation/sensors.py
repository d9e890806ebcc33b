"""The robot's simulated sensors besides odometry: laser scanner, inertial measurement unit, battery.

A sensor measures only while its topic has subscribers, as in image_transport. The laser alone would take 1 % of a
processor.
"""

import array
import math
import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import BatteryState, Imu, LaserScan

from reference_robot.names import RosNames
from reference_robot.simulation.messages import quaternion_of
from reference_robot.simulation.office import OFFICE
from reference_robot.simulation.realism import Motion

_SCAN_PERIOD_S: Final = 0.2
_IMU_PERIOD_S: Final = 0.04
_BATTERY_PERIOD_S: Final = 1.0

_BEAMS: Final = 360
_RANGE_MIN_M: Final = 0.05
_RANGE_MAX_M: Final = 12.0
_GRAVITY: Final = 9.81  # m/s²
_BATTERY_LIFE_S: Final = 4 * 3600.0
_BATTERY_AH: Final = 4.4
_FULL_V: Final = 16.6
_EMPTY_V: Final = 14.0


class Sensors:
    """The publishers of laser scans, inertial measurements and battery state for the body's true motion."""

    def __init__(self, node: Node, names: RosNames, motion: Callable[[], Motion]) -> None:
        self._clock = node.get_clock()
        self._motion = motion
        self._angles = np.linspace(-math.pi, math.pi, _BEAMS, endpoint=False)
        self._scan = LaserScan(
            angle_min=float(self._angles[0]),
            angle_max=float(self._angles[-1]),
            angle_increment=math.tau / _BEAMS,
            scan_time=_SCAN_PERIOD_S,
            range_min=_RANGE_MIN_M,
            range_max=_RANGE_MAX_M,
        )
        self._imu = Imu()
        self._imu.linear_acceleration.z = _GRAVITY
        self._battery = BatteryState(
            design_capacity=_BATTERY_AH,
            capacity=_BATTERY_AH,
            temperature=25.0,
            power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
            power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_GOOD,
            power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LION,
            present=True,
        )
        for message in (self._scan, self._imu, self._battery):
            message.header.frame_id = names.frames.base
        self._switched_on = time.monotonic()
        self._before: tuple[float, float] = (0.0, self._switched_on)  # the last speed (m/s) and its time
        topics, usual = names.topics, qos_profile_sensor_data
        self._scans = _sensor(node, LaserScan, topics.scan, usual, _SCAN_PERIOD_S, self._look)
        self._imus = _sensor(node, Imu, topics.imu, usual, _IMU_PERIOD_S, self._feel)
        self._batteries = _sensor(
            node, BatteryState, topics.battery, QoSProfile(depth=1), _BATTERY_PERIOD_S, self._weigh_battery
        )

    def _look(self) -> None:
        motion = self._motion()
        ranges = OFFICE.distances(motion.x, motion.y, self._angles + motion.yaw, _RANGE_MAX_M)
        self._scan.header.stamp = self._clock.now().to_msg()
        # rclpy copies an array of C floats, but checks every number of a list.
        self._scan.ranges = array.array("f", ranges.astype(np.float32).tobytes())
        self._scans.publish(self._scan)

    def _feel(self) -> None:
        motion, now = self._motion(), time.monotonic()
        speed_before, before = self._before
        self._before = motion.linear, now
        imu = self._imu
        imu.header.stamp = self._clock.now().to_msg()
        imu.orientation = quaternion_of(motion.yaw)
        imu.angular_velocity.z = motion.angular
        imu.linear_acceleration.x = (motion.linear - speed_before) / max(now - before, _IMU_PERIOD_S / 2)
        imu.linear_acceleration.y = motion.linear * motion.angular
        self._imus.publish(imu)

    def _weigh_battery(self) -> None:
        used = (time.monotonic() - self._switched_on) / _BATTERY_LIFE_S
        charge = max(1.0 - used, 0.0)
        battery = self._battery
        battery.header.stamp = self._clock.now().to_msg()
        battery.percentage = charge
        battery.charge = charge * _BATTERY_AH
        battery.current = -_BATTERY_AH / (_BATTERY_LIFE_S / 3600.0)
        battery.voltage = _EMPTY_V + (_FULL_V - _EMPTY_V) * charge
        self._batteries.publish(battery)


def _sensor(
    node: Node, kind: type, topic: str, qos: QoSProfile, period_s: float, measure: Callable[[], None]
) -> Publisher:
    """Return a publisher; ``measure`` is called once per period while the publisher has subscribers."""
    timer = node.create_timer(period_s, measure, autostart=False)

    def note_subscribers(change: Any) -> None:
        if not change.current_count:
            timer.cancel()
        elif timer.is_canceled():
            timer.reset()

    return node.create_publisher(kind, topic, qos, event_callbacks=PublisherEventCallbacks(matched=note_subscribers))
