"""How fast a robot responds, how much of a delay came from the network, and how long the run waits for what hangs."""

import threading
import time
from collections import defaultdict
from typing import Final

# Octets a second of the slowest link: an exchange may take as much longer.
_SLOWEST_OCTETS_PER_S = 256 * 1024
# Octets that may still be under way after they were handed to the network: buffers on both sides and between.
_UNDER_WAY = 1024 * 1024
# A response is late if it takes twice the usual time and this much more, s: TCP may have to repeat a segment.
_LATE_S = 0.1
#: An endpoint that let this many deadlines pass within this time, s, is not called until the time is over, which
#: doubles with each further hang. A link that failed twice in a long run does not count.
HANGS: Final = 2
_HANGS_WITHIN_S: Final = 60.0
# After waiting for hangs for so long in all, s, the run waits less: so long, or so many times its slowest answer, s.
_MOST_WAITED_S: Final = 60.0
_HURRIED_S, _SLOWER = 2.0, 3.0


def time_for(octets: int) -> float:
    """Return how long a number of bytes may take on the network, s. Deadlines are extended by it."""
    return octets / _SLOWEST_OCTETS_PER_S


def time_to_arrive(octets: int) -> float:
    """Return how long the last of a number of bytes may take to arrive after all were handed to the network, s."""
    return time_for(min(octets, _UNDER_WAY))


class Pace:
    """The usual response time of a robot, and the sum of the delays beyond it.

    Attributes:
        usual_s: the usual response time, s.
    """

    def __init__(self, usual_s: float = 0.001) -> None:
        self.usual_s = usual_s
        self._lateness_s = 0.0
        self._lock = threading.Lock()

    def is_late(self, seconds: float, octets: int = 0) -> bool:
        """Return whether a response of this size took longer than an undisturbed one does."""
        return seconds > 2 * self.usual_s + _LATE_S + time_for(octets)

    def took(self, seconds: float, octets: int) -> None:
        """Record how long a request took, with or without a response."""
        if self.is_late(seconds, octets):
            with self._lock:
                self._lateness_s += seconds - self.usual_s

    @property
    def lateness_s(self) -> float:
        """The sum of all delays beyond the usual response time so far, s."""
        with self._lock:
            return self._lateness_s


class Hangs:
    """Which endpoints let deadlines pass, and how long a run yet waits for an answer: hangs shall not fill the run.

    Attributes:
        hurried: endpoints that did not answer when there was no time left to wait for the whole deadline.
    """

    def __init__(self) -> None:
        self.hurried: set[str] = set()
        self._at: defaultdict[str, list[float]] = defaultdict(list)
        self._waited_s = self._slowest_s = 0.0

    def __bool__(self) -> bool:
        return bool(self._at or self.hurried)

    def is_put_off(self, endpoint: str) -> bool:
        """Return whether an endpoint is not asked at present."""
        at = self._at.get(endpoint, ())
        within_s = _HANGS_WITHIN_S * float(1 << max(0, len(at) - HANGS))
        return sum(time.monotonic() - one < within_s for one in at) >= HANGS

    def within_s(self, seconds: float) -> float:
        """Return for how long a request with this deadline is waited for, s."""
        is_over = self._waited_s > _MOST_WAITED_S
        return min(seconds, max(_HURRIED_S, _SLOWER * self._slowest_s)) if is_over else seconds

    def answered(self, seconds: float) -> None:
        """Record how long an answer took, s."""
        self._slowest_s = max(self._slowest_s, seconds)

    def hung(self, endpoint: str, seconds: float) -> None:
        """Record that an endpoint did not answer within the whole deadline, s."""
        self._at[endpoint].append(time.monotonic())
        self._waited_s += seconds

    def forget(self) -> None:
        """Ask again those that did not answer."""
        self._at.clear()
        self.hurried.clear()
