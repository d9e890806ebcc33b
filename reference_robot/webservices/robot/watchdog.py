"""A watchdog that stops a robot whose client has become silent, for robots without their own (class ``safety``)."""

import asyncio
from collections.abc import Callable


class VelocityWatchdog:
    """A timer that calls ``stop`` when a velocity has not been renewed for ``hold`` seconds.

    It only ends velocities from these web services, not those of other ROS nodes. It needs one event-loop timer while a
    velocity is in force.
    """

    def __init__(self, hold: float, stop: Callable[[], None]) -> None:
        self._hold = hold
        self._stop = stop
        self._ends_at = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def renew(self) -> None:
        """Restart the hold time, because a velocity was just sent; call on the event loop's thread."""
        loop = asyncio.get_running_loop()
        self._ends_at = loop.time() + self._hold
        if self._timer is None:  # a running timer checks `_ends_at` itself; cheaper than a new timer each time
            self._timer = loop.call_at(self._ends_at, self._look, loop)

    def release(self) -> None:
        """Cancel the timer, because no velocity is in force any more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def close(self) -> None:
        """Stop the robot now if a velocity is in force; works also after the event loop has ended."""
        if self._timer is not None:
            self.release()
            self._stop()

    def _look(self, loop: asyncio.AbstractEventLoop) -> None:
        if loop.time() < self._ends_at:
            self._timer = loop.call_at(self._ends_at, self._look, loop)
            return
        self._timer = None
        self._stop()
