"""Connect to a robot, run the checks with pytest, turn exceptions into evidence, and write the result."""
