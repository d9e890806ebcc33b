"""Observe a device over time: a clock and polling."""
