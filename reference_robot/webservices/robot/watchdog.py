"""A watchdog that stops a robot whose client has become silent, for robots without their own (class ``safety``)."""

import asyncio
import time
from collections.abc import Callable
from typing import Final

_AGAIN_S: Final = 0.02  # after a stop that could not be sent
_AT_LAST: Final = 50  # attempts before this process ends


class VelocityWatchdog:
    """A timer that calls ``stop`` when a velocity has not been renewed for ``hold`` seconds, until it returns True.

    It only ends velocities from these web services, not those of other ROS nodes. It needs one event-loop timer while a
    velocity is in force.
    """

    def __init__(self, hold: float, stop: Callable[[], bool]) -> None:
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
            for _ in range(_AT_LAST):
                if self._stop():
                    return
                time.sleep(_AGAIN_S)

    def _look(self, loop: asyncio.AbstractEventLoop) -> None:
        if loop.time() < self._ends_at:
            self._timer = loop.call_at(self._ends_at, self._look, loop)
            return
        self._timer = None if self._stop() else loop.call_later(_AGAIN_S, self._look, loop)
