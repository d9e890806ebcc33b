"""What the robot's clock may differ by from ours, as far as its HTTP responses show.

A response was made after we sent the request and before we received it (Cristian, Distributed Computing 3, 1989). So a
time that the robot tells while it makes a response bounds the offset from both sides, and the bounds of many responses
together are narrower than those of each. `Date` is such a time, of whole seconds. A stamp of data bounds it from one
side: data is never from the future.
"""

import math
from dataclasses import dataclass
from email.utils import parsedate_to_datetime

from loadtests.measuring.stamps import Stamp
from loadtests.statistics.clock_offset import Offset

#: `Date` has whole seconds, and is "at any time during message origination" (RFC 9110 section 6.6.1): servers that
#: write it beforehand, such as uvicorn, keep it for a second.
_DATE_S = 1.0
_KEPT_S = 1.0


@dataclass
class RobotClock:
    """The bounds that responses have shown so far; all moments are Unix time by our clock."""

    low_s: float = -math.inf
    high_s: float = math.inf

    def data(self, stamp: Stamp, received_s: float) -> None:
        """Take the stamp of data."""
        self.low_s = max(self.low_s, stamp.seconds - stamp.digit_s - received_s)

    def told(self, stamp: Stamp, sent_s: float, received_s: float) -> None:
        """Take the time at which the robot made a response, as the response tells it."""
        self.data(stamp, received_s)
        self.high_s = min(self.high_s, stamp.seconds + stamp.digit_s - sent_s)

    def dated(self, date: bytes | None, sent_s: float, received_s: float) -> None:
        """Take a response's `Date`, if it has one."""
        try:
            seconds = parsedate_to_datetime((date or b"").decode("latin-1")).timestamp()
        except ValueError:
            return
        self.low_s = max(self.low_s, seconds - received_s)
        self.high_s = min(self.high_s, seconds + _DATE_S + _KEPT_S - sent_s)

    @property
    def offset(self) -> Offset | None:
        """Return the offset; None where it is not known, or where its bounds contradict one another."""
        known = math.isfinite(self.low_s) and math.isfinite(self.high_s) and self.low_s <= self.high_s
        return Offset(self.low_s, self.high_s) if known else None
