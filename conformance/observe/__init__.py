"""Watching a device: one clock, one way to poll."""
