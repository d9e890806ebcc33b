"""The ROS probe: observes the robot's topics from a process of its own, so that the suite itself needs no ROS."""
