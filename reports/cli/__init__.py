"""The room's commands: report and compare, keygen, sign and verify."""
