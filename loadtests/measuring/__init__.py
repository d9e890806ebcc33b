"""What carries a run out: users, executors on this machine and on others, preflight and environment."""
