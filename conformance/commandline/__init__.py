"""What all commands share: exit codes, result files, atomic writes, safe terminal output."""
