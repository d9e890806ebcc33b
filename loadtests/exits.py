"""Exit codes of `roaas load`, the same for all of RoAAS."""

MET = 0
MISSED = 1
USAGE = 2
UNREACHABLE = 3
INCONCLUSIVE = 4
INTERRUPTED = 130
