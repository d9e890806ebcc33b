"""The paper's facts on its robot: for the pack that judges it, the robot itself, and the load test."""
