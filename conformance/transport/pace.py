"""How fast a robot answers, and how much of a wait was the network's and not the robot's."""

import threading

# A link that carries fewer octets a second is none; so much longer may an exchange take, octet by octet.
_SLOWEST_OCTETS_PER_S = 256 * 1024
# Of what has been handed to the network, so much may still be under way: buffers on both sides and between, octets.
_UNDER_WAY = 1024 * 1024
# An answer is late when it takes twice the usual time and this much more, s: a segment that was lost and sent again.
_LATE_S = 0.1


def time_for(octets: int) -> float:
    """How long so many octets may take on their way, s: for so much longer no answer is overdue."""
    return octets / _SLOWEST_OCTETS_PER_S


def time_to_arrive(octets: int) -> float:
    """How long the last of so many octets may take on their way, once all of them have been handed over, s."""
    return time_for(min(octets, _UNDER_WAY))


class Pace:
    """What is known of a robot's answers in time.

    Attributes:
        usual_s: how long an answer usually takes, s.
    """

    def __init__(self, usual_s: float = 0.001) -> None:
        self.usual_s = usual_s
        self._lateness_s = 0.0
        self._lock = threading.Lock()

    def is_late(self, seconds: float, octets: int = 0) -> bool:
        """Whether an exchange of so many octets took longer than one does here that nothing has held up."""
        return seconds > 2 * self.usual_s + _LATE_S + time_for(octets)

    def took(self, seconds: float, octets: int) -> None:
        """Take down how long an exchange took, answered or not."""
        if self.is_late(seconds, octets):
            with self._lock:
                self._lateness_s += seconds - self.usual_s

    @property
    def lateness_s(self) -> float:
        """By how much answers have been late so far, all together, s."""
        with self._lock:
            return self._lateness_s
