"""A clock that rings at an absolute time, inside gevent's loop.

On Linux it is a timerfd on CLOCK_MONOTONIC, watched by the loop like a socket. A process that has slept for
milliseconds wakes up some 0.1 ms late, because its processor has slept too. So the timer goes off a little early, and
the loop spins until the time has come: that takes at most an eighth of a processor and is exact to a few microseconds.
Sockets are served all the while: a response never waits for the next request.

gevent.sleep wakes on libev's millisecond grid, which would hide a service time of 0.1 ms. Where there is no timerfd the
loop's own timer is used, and the result says so.
"""

import ctypes
import os
import sys
import time
from collections.abc import Callable
from typing import Any, Protocol

from gevent.hub import get_hub

_SECOND_NS = 1_000_000_000
_READ = 1  # libev's EV_READ
_CLOCK_MONOTONIC = 1  # linux/time.h
_TFD_TIMER_ABSTIME = 1  # linux/timerfd.h
#: How long before its time the loop stays awake, at most, and as a part of what is left until then.
_EARLY_NS = 250_000
_EARLY_PART = 8
_TFD_FLAGS = os.O_NONBLOCK | os.O_CLOEXEC if hasattr(os, "O_CLOEXEC") else 0  # TFD_NONBLOCK | TFD_CLOEXEC


class Alarm(Protocol):
    """Calls a function in gevent's hub at a given time; setting it again replaces the earlier time."""

    name: str

    def set(self, at_ns: int) -> None:
        """Ring at `at_ns` (time.monotonic_ns); a time gone by rings at once."""

    def close(self) -> None:
        """Cancel the alarm."""


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class _Itimerspec(ctypes.Structure):
    _fields_ = (("interval", _Timespec), ("value", _Timespec))


class TimerfdAlarm:
    """timerfd_create(2), by ctypes: Python has os.timerfd_create only from 3.13 on."""

    name = "timerfd"

    def __init__(self, ring: Callable[[], None]) -> None:
        self._ring = ring
        self._at = 0
        self._may_stay_awake = len(os.sched_getaffinity(0)) > 1  # on one processor it would keep the robot waiting
        libc = ctypes.CDLL(None, use_errno=True)
        self._settime = libc.timerfd_settime
        self._fd: int = libc.timerfd_create(_CLOCK_MONOTONIC, _TFD_FLAGS)
        if self._fd < 0:
            raise OSError(ctypes.get_errno(), "timerfd_create failed")
        self._spec = _Itimerspec()
        self._pointer = ctypes.byref(self._spec)
        loop = get_hub().loop
        self._watcher: Any = loop.io(self._fd, _READ)
        self._watcher.start(self._readable)
        self._awake: Any = loop.idle()  # while it is started the loop does not sleep

    def _readable(self) -> None:
        try:
            os.read(self._fd, 8)  # the number of expirations: reading it is what silences the descriptor
        except BlockingIOError:  # set again since the loop saw it ring
            return
        if time.monotonic_ns() < self._at:
            self._awake.start(self._look)
        else:
            self._ring()

    def _look(self) -> None:
        if time.monotonic_ns() >= self._at:
            self._awake.stop()
            self._ring()

    def set(self, at_ns: int) -> None:
        """Ring at `at_ns`; 0 would disarm (timerfd_settime(2)), so the earliest is 1."""
        self._awake.stop()
        self._at = at_ns
        left = at_ns - time.monotonic_ns()
        early = min(_EARLY_NS, max(left, 0) // _EARLY_PART) if self._may_stay_awake else 0
        seconds, nanoseconds = divmod(max(at_ns - early, 1), _SECOND_NS)
        self._spec.value.seconds = seconds
        self._spec.value.nanoseconds = nanoseconds
        if self._settime(self._fd, _TFD_TIMER_ABSTIME, self._pointer, None) != 0:
            raise OSError(ctypes.get_errno(), "timerfd_settime failed")

    def close(self) -> None:
        """Cancel the alarm."""
        if self._fd >= 0:
            self._awake.stop()
            self._awake.close()
            self._watcher.stop()
            self._watcher.close()
            os.close(self._fd)
            self._fd = -1


class LoopAlarm:
    """The event loop's timer, on its millisecond grid."""

    name = "gevent.sleep"

    def __init__(self, ring: Callable[[], None]) -> None:
        self._ring = ring
        self._timer: Any = None

    def set(self, at_ns: int) -> None:
        """Ring at `at_ns` or up to a millisecond later."""
        self.close()
        loop = get_hub().loop
        self._timer = loop.timer(max(0.0, (at_ns - time.monotonic_ns()) / _SECOND_NS))
        self._timer.start(self._ring, update=True)

    def close(self) -> None:
        """Cancel the alarm."""
        if self._timer is not None:
            self._timer.stop()
            self._timer.close()
            self._timer = None


def make_alarm(ring: Callable[[], None]) -> Alarm:
    """Return the best alarm of this system."""
    return TimerfdAlarm(ring) if sys.platform == "linux" else LoopAlarm(ring)
