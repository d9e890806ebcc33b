"""Detection of a robot that gets no nearer to its goal."""

import math
from typing import Final

PATIENCE_S: Final = 20.0  # without getting 0.05 m nearer, in simulated time
_NEARER_M: Final = 0.05
# A control step follows each odometry message, 50 times a second. A longer interval means that the processes were
# delayed, which must not count as a lack of progress.
_STEP_S: Final = 0.1


class Progress:
    """The remaining distance to a goal, followed over time.

    Args:
        now: When the goal was accepted, by any clock in seconds.
        time_scale: Simulated seconds per second of that clock.
    """

    def __init__(self, now: float, time_scale: float) -> None:
        self._time_scale = time_scale
        self._stepped = now
        self._nearest = math.inf
        self._waited_s = 0.0

    def is_lacking(self, remaining: float, now: float) -> bool:
        """Record the remaining distance in metres; return whether it has not decreased for 20 simulated seconds."""
        self._waited_s += min(now - self._stepped, _STEP_S) * self._time_scale
        self._stepped = now
        if remaining < self._nearest - _NEARER_M:
            self._nearest, self._waited_s = remaining, 0.0
        return self._waited_s > PATIENCE_S
