"""Scenarios record what a device does, rules judge the record, and a planner orders both."""
