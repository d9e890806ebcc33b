"""Publishers of the robot's frames (REP 105: map → odom → base) and of the office's map as an occupancy grid."""

import array
import math
import time
from typing import Final

import numpy as np
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from tf2_msgs.msg import TFMessage

from reference_robot.names import RosNames
from reference_robot.simulation.kinematics import Motion
from reference_robot.simulation.messages import LATCHED, quaternion_of
from reference_robot.simulation.office import OFFICE

_RESOLUTION_M: Final = 0.05
_OCCUPIED: Final = 100  # probability in percent (nav_msgs/OccupancyGrid)
_PERIOD_S: Final = 0.1  # between transforms; tf2 interpolates, and 50 Hz would cost as much time as the odometry
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
        if now - self._published_at < _PERIOD_S:
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
