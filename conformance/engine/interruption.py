"""Record Ctrl-C and SIGTERM during a run, so that no interrupted run looks complete.

Python raises KeyboardInterrupt wherever the main thread happens to be. In a finalizer or a callback whose exceptions
are ignored, the exception is lost; the recorded flag is not. It is checked before each check and at the end.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from conformance.verdict.run import Run

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def remembered(run: Run) -> Iterator[None]:
    """Set ``run.interrupted`` on a signal and raise KeyboardInterrupt as usual.

    Outside the main thread, where no signal arrives, this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(_signal: int, _frame: FrameType | None) -> None:
        run.interrupted = True
        raise KeyboardInterrupt

    before = {number: signal.signal(number, interrupt) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
