"""End a process in order on a signal, or when the process that started it has ended.

Each of them raises KeyboardInterrupt in the main thread, so that what stops a robot and writes a result after Ctrl-C
does so after all of them.
"""

import datetime as dt
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final

#: Environment variable with the id of the process with which the command has to end.
PARENT_VARIABLE: Final = "ROAAS_PARENT"
#: Interval at which the command checks whether that process still runs, s.
_OFTEN_S: Final = 0.2
_ALWAYS: Final = ("SIGINT", "SIGTERM")
# Signals that end the process by default. Those of a crash, such as SIGSEGV, and of profilers are left alone.
_USUALLY: Final = ("SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGXCPU", "SIGPWR", "SIGBREAK")
_parent_ended = threading.Event()


def ending_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end this process, without those that it ignores, as ``nohup`` makes it ignore SIGHUP."""
    usual = (signal.Signals[name] for name in _USUALLY if name in signal.Signals.__members__)
    always = (signal.Signals[name] for name in _ALWAYS)
    return (*always, *(number for number in usual if signal.getsignal(number) not in {signal.SIG_IGN, None}))


def end_like_ctrl_c() -> None:
    """Make every signal that ends the process raise KeyboardInterrupt."""
    for number in ending_signals():
        signal.signal(number, signal.default_int_handler)


@contextmanager
def ignore_signals() -> Iterator[None]:
    """Ignore signals during a block of bounded time, in which the robot is being stopped."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, lambda _number, _frame: None) for number in ending_signals()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def end_with_parent() -> None:
    """Send this process SIGTERM when its parent process ends; call it in the main thread.

    A process that ``nohup`` started outlives its parent, unless the environment names the parent.
    """
    named = os.environ.pop(PARENT_VARIABLE, "")
    if sys.platform == "win32" or (not named and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN):
        return
    parent, main = int(named) if named.isdecimal() else os.getppid(), threading.main_thread().ident

    def follow() -> None:
        while os.getppid() == parent:
            _parent_ended.wait(_OFTEN_S)
        _parent_ended.set()
        # Send it to the main thread, so that its system call returns at once.
        signal.pthread_kill(main or 0, signal.SIGTERM)

    threading.Thread(target=follow, name="follows the parent", daemon=True).start()


def as_parent(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of a command that ends when this process does."""
    return {**environment, PARENT_VARIABLE: str(os.getpid())}


def ended_by(number: int) -> str:
    """Return the name of the signal or event that ended the process, for a sentence."""
    return "the end of its parent process" if _parent_ended.is_set() else signal.Signals(number).name


class Started:
    """A moment, and the time since then by a clock that is never set.

    Attributes:
        at: the moment in UTC.
    """

    def __init__(self) -> None:
        self.at, self._began = dt.datetime.now(dt.UTC), time.monotonic()

    @property
    def now(self) -> dt.datetime:
        """Return the present time, if the clock was right at the start."""
        return self.at + dt.timedelta(seconds=time.monotonic() - self._began)
