"""Pure ROS nodes: all publishers, and all subscribers. No web code (paper, section on the meta-models)."""
