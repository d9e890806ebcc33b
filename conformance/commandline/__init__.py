"""What all commands share: exit codes, the result file they leave, atomic writes, safe terminal output."""
