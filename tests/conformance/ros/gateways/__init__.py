"""Gateways between HTTP and ROS 2 in five styles: devices that the checks of `ros-gateway` are tried on."""
