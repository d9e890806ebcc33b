"""How fast a robot responds, and how much of a delay came from the network instead of the robot."""

import threading

# Octets a second of the slowest link: an exchange may take as much longer.
_SLOWEST_OCTETS_PER_S = 256 * 1024
# Octets that may still be under way after they were handed to the network: buffers on both sides and between.
_UNDER_WAY = 1024 * 1024
# A response is late if it takes twice the usual time and this much more, s: TCP may have to repeat a segment.
_LATE_S = 0.1


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
