"""The one way to look at something again and again until it is over."""

from collections.abc import Callable, Iterator

from conformance.observe.clock import WALL_CLOCK, Clock
from conformance.transport.pace import Pace

# A device that is always late does not get all the time in the world, s.
_MOST_GIVEN_BACK_S = 5.0


class Patience:
    """A wait for something that a device has a time for. Delays of its responses do not count.

    Args:
        pace: of the device's responses.
        seconds: how long the device has, from now on.
        clock: by which that is counted.
    """

    def __init__(self, pace: Pace, seconds: float, clock: Clock = WALL_CLOCK) -> None:
        self._pace, self._clock = pace, clock
        self._until = clock.now() + seconds
        self._lateness_s = pace.lateness_s

    @property
    def over(self) -> bool:
        """Whether the device has had its time."""
        given_back = min(self._pace.lateness_s - self._lateness_s, _MOST_GIVEN_BACK_S)
        return self._clock.now() > self._until + given_back


def poll(clock: Clock, every_s: float, is_over: Callable[[], bool]) -> Iterator[None]:
    """Yield at once, and then every so often, until it is over; the last time after that.

    Args:
        clock: by which turns begin.
        every_s: from the beginning of one turn to the beginning of the next, s; a turn that takes longer delays it.
        is_over: called before each turn. The turn after a true value is the last one, so that what happened while
            the caller was held up is still seen.
    """
    while True:
        begun = clock.now()
        last = is_over()
        yield
        if last:
            return
        clock.sleep(begun + every_s - clock.now())


def poll_for(clock: Clock, every_s: float, seconds: float) -> Iterator[None]:
    """Yield at once, and then every so often, for so many seconds; the last time when they have passed."""
    until = clock.now() + seconds
    return poll(clock, every_s, lambda: clock.now() >= until)
