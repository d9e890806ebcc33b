"""Record signals that end a run, so that an interrupted run never looks complete and the robot is stopped.

Python raises KeyboardInterrupt wherever the main thread happens to be. In a finalizer or a callback whose exceptions
are ignored, the exception is lost; the recorded flag is not. It is checked before each check and at the end.
"""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

from conformance.commandline.endings import ended_by, ending_signals
from conformance.verdict.run import Run

# For this time after KeyboardInterrupt, s, further signals are only recorded, because the checks are ending.
_LEAVES_S: Final = 2.0


class Interruption:
    """The signals of one run.

    Args:
        run: its ``interrupted`` and ``ended_by`` are set.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._raised_at: float | None = None
        self._is_closing = False

    def only_record(self) -> None:
        """Raise nothing from now on: the robot is stopped and the result is written, which takes a bounded time."""
        self._is_closing = True

    def handle(self, number: int, _frame: FrameType | None) -> None:
        """Record a signal, and raise KeyboardInterrupt."""
        self._run.interrupted = True
        self._run.ended_by = self._run.ended_by or ended_by(number)
        now = time.monotonic()
        if self._is_closing or (self._raised_at is not None and now - self._raised_at < _LEAVES_S):
            return
        self._raised_at = now
        raise KeyboardInterrupt


@contextmanager
def note_signals(run: Run) -> Iterator[Interruption]:
    """Set ``run.interrupted`` on a signal and raise KeyboardInterrupt as usual.

    Ctrl-Z does not suspend a run that may move the robot: nothing would watch the robot then. Outside the main thread,
    where no signal arrives, this does nothing.
    """
    interruption = Interruption(run)
    if threading.current_thread() is not threading.main_thread():
        yield interruption
        return
    before = {number: signal.signal(number, interruption.handle) for number in ending_signals()}
    if (run.allow_motion or run.statement.calls.allow) and hasattr(signal, "SIGTSTP"):
        before[signal.SIGTSTP] = signal.signal(signal.SIGTSTP, lambda _number, _frame: None)
    try:
        yield interruption
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
