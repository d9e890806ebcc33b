"""This contract's robot: how it is read, driven and stopped; goals, plans, deliveries; the ROS probe."""
