"""The room's commands: report, compare, diff, keygen, sign, verify and registry."""
