"""Judges a robot through its web services, and nothing else."""
