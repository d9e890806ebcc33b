"""Measure how fast a robot's clock runs, by comparing its odometry stamps with the local clock."""

from email.utils import parsedate_to_datetime
from statistics import median
from typing import Final

from conformance.measures.samples import slope

# Readings this far apart show the clock's rate, s: over 3 s, two late responses can make a right clock seem 10 % wrong.
SPAN_S: Final = 5.0
# One reading per _EVERY_S is kept, at most _MOST; when there are more, every other one is dropped.
_EVERY_S: Final = 0.1
_MOST: Final = 80
_SHARE: Final = 0.05  # error that the clock's rate may have
_OLDER_S: Final = 0.05  # a stamp may be this much older than usual when it is read, s
# Fractions of a second are judged by _FINE readings, two of which are _NEAR_S apart, s.
_FINE: Final = 60
_NEAR_S: Final = (0.2, 0.45)
_ENOUGH: Final = 10
_HARDLY: Final = 0.1


class Clock:
    """The odometry stamps of a whole run, each with the local time at which it was read."""

    def __init__(self) -> None:
        self._readings: list[tuple[float, float]] = []
        self._every = _EVERY_S
        self._first: list[tuple[float, float]] = []
        self._ahead: list[float] = []

    def add(self, stamp: float, date: str) -> None:
        """Add a response's stamp, s, and its ``Date`` field; one that is no date does not count."""
        try:
            self._ahead = [*self._ahead[-_MOST:], stamp - parsedate_to_datetime(date).timestamp()]
        except ValueError:
            return

    @property
    def ahead_s(self) -> float | None:
        """Return how far the stamps are ahead of ``Date``, s, as the median of the last readings; None without any."""
        return median(self._ahead) if self._ahead else None

    def take(self, at: float, stamp: float) -> None:
        """Add a reading: the local time and the robot's stamp, s."""
        if self._readings and at < self._readings[-1][0] + self._every:
            return
        self._readings.append((at, stamp))
        if len(self._first) < _FINE:
            self._first.append((at, stamp))
        if len(self._readings) > _MOST:
            self._readings, self._every = self._readings[::2], 2 * self._every

    @property
    def span_s(self) -> float:
        """Return the time from the first reading to the last, s."""
        return self._readings[-1][0] - self._readings[0][0] if self._readings else 0.0

    @property
    def rate(self) -> float | None:
        """Return robot seconds per local second; None with too few readings.

        The rate is the median over all pairs of readings at least half of the span apart (Theil-Sen estimator), so that
        neither a slow response nor one correction of the robot's clock changes it.
        """
        if self.span_s < SPAN_S:
            return None
        return slope(self._readings)

    @property
    def fine_rate(self) -> float | None:
        """Return the clock's rate within a second; None with too few readings.

        The rate is the median over pairs of near readings. Pairs with the same stamp do not count: odometry may be
        published slowly. A robot that writes milliseconds into the nanoseconds field has the right rate over many
        seconds and almost none within one.
        """
        near = [
            (later - earlier) / (there - here)
            for index, (here, earlier) in enumerate(self._first)
            for there, later in self._first[index + 1 :]
            if _NEAR_S[0] <= there - here <= _NEAR_S[1] and later != earlier
        ]
        return median(near) if len(near) >= _ENOUGH else None

    def is_right(self, time_scale: float) -> bool:
        """Return whether the clock's rate is within 5 % of the time scale, so that odometry ages can be computed."""
        rate = self.rate
        return rate is not None and abs(rate - time_scale) <= time_scale * (_SHARE + _OLDER_S / self.span_s)

    def stands_between(self, time_scale: float) -> bool:
        """Return whether the stamps hardly advance within each second and jump from one second to the next."""
        fine = self.fine_rate
        return fine is not None and abs(fine) < time_scale * _HARDLY
