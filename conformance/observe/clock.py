"""The clock for observing a device: real in a run, simulated in tests."""

import time
from typing import Final, Protocol


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


class SimulatedClock:
    """A clock whose time advances only by sleep().

    Attributes:
        time_s: the time, s.
    """

    def __init__(self, time_s: float = 100.0) -> None:
        self.time_s = time_s

    def now(self) -> float:
        """Return the time, s."""
        return self.time_s

    def sleep(self, seconds: float) -> None:
        """Advance the time."""
        self.time_s += max(0.0, seconds)
