"""The functions of the robot that REST and SOAP share: deliveries, goals, velocity, pose and plans."""
