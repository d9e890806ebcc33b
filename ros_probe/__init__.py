"""The place of the suite on a ROS graph: a process of its own, which alone imports rclpy."""
