"""How the suite reads, drives and stops a robot of this contract; goals, plans, deliveries and the ROS probe."""
