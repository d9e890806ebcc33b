"""One deadline for a whole exchange, however slowly its octets drip."""

import time

from conformance.transport.pace import time_for, time_to_arrive


class Deadline:
    """The moment at which an exchange ends that begins now.

    Args:
        seconds: until its last octet, and more for each that comes.
        octets: of content that go out: more time as long as they do. When they have gone, or none does for so many
            seconds, there is nothing to give more time for.
    """

    def __init__(self, seconds: float, octets: int = 0) -> None:
        self._seconds = seconds
        self._octets = octets
        self._at = time.monotonic() + seconds + time_for(octets)

    def left_s(self) -> float:
        """How long a wait for the answer may take, s.

        Raises:
            TimeoutError: no longer.
        """
        left = self._at - time.monotonic()
        if left <= 0:
            raise TimeoutError("the deadline has passed")
        return left

    def to_send_s(self) -> float:
        """How long the server may take nothing of the request, s.

        Raises:
            TimeoutError: no longer.
        """
        return min(self.left_s(), self._seconds)

    def sent(self) -> None:
        """All of the request has been handed to the network."""
        self._at = min(self._at, time.monotonic() + self._seconds + time_to_arrive(self._octets))

    def came(self, octets: int) -> None:
        """So many octets of the answer have come."""
        self._at += time_for(octets)
