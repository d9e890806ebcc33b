"""Carrying a run out: users, recorder, executors on this machine and on others, preflight and environment."""
