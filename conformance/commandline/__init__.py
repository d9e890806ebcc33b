"""Shared parts of all commands: exit codes, result files, atomic writes, safe terminal output."""
