"""Class ros-gateway: what the web says and what ROS says are the same."""
