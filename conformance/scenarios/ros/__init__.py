"""Both ends of a gateway between ROS 2 and the web: web requests and reads, and a ROS node that sees them."""
