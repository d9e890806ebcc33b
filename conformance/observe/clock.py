"""The clock by which a device is watched: real in a run, simulated in tests."""

import time
from typing import Final, Protocol


class Clock(Protocol):
    """Tells the time, and waits."""

    def now(self) -> float:
        """Return the time, s since some moment; it never goes back."""

    def sleep(self, seconds: float) -> None:
        """Wait; a negative time is no wait."""


class _WallClock:
    """The system's monotonic clock."""

    def now(self) -> float:
        """Return the time, s since some moment."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait; a negative time is no wait."""
        time.sleep(max(0.0, seconds))


#: The clock of every run.
WALL_CLOCK: Final[Clock] = _WallClock()


class SimulatedClock:
    """A clock that goes only when somebody waits by it.

    Attributes:
        time_s: the time, s.
    """

    def __init__(self, time_s: float = 100.0) -> None:
        self.time_s = time_s

    def now(self) -> float:
        """Return the time, s."""
        return self.time_s

    def sleep(self, seconds: float) -> None:
        """Let the time pass."""
        self.time_s += max(0.0, seconds)
