"""Certify a fleet: the fleet file, one process for each robot, and the combined result."""
