"""One deadline for a whole request and response, even if bytes arrive one at a time."""

import time

from conformance.transport.pace import time_for, time_to_arrive


class Deadline:
    """The deadline of a request that starts now.

    Args:
        seconds: time until the last byte of the response, s; each received byte extends it slightly.
        octets: size of the request body, bytes: the deadline is extended while the server still accepts it. A server
            that accepts no byte for ``seconds`` misses the deadline.
    """

    def __init__(self, seconds: float, octets: int = 0) -> None:
        self._seconds = seconds
        self._octets = octets
        self._at = time.monotonic() + seconds + time_for(octets)

    def left_s(self) -> float:
        """Return how long to wait for the response, s.

        Raises:
            TimeoutError: the deadline has passed.
        """
        left = self._at - time.monotonic()
        if left <= 0:
            raise TimeoutError("the deadline has passed")
        return left

    def to_send_s(self) -> float:
        """Return how long the server may accept no byte of the request, s.

        Raises:
            TimeoutError: the deadline has passed.
        """
        return min(self.left_s(), self._seconds)

    def sent(self) -> None:
        """Note that the whole request has been handed to the network."""
        self._at = min(self._at, time.monotonic() + self._seconds + time_to_arrive(self._octets))

    def came(self, octets: int) -> None:
        """Note that a number of bytes of the response was received."""
        self._at += time_for(octets)
