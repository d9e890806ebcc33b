"""Starts requests at their times.

The pacer runs in gevent's hub, woken by an alarm. In the open model it hands each due arrival to a waiting user. When
no user is free the arrival waits for the next one, while its response time runs on; once its deadline has passed it is
dropped and counted. In the closed model the pacer only opens and closes the gate of each segment: every user takes its
next request as soon as it has finished the last.

On Linux the alarm is a timerfd on CLOCK_MONOTONIC, watched by the loop like a socket. A process that has slept for
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
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import gevent
from gevent.event import Event
from gevent.hub import Waiter, get_hub

from loadtests.clients.wire import now_ns
from loadtests.schedule.arrivals import Schedule

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


class Arrival(NamedTuple):
    """One request to send: its segment, operation and payload, and when it is due (monotonic ns).

    `noticed_ns`: when the pacer saw that no user was free for it; 0: one was free. What it waits from then on is the
    robot's doing, what it waited before is the generator's.
    """

    segment: int
    operation: int
    payload: int
    due_ns: int
    noticed_ns: int = 0


class Pacer:
    """The gate that users take their requests from.

    Args:
        timeout_ns: an arrival older than this is dropped.
        on_segment: called in the quiet gap before each segment, with its index.
        on_drop: called with an arrival that no user could start.
    """

    def __init__(self, timeout_ns: int, on_segment: Callable[[int], None], on_drop: Callable[[Arrival], None]) -> None:
        self.open_model = True
        self.interval_ns = 0
        self.timeout_ns = timeout_ns
        self.on_segment = on_segment
        self.on_drop = on_drop
        self.done = Event()
        self._schedule: Schedule | None = None
        self._origin = 0
        self._free_at = 0
        self._segment = -1
        self._closes = 0
        self._due: Sequence[tuple[int, int, int]] = ()
        self._position = 0
        self._turn = 0
        self._idle: list[Waiter] = []  # a stack: the connection used last is the warmest
        self._backlog: deque[Arrival] = deque()
        self._alarm = make_alarm(self._ring)
        self.pacing = self._alarm.name

    @property
    def waiting(self) -> int:
        """Return how many users are ready to take a request."""
        return len(self._idle)

    def start(self, schedule: Schedule, origin_ns: int, *, open_model: bool, interval_ns: int = 0) -> None:
        """Begin a schedule with offsets from `origin_ns` (monotonic); the earlier schedule must be over.

        In the closed model `interval_ns` is the least time between two starts: a ceiling on the rate.
        """
        self._schedule, self._origin = schedule, origin_ns
        self.open_model, self.interval_ns = open_model, interval_ns
        self._segment, self._closes, self._free_at = -1, 0, 0
        self.done.clear()
        self._next_segment()

    def stop(self) -> None:
        """End the schedule now; users that wait for a request keep waiting until their runner ends them."""
        self._schedule = None
        self._closes = 0
        self.done.set()

    def give_up(self) -> None:
        """Drop the arrivals that no user has started."""
        while self._backlog:
            self.on_drop(self._backlog.popleft())

    def close(self) -> None:
        """Stop for good."""
        self.stop()
        self._backlog.clear()
        self._alarm.close()

    def take(self) -> Arrival:
        """Wait for the next request to send. Called by a user."""
        if self.open_model:
            while self._backlog:
                late = self._backlog.popleft()
                if now_ns() - late.due_ns < self.timeout_ns:
                    return late
                self.on_drop(late)
        else:
            now = now_ns()
            if self.interval_ns and now < self._closes:
                now = self._wait_turn(now)
            if self._schedule is not None and now < self._closes:
                return self._in_turn(self._schedule, now)
        waiter = Waiter()
        self._idle.append(waiter)
        try:
            arrival: Arrival = waiter.get()
        except BaseException:
            if waiter in self._idle:
                self._idle.remove(waiter)
            raise
        return arrival

    def _wait_turn(self, now: int) -> int:
        """Keep the closed model below its ceiling; returns the time at which the caller may continue."""
        mine = max(self._free_at, now)
        self._free_at = mine + self.interval_ns
        if mine > now:
            gevent.sleep((mine - now) / 1e9)
        return now_ns()

    def _in_turn(self, schedule: Schedule, now: int) -> Arrival:
        """Return the closed model's next request: operations and payloads in rotation."""
        operations = schedule.operations(self._segment)
        self._turn += 1
        return Arrival(self._segment, operations[self._turn % len(operations)], self._turn // len(operations), now)

    def _next_segment(self) -> None:
        schedule = self._schedule
        self._segment += 1
        if schedule is None or self._segment >= schedule.count():
            self.stop()
            return
        self._due = schedule.arrivals(self._segment) if self.open_model else ()
        self._position = 0
        self.on_segment(self._segment)
        self._arm(schedule)

    def _arm(self, schedule: Schedule) -> None:
        """Set the alarm to the next event: an arrival, or the end of the segment."""
        if self._position < len(self._due):
            at = self._due[self._position][0]
        elif not self.open_model and self._closes == 0:
            at = schedule.plan.segments[self._segment].opens_ns
        else:
            at = schedule.plan.segments[self._segment].end_ns
        self._alarm.set(self._origin + at)

    def _ring(self) -> None:
        schedule = self._schedule
        if schedule is None:
            return
        if self.open_model:
            self._hand_out(schedule)
        else:
            self._open_gate(schedule)

    def _hand_out(self, schedule: Schedule) -> None:
        due, origin, idle = self._due, self._origin, self._idle
        count = len(due)
        if self._position >= count:
            self._next_segment()
            return
        while self._position < count:
            offset, operation, payload = due[self._position]
            at = origin + offset
            if at > (now := now_ns()):
                break
            self._position += 1
            if idle:
                idle.pop().switch(Arrival(self._segment, operation, payload, at))
            else:
                self._backlog.append(Arrival(self._segment, operation, payload, at, now))
        self._arm(schedule)

    def _open_gate(self, schedule: Schedule) -> None:
        """Begin a segment of the closed model, in which users send whenever they are free, or end the segment."""
        if self._closes:
            self._closes = 0
            self._next_segment()
            return
        self._closes = self._origin + schedule.plan.segments[self._segment].end_ns
        wanted = schedule.users()
        waiting, self._idle = self._idle[:wanted], self._idle[wanted:]
        for waiter in waiting:
            now = now_ns()
            if now < self._closes:
                waiter.switch(self._in_turn(schedule, now))
            else:  # this process was delayed until the segment was over: a request now would not belong to it
                self._idle.append(waiter)
        self._arm(schedule)
