"""Derive verdicts from evidence: for each requirement, each class and the robot."""
