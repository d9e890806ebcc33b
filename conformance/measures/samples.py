"""Medians, slopes and noise of several samples, so that no single sample decides.

A device publishes its state 5 to 100 times a second, with noise in each sample; a client may read it faster or slower.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from statistics import median
from typing import Final, NamedTuple, Protocol

#: Use the median of this many samples: one outlier cannot matter.
SEVERAL: Final = 3
#: A response is late if it takes this many times as long as usual.
LATE: Final = 3
# Converts the median distance from the median to the standard deviation of normal noise.
_SIGMA: Final = 1.4826
# A sample lies within this many standard deviations of noise: normal noise exceeds them once in fifteen thousand.
FARTHEST: Final = 4.0

Sample = tuple[float, float]
"""A time, s, and a value."""


class _Timed(Protocol):
    """A reading: when it was requested, and when the response had arrived, s of the run's clock."""

    @property
    def sent(self) -> float: ...
    @property
    def received(self) -> float: ...


def usual_s(readings: Sequence[_Timed]) -> float:
    """Return how long a reading takes, by the median, s."""
    return median(sample.received - sample.sent for sample in readings) if readings else 0.0


def longest_s(readings: Sequence[_Timed]) -> float:
    """Return how long the slowest reading took, s: a loaded machine or link may delay anything else by as much."""
    return max((sample.received - sample.sent for sample in readings), default=0.0)


def middle(values: Iterable[Sequence[float]]) -> tuple[float, ...]:
    """Return the median of each component."""
    return tuple(map(median, zip(*values, strict=True)))


def slope(samples: Sequence[Sample]) -> float | None:
    """Return the change per second; None of less than two moments.

    The median over all pairs of samples at least half of the span apart (Theil-Sen estimator), so that neither a slow
    response nor one jump changes it.
    """
    apart = (samples[-1][0] - samples[0][0]) / 2 if samples else 0.0
    pairs = itertools.combinations(samples, 2) if apart > 0 else ()
    slopes = [(later - first) / (there - here) for (here, first), (there, later) in pairs if there - here >= apart]
    return median(slopes) if slopes else None


def scatter(samples: Sequence[Sample]) -> float:
    """Return the standard deviation of a sample's noise, by how samples differ from the middle of their neighbours."""
    values = [value for _, value in samples]
    bends = [
        abs(before - 2 * value + after) for before, value, after in zip(values, values[1:], values[2:], strict=False)
    ]
    return _SIGMA * median(bends) / math.sqrt(6) if bends else 0.0


class Noise(NamedTuple):
    """Noise of a device at rest: the samples' offset from zero, and the standard deviation of one sample."""

    off: float
    sigma: float

    @classmethod
    def of(cls, values: Sequence[float], declared: float = 0.0) -> "Noise":
        """Return the noise of some samples; ``declared`` is the least standard deviation."""
        if not values:
            return cls(0.0, declared)
        centre = median(values)
        return cls(abs(centre), max(declared, _SIGMA * median(abs(value - centre) for value in values)))

    def room(self, samples: Sequence[Sample]) -> float:
        """Return how far the median of such samples may be off zero; repeated values count once."""
        distinct = 1 + sum(one[1] != other[1] for one, other in itertools.pairwise(samples))
        return self.off + FARTHEST * self.sigma / math.sqrt(distinct)

    def slope_room(self, samples: Sequence[Sample]) -> float:
        """Return how fast such samples of something at rest may seem to move, per second."""
        lapse_s = samples[-1][0] - samples[0][0]
        return FARTHEST * self.sigma * math.sqrt(12 / len(samples)) / lapse_s if lapse_s > 0 else math.inf


def goes_on(
    samples: Sequence[Sample],
    rate: Callable[[Sequence[Sample]], float | None],
    most: Callable[[Sequence[Sample]], float],
) -> float:
    """Return the rate per second of something that moves all the time in one direction; else 0.

    Args:
        samples: of at least one second or so.
        rate: returns the rate of some samples; None if they are too few.
        most: returns the greatest rate that noise may cause at rest; each third of the samples must exceed it.
    """
    if len(samples) < SEVERAL * SEVERAL:
        return 0.0
    begin, length = samples[0][0], (samples[-1][0] - samples[0][0]) / SEVERAL
    found: list[float] = []
    for part in range(SEVERAL):
        within = [pair for pair in samples if begin + part * length <= pair[0] <= begin + (part + 1) * length]
        seen = rate(within) if len(within) >= SEVERAL else None
        if seen is None or abs(seen) <= most(within):
            return 0.0
        found.append(seen)
    return min(found, key=abs) if min(found) * max(found) > 0 and abs(found[-1]) >= abs(found[0]) / 2 else 0.0
