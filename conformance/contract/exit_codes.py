"""Exit codes of the suite's commands."""

EXIT_CODES = {"conformant": 0, "not-conformant": 1, "inconclusive": 4}
USAGE = 2
UNREACHABLE = 3
INTERRUPTED = 130
