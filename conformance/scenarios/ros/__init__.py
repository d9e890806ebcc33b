"""Both ends of a gateway between ROS 2 and the web: what is sent and read there, and what a ROS node sees of it."""
