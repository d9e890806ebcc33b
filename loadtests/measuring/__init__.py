"""Carry out a run: users, executors on this machine and others, preflight and environment."""
