"""Define the command-line commands for reports: report, compare, diff, keygen, sign, verify and registry."""
