"""A robot that conforms: ROS 2 interfaces, a simulated robot, and the web services in front of it."""
