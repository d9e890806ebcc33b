"""The end of a program that waits in its main thread: a signal, or another thread's word."""

import contextlib
import os
import signal


class Ending:
    """Waits for SIGINT, SIGTERM or ``bring``; make it in the main thread.

    A handler in Python runs when the main thread runs again, which an event that it waits for does not bring about; the
    octet that the interpreter writes for each signal, in whatever thread it arrives, does.
    """

    def __init__(self) -> None:
        self._told, self._tell = os.pipe()
        os.set_blocking(self._tell, False)
        signal.set_wakeup_fd(self._tell)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda _number, _frame: None)

    def wait(self) -> None:
        """Return when the end has come."""
        os.read(self._told, 1)

    def bring(self) -> None:
        """Bring the end about, from any thread."""
        with contextlib.suppress(BlockingIOError):  # the pipe is full: it has come
            os.write(self._tell, b"\0")
