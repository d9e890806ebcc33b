"""The exit codes of all commands (docs/cli.md)."""

from enum import IntEnum
from typing import Final


class ExitCode(IntEnum):
    """The exit code of a command."""

    PASSED = 0  # conformant; service levels kept
    FAILED = 1  # not conformant; a service level broken
    USAGE = 2  # wrong usage, or input that cannot be read
    UNREACHABLE = 3  # the robot cannot be reached
    INCONCLUSIVE = 4  # nothing was executed, a claimed class could not be judged, a measurement is not valid
    INTERRUPTED = 130


#: Exit code for each verdict of a result.
OF_VERDICT: Final = {
    "conformant": ExitCode.PASSED,
    "not-conformant": ExitCode.FAILED,
    "inconclusive": ExitCode.INCONCLUSIVE,
}
