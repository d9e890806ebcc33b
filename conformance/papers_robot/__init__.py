"""What the paper says of its robot: for the pack that judges it, the robot itself, and the load test."""
