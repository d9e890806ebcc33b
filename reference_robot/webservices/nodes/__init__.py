"""ROS nodes without web code: all publishers, and all subscribers (paper, section on the meta-models)."""
