"""The place of the suite and of the load tests on a ROS graph: a process of its own, which alone imports rclpy."""
