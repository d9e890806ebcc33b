"""The application's place on the robot's ROS graph: processes of their own, so that load tests run where no ROS is."""
