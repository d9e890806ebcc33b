"""The process that measures: `python -m loadtests`.

Its standard input contains the name of the file into which it writes the result's path, and the settings as JSON.

The load test has its own process because importing Locust makes gevent replace the sockets, locks and sleeps of the
whole process: the command line, the reports and the tests keep the real ones.
"""

import signal
import sys
import traceback
from pathlib import Path

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.guard import make_streams_lenient


def main() -> int:
    """Run the settings on standard input; returns the exit code."""
    make_streams_lenient()
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C during the imports ends it without a traceback
    try:
        from loadtests.engine.run import carry_out  # noqa: PLC0415 -- it takes a second: Ctrl-C has to work meanwhile
        from loadtests.settings.settings import Settings  # noqa: PLC0415 -- as above

        _raise_file_limit()
        written, _, settings = sys.stdin.read().partition("\n")
        path = Path(written)
        result = carry_out(Settings.from_json(settings), lambda begun: path.write_text(str(begun), encoding="utf-8"))
        if result.file is None:
            path.unlink(missing_ok=True)
    except Exception:  # noqa: BLE001 -- exit code 1 would say that the robot broke a service level
        traceback.print_exc()
        return ExitCode.INCONCLUSIVE
    return result.exit_code


def _raise_file_limit() -> None:
    """Raise the limit on open files as far as the system allows, because each connection counts as an open file."""
    if sys.platform == "win32":
        return
    import resource  # noqa: PLC0415 -- there is none on Windows

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft < hard:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


if __name__ == "__main__":
    sys.exit(main())
