"""Connects to a robot, runs the checks with pytest, turns exceptions into evidence, writes the result."""
