"""What ROS, RViz and Nav2 need of the simulated robot: its odometry, its frames and its map."""

import numpy as np
from nav_msgs.msg import OccupancyGrid, Odometry
from observer import until
from rclpy.serialization import deserialize_message
from tf2_msgs.msg import TFMessage

from reference_robot.simulation.base import SerializedOdometry
from reference_robot.simulation.messages import LATCHED, quaternion_of
from reference_robot.simulation.office import DEPOT, DESTINATION, OFFICE, SOURCE
from reference_robot.simulation.realism import Motion


def test_frames_and_map_are_told(robot):
    moving, static, maps = [], [], []
    for kind, topic, seen, qos in (
        (TFMessage, "/tf", moving, 100),
        (TFMessage, "/tf_static", static, LATCHED),
        (OccupancyGrid, "/map", maps, LATCHED),
    ):
        robot.node.create_subscription(kind, topic, seen.append, qos)
    until(lambda: moving and static and maps)

    (coinciding,) = static[0].transforms
    assert (coinciding.header.frame_id, coinciding.child_frame_id) == ("map", "odom")
    assert coinciding.transform.rotation.w == 1.0

    robot.command(0.5, 1.0)
    (base,) = until(
        lambda: next((m.transforms for m in moving if m.transforms[0].transform.translation.x > DEPOT[0] + 0.01), None)
    )
    assert (base.header.frame_id, base.child_frame_id) == ("odom", "base_link")
    measured = until(lambda: next((m for _, m in robot.odometry if m.header.stamp == base.header.stamp), None))
    assert base.transform.translation.x == measured.pose.pose.position.x
    assert base.transform.rotation == measured.pose.pose.orientation

    grid = maps[0]
    cells = np.array(grid.data, dtype=np.int8).reshape(grid.info.height, grid.info.width)
    corner, size = grid.info.origin.position, grid.info.resolution

    def cell(x, y):
        return cells[int((y - corner.y) / size), int((x - corner.x) / size)]

    assert grid.header.frame_id == "map"
    assert [cell(*place) for place in (DEPOT, SOURCE, DESTINATION)] == [0, 0, 0]
    for x_min, y_min, x_max, y_max in OFFICE.boxes:
        assert cell((x_min + x_max) / 2, (y_min + y_max) / 2) == 100
    assert 0.05 < (cells == 100).mean() < 0.3


def test_filled_octets_are_the_message_whatever_the_frames_and_the_numbers():
    for frame in ("odom", "o", "robot_7/odometry"):  # the doubles begin wherever the strings end
        message = Odometry(child_frame_id=f"{frame}_base")
        message.header.frame_id = frame
        message.pose.covariance = [0.1 * number for number in range(36)]
        message.twist.covariance = [-0.2 * number for number in range(36)]
        octets = SerializedOdometry(message)
        for motion in (Motion(0.1, -0.2, 3.1, 0.7, -2.5), Motion(5e-324, -0.0, 0.0)):
            message.header.stamp.sec, message.header.stamp.nanosec = stamp = 2_000_000_000, 999_999_999
            message.pose.pose.position.x, message.pose.pose.position.y = motion.x, motion.y
            message.pose.pose.orientation = quaternion_of(motion.yaw)
            message.twist.twist.linear.x, message.twist.twist.angular.z = motion.linear, motion.angular
            # As text, which tells -0.0 from 0.0.
            assert repr(deserialize_message(octets.fill(stamp, motion), Odometry)) == repr(message)
