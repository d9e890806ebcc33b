"""Waiting for the end of a program: a signal such as SIGINT, SIGTERM or SIGHUP, or a call from another thread."""

import contextlib
import os
import signal

from conformance.commandline.endings import ending_signals


class Ending:
    """A one-time event that a signal such as SIGINT or a call of ``trigger`` sets off. Create it in the main thread.

    Python runs signal handlers only when the main thread executes Python code, so a thread that blocks on an event
    would not wake up. The interpreter also writes a byte to a pipe for each signal, whichever thread receives the
    signal. The main thread waits for that byte.
    """

    def __init__(self) -> None:
        self._read_end, self._write_end = os.pipe()
        os.set_blocking(self._write_end, False)
        signal.set_wakeup_fd(self._write_end)
        for number in ending_signals():
            signal.signal(number, lambda _number, _frame: None)

    def wait(self) -> None:
        """Block until a signal that ends the process, or a call of ``trigger``."""
        os.read(self._read_end, 1)

    def trigger(self) -> None:
        """Make ``wait`` return; may be called from any thread."""
        with contextlib.suppress(BlockingIOError):  # the pipe is full, so `wait` returns anyway
            os.write(self._write_end, b"\0")
