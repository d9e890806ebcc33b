"""The clock for observing a device."""

import time
from collections.abc import Callable, Iterator
from typing import Final, Protocol

from conformance.transport.pace import Pace


class Clock(Protocol):
    """A monotonic clock that can sleep."""

    def now(self) -> float:
        """Return the time, s since an arbitrary start."""

    def sleep(self, seconds: float) -> None:
        """Wait; a negative time does not wait."""


class _WallClock:
    """The system's monotonic clock."""

    def now(self) -> float:
        """Return the time, s since an arbitrary start."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait; a negative time does not wait."""
        time.sleep(max(0.0, seconds))


#: The clock of every run.
WALL_CLOCK: Final[Clock] = _WallClock()


# Most time that a device that is always late gets back, s.
_MOST_GIVEN_BACK_S = 5.0


class Patience:
    """A time limit for a device that does not count delays of its responses.

    Args:
        pace: response times of the device.
        seconds: time that the device has from now on, s.
        clock: measures it.
    """

    def __init__(self, pace: Pace, seconds: float, clock: Clock = WALL_CLOCK) -> None:
        self._pace, self._clock = pace, clock
        self._until = clock.now() + seconds
        self._lateness_s = pace.lateness_s

    @property
    def over(self) -> bool:
        """Whether the device has had its time."""
        given_back = min(self._pace.lateness_s - self._lateness_s, _MOST_GIVEN_BACK_S)
        return self._clock.now() > self._until + given_back


def poll(clock: Clock, every_s: float, is_over: Callable[[], bool]) -> Iterator[None]:
    """Yield at once and then every ``every_s`` until ``is_over()``, and once more after that.

    Args:
        clock: the clock.
        every_s: interval from the start of one turn to the start of the next, s; a longer turn delays the next.
        is_over: called before each turn. One last turn follows a true value, to observe what happened during a delay of
            the caller.
    """
    while True:
        begun = clock.now()
        last = is_over()
        yield
        if last:
            return
        clock.sleep(begun + every_s - clock.now())


def poll_for(clock: Clock, every_s: float, seconds: float) -> Iterator[None]:
    """Yield at once and then every ``every_s`` for ``seconds``, and once more at the end."""
    until = clock.now() + seconds
    return poll(clock, every_s, lambda: clock.now() >= until)
