"""Carry out one run and write its result, also where the run fails or the process is killed."""

import logging
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import gevent
import locust  # patches the standard library, which has to come before our modules that use it

from conformance.commandline.endings import ending_signals
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.result_command import CommandResult
from loadtests.engine.run import Run
from loadtests.engine.watching import follow_parent
from loadtests.result.document import compose
from loadtests.result.files import write
from loadtests.result.outcome import RunAborted
from loadtests.result.terminal import summary
from loadtests.settings.settings import Settings


def _begin(run: Run) -> Path | None:
    """Write a result that remains if this process is killed; return its path, or None if it cannot be written."""
    unfinished = RunAborted(ExitCode.INCONCLUSIVE, "the run has not ended: it is under way, or it was killed")
    _, document = compose(run.outcome, run.plan, unfinished)
    with suppress(OSError):  # told in the end
        return write(Path(run.settings.output.folder), document | {"interrupted": True})
    return None


def _complain(run: Run, message: str) -> None:
    """Say what went wrong, also where progress is not wanted."""
    run.progress.end()
    sys.stderr.write(f"roaas load: {message}\n")
    sys.stderr.flush()


def carry_out(settings: Settings, begun: Callable[[Path], object] = lambda _: None) -> CommandResult:
    """Carry out a run and write its result; `begun` gets the path of the result that is there before the run ends."""
    logging.getLogger(locust.__name__).setLevel(logging.ERROR)  # it warns of fast spawning, which we want
    run = Run(settings)
    for number in ending_signals():
        gevent.signal_handler(number, run.interrupt)
    gevent.spawn(follow_parent, run.interrupt)
    aborted: RunAborted | None = None
    early: Path | None = None
    try:
        run.resolve()
        if (early := _begin(run)) is not None:
            begun(early)
        run.check()
        run.measure()
    except RunAborted as reason:
        aborted = reason
        _complain(run, str(aborted))
    except Exception as trouble:  # noqa: BLE001 -- our own fault: what was measured is kept, and called invalid
        traceback.print_exc()
        aborted = RunAborted(ExitCode.INCONCLUSIVE, f"the load generator failed: {type(trouble).__name__}: {trouble}")
    run.progress.end()
    run.name_called()
    code, document = compose(run.outcome, run.plan, aborted)
    path, folder = None, Path(settings.output.folder)
    if aborted is not None and aborted.code == ExitCode.USAGE:
        if early is not None:
            early.unlink()
    else:
        try:
            run.progress.say(f"written: {(path := write(folder, document))}")
        except OSError as error:  # what was measured is printed below
            code = ExitCode.INCONCLUSIVE
            _complain(run, f"{folder}: cannot write there: {error.strerror or error}")
    if aborted is None:
        sys.stdout.write(summary(document))
        sys.stdout.flush()
    return CommandResult(code, path)
