"""A look at the robot's ROS side: a process of its own, so that the suite runs where no ROS is."""
