"""When a command started and ended, whatever happens to the machine's clock in between."""

import datetime as dt
import time


class Started:
    """A moment, and what the time is since then by a clock that is never set.

    Attributes:
        at: the moment in UTC.
    """

    def __init__(self) -> None:
        self.at, self._began = dt.datetime.now(dt.UTC), time.monotonic()

    @property
    def ended(self) -> dt.datetime:
        """What the time is now, if the clock was right at the start."""
        return self.at + dt.timedelta(seconds=time.monotonic() - self._began)
