"""From evidence to verdicts: of each requirement, each class and the robot."""
