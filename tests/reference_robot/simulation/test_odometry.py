"""Odometry as octets: what ROS reads in them is, bit for bit, what the base has filled in."""

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message

from reference_robot.simulation.base import SerializedOdometry
from reference_robot.simulation.kinematics import Motion
from reference_robot.simulation.messages import quaternion_of


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
