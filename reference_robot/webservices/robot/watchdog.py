"""Stops a robot whose client fell silent, for robots that do not do so by themselves (contract, class ``safety``)."""

import asyncio
from collections.abc import Callable


class VelocityWatchdog:
    """Calls ``stop`` when a velocity has been in force for ``hold`` seconds and was not renewed.

    It knows of the velocities that these web services sent, and of no others: nobody else's are ended by it. It costs
    one timer of the event loop while a velocity is in force, and nothing at other times.
    """

    def __init__(self, hold: float, stop: Callable[[], None]) -> None:
        self._hold = hold
        self._stop = stop
        self._ends_at = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def renew(self) -> None:
        """Note a velocity that was sent just now, on the event loop's thread."""
        loop = asyncio.get_running_loop()
        self._ends_at = loop.time() + self._hold
        if self._timer is None:  # or it looks again when it is due: cheaper than a new timer for each of 100 a second
            self._timer = loop.call_at(self._ends_at, self._look, loop)

    def release(self) -> None:
        """Note that there is nothing to stop any more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def close(self) -> None:
        """Stop the robot now, if a velocity is in force; also when the event loop has ended."""
        if self._timer is not None:
            self.release()
            self._stop()

    def _look(self, loop: asyncio.AbstractEventLoop) -> None:
        if loop.time() < self._ends_at:
            self._timer = loop.call_at(self._ends_at, self._look, loop)
            return
        self._timer = None
        self._stop()
