"""Scenarios with the paper's robot: they record traces and judge nothing."""
