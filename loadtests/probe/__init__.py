"""The application's place on the robot's ROS graph, in processes of their own: load tests run without ROS too."""
