"""How fast a robot responds, how much of a delay came from the network, and how long the run waits.

It waits for what hangs, and for a device that puts requests off because it is overloaded.
"""

import threading
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Final

from conformance.transport.exchange import TOO_MANY, UNAVAILABLE, Response

# Bytes per second of the slowest link: an exchange gets as much more time.
_SLOWEST_OCTETS_PER_S = 256 * 1024
# Bytes that may still be in buffers on both sides and between, after the suite handed them to the network.
_UNDER_WAY = 1024 * 1024
# A response is late if it takes twice the usual time plus this, s: TCP may have to repeat a segment.
_LATE_S = 0.1
#: An endpoint that let HANGS deadlines pass within _HANGS_WITHIN_S is not called until that time is over; the time
#: doubles with each further hang. Two failures far apart in a long run do not count.
HANGS: Final = 2
_HANGS_WITHIN_S: Final = 60.0
# After timeouts of _MOST_WAITED_S together, a request waits only for _HURRIED_S, or _SLOWER times the slowest response.
_MOST_WAITED_S: Final = 60.0
_HURRIED_S, _SLOWER = 2.0, 3.0
# Times that a request is sent that the device puts off: by 429, and by 503, which may be the state of a thing as well.
_TRIES: Final = {TOO_MANY: 6, UNAVAILABLE: 3}
# Wait before the second try if the response has no Retry-After; factor for each further try; longest wait, s.
_BACKOFF_S, _GROWTH, _LONGEST_BACKOFF_S = 0.02, 4, 3.0
_PUT_OFF_S = 10.0  # longest Retry-After that the suite waits for, s
_SHARED_S = 90.0  # longest wait for a limit that counts all requests, in all: many such limits last a minute, s
# So many responses 429 in a row, from so many endpoints, show a limit that counts all requests.
_IN_ROW, _ENDPOINTS = 12, 2


def time_for(octets: int) -> float:
    """Return how long a number of bytes may take on the network, s. Deadlines are extended by that."""
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
        """Return whether an endpoint is not called for now."""
        at = self._at.get(endpoint, ())
        within_s = _HANGS_WITHIN_S * float(1 << max(0, len(at) - HANGS))
        return sum(time.monotonic() - number < within_s for number in at) >= HANGS

    def within_s(self, seconds: float) -> float:
        """Return for how long a request with this deadline is waited for, s."""
        is_over = self._waited_s > _MOST_WAITED_S
        return min(seconds, max(_HURRIED_S, _SLOWER * self._slowest_s)) if is_over else seconds

    def note_answer(self, seconds: float) -> None:
        """Record how long an answer took, s."""
        self._slowest_s = max(self._slowest_s, seconds)

    def note_hang(self, endpoint: str, seconds: float) -> None:
        """Record that an endpoint did not answer within the whole deadline, s."""
        self._at[endpoint].append(time.monotonic())
        self._waited_s += seconds

    def forget(self) -> None:
        """Ask again those that did not answer."""
        self._at.clear()
        self.hurried.clear()


class Overload:
    """How long a run yet waits for a device that puts requests off by 429, or by 503 with Retry-After.

    Args:
        patience_s: for how long it waits in all, s.

    Attributes:
        reason: why the run waits no longer, although the device refuses all requests; or empty.
        ended: is called with this reason.
        is_off: whether nothing is waited for, as the device has shut the suite out.
    """

    def __init__(self, patience_s: float = 900.0) -> None:
        self.ended: Callable[[str], None] = lambda _reason: None
        self.reason, self.is_off = "", False
        self._left_s = patience_s
        # Endpoints that are not waited for; endpoints that 429 refused since the last other response, and
        # how long was waited meanwhile, s.
        self._given_up: set[str] = set()
        self._row: list[str] = []
        self._row_s = 0.0

    def waits(self, response: Response, endpoint: Callable[[], str], tries: int) -> bool:
        """Wait for as long as a response puts a request off; return whether to send it again.

        Args:
            response: the response of any request.
            endpoint: returns what the request is for, as Connection.endpoint_of.
            tries: times that the request was sent.
        """
        if response.put_off_s is None:
            self._row, self._row_s = [], 0.0
            if self._given_up and response.ok:
                self._given_up.discard(endpoint())
            return False
        if self.is_off:
            return False
        status, name = response.status, endpoint()
        self._row += [name] if status == TOO_MANY else []
        is_shared = len(self._row) >= _IN_ROW and len(set(self._row)) >= _ENDPOINTS
        wait_s = max(response.put_off_s, min(_LONGEST_BACKOFF_S, _BACKOFF_S * _GROWTH ** (tries - 1)))
        most_s = min(self._left_s, _SHARED_S - self._row_s if is_shared else _PUT_OFF_S)
        if wait_s > most_s or (not is_shared and (tries >= _TRIES[status] or name in self._given_up)):
            self._given_up.add(name)
            if is_shared:
                after = response.header("retry-after") or "missing"
                self.reason = (
                    f"The device limits the rate of requests: {len(self._row)} in a row were answered 429, the last "
                    f"one with Retry-After {after}. Later requests were not judged. Raise the device's limit, or send "
                    "fewer requests per second (`roaas certify --request-rate`)."
                )
                self.ended(self.reason)
            return False
        self._left_s -= wait_s
        self._row_s += wait_s
        time.sleep(wait_s)
        return True
