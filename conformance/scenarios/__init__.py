"""Scenarios record what a device does, rules judge the record, a planner orders them."""
