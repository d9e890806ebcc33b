"""Class ros-gateway: the web shows and does the same as ROS."""
