"""The reference robot: a simulated ROS 2 robot, and REST and SOAP web services in front of its ROS nodes."""
