"""Units of resampling: rounds of neighbouring pairs of blocks, long enough to be independent.

Consecutive requests are not independent, and blocks are not either: a stall or a drift affects several. Resampling
dependent parts makes intervals too narrow (Carlstein 1986). The smallest unit is the pair of neighbouring blocks. Units
are put together, at least two where there are enough (a quartet, in which both sides have been first), until one round
does not correlate with the next. The correlation that is left widens the interval by as much as it makes the mean of a
first-order autoregressive series less certain.

The correlation is that of each unit's influence on the figure: for a quantile the share of its samples beyond it, for a
mean their sum. The figure's error is made of this influence (Hampel 1974), and unlike a median of few samples it exists
for every unit.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from loadtests.statistics.histogram import SHARES, Floats, Histogram, Ints, edges_us, quantiles_us

#: Putting units together ends before there are fewer rounds than this: of seven independent rounds the correlation is
#: as often as not estimated beyond 0.3 or below -0.3, and intervals came out three times as wide as they had to be.
_FEWEST_ROUNDS = 12
_LENGTHS = (2, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96)
#: A smaller correlation counts as none; so does one that few independent values show by chance (one standard error).
_GONE = 0.1
_MOST = 0.8  # beyond this correlation the formula for the variance fails
_LEAST_FOR_LAG = 6  # fewest rounds from which a correlation is estimated


class Unit(NamedTuple):
    """A pair of the plan's blocks: its repeat, and one histogram for each side that is compared."""

    repeat: int
    sides: tuple[Histogram, ...]


@dataclass(frozen=True)
class Sample:
    """Units or rounds on common bins.

    Attributes:
        bins: occupied bins, ascending, shape (bins,).
        counts: shape (sides, units, bins).
        repeats: the repeat that each belongs to, ascending, shape (units,).
    """

    bins: Ints
    counts: Floats
    repeats: Ints

    @classmethod
    def of(cls, units: Sequence[Unit]) -> Self:
        """Return a sample from units, at least one, in order of time."""
        arrays = [[side.arrays() for side in unit.sides] for unit in units]
        occupied = np.unique(np.concatenate([bins for sides in arrays for bins, _ in sides]))
        counts = np.zeros((len(arrays[0]), len(units), len(occupied)))
        for row, sides in enumerate(arrays):
            for side, (bins, numbers) in enumerate(sides):
                counts[side, row, np.searchsorted(occupied, bins)] = numbers
        return cls(occupied, counts, np.array([unit.repeat for unit in units]))

    @property
    def size(self) -> int:
        """Return how many units there are."""
        return int(self.counts.shape[1])

    def statistic_ms(self, weights: Floats, name: str) -> Floats:
        """Return the mean or a quantile of weighted sums of units.

        Args:
            weights: how often each unit counts, shape (resamples, units).
            name: `mean` or a key of SHARES.

        Returns:
            Shape (sides, resamples), milliseconds; NaN for a resample without samples.
        """
        return np.array([_statistic_ms(self.bins, weights @ side, name) for side in self.counts])

    def influence(self, name: str) -> Floats:
        """Return each unit's contribution to the figure's error, shape (units,); of two sides the difference."""
        whole = self.statistic_ms(np.ones((1, self.size)), name)[:, 0]
        lower, width = edges_us(self.bins)
        found = []
        for counts, figure in zip(self.counts, whole, strict=True):
            samples = counts.sum(axis=1)
            if name == "mean":
                excess = counts @ ((lower + width / 2) / 1e3 / max(figure, 1e-9) - 1)
            else:
                beyond = np.clip((lower + width - figure * 1e3) / width, 0.0, 1.0)
                excess = counts @ beyond - (1 - SHARES[name]) * samples
            found.append(excess / max(samples.mean(), 1e-9))
        result: Floats = found[-1] - found[0] if len(found) > 1 else found[0]
        return result


def _statistic_ms(bins: Ints, counts: Floats, name: str) -> Floats:
    totals = counts.sum(axis=1)
    if name == "mean":
        lower, width = edges_us(bins)
        with np.errstate(invalid="ignore", divide="ignore"):
            means: Floats = counts @ (lower + width / 2) / totals / 1e3
            return means
    found = np.full(len(counts), np.nan)
    filled = totals > 0
    if filled.any():
        found[filled] = quantiles_us(bins, counts[filled], SHARES[name]) / 1e3
    return found


@dataclass(frozen=True)
class Rounds:
    """How units were put together.

    Attributes:
        sample: the rounds.
        length: units in each.
        unit_correlation, correlation: from one unit to the next, and from one round to the next; None where there are
            too few.
        influence: the influence of each round, shape (rounds,).
    """

    sample: Sample
    length: int
    unit_correlation: float | None
    correlation: float | None
    influence: Floats


def widening(correlation: float | None) -> float:
    """Return by how much the correlation of each value with the next widens an interval, 1 or more."""
    left = min(max(correlation or 0.0, 0.0), _MOST)
    return math.sqrt((1 + left) / (1 - left))


def lag_correlation(values: Floats, repeats: Ints) -> float | None:
    """Return the correlation of each value with the next, within repeats; None where there are too few values.

    A short series makes it look too small; that is corrected to first order (Marriott and Pope 1954).
    """
    number = len(values)
    if number < _LEAST_FOR_LAG:
        return None
    centred = values - values.mean()
    together = repeats[1:] == repeats[:-1]
    spread = float((centred**2).sum())
    if not together.any() or spread <= 0:
        return None
    pairs = int(together.sum())
    raw = float((centred[1:] * centred[:-1])[together].sum()) / spread * number / pairs
    return float(np.clip((raw * number + 1) / (number - 4), -1.0, 1.0))


def in_rounds(sample: Sample, name: str) -> Rounds:
    """Combine units into rounds, until a round's influence on a figure does not correlate with the next one's."""
    influence = sample.influence(name)
    alone = lag_correlation(influence, sample.repeats)
    chosen = Rounds(sample, 1, alone, alone, influence)
    for length in _LENGTHS:
        gone = chosen.correlation is None or chosen.correlation < max(_GONE, 1 / math.sqrt(chosen.sample.size))
        if gone and chosen.length > 1:
            break
        first = _first_of_each(sample.repeats, length)
        if len(first) < _FEWEST_ROUNDS:
            break
        longer = Sample(sample.bins, np.add.reduceat(sample.counts, first, axis=1), sample.repeats[first])
        summed = np.add.reduceat(influence, first)
        chosen = Rounds(longer, length, alone, lag_correlation(summed, longer.repeats), summed)
    return chosen


def _first_of_each(repeats: Ints, length: int) -> Ints:
    """Return the index of the first unit of each round; remaining units at a repeat's end join its last round."""
    first: list[int] = []
    for repeat in np.unique(repeats).tolist():
        members = np.flatnonzero(repeats == repeat)
        rounds = max(1, len(members) // length)
        first += members[: rounds * length : length].tolist()
    return np.array(first)


Interval = tuple[float, float]

#: With fewer repeats, the rounds of all repeats are resampled, and the interval is widened by the repeats' difference.
LEAST_REPEATS = 4
#: Relative standard deviation of the ratio between runs, on a machine with idle processors, and on one without when
#: the run began.
IDLE_MACHINE, BUSY_MACHINE = 0.01, 0.02
_REACH = 1.959964  # standard deviations to either side hold 95 %


def between_runs(load: Sequence[float] | None, repeats: int = 1) -> float:
    """Return the standard deviation between runs, by the load averages before the run; 0 where repeats show it."""
    if repeats >= LEAST_REPEATS:
        return 0.0
    return BUSY_MACHINE if load and load[0] > (os.cpu_count() or 1) else IDLE_MACHINE


def widened_ratio(ratio: float, interval: Interval, deviation: float) -> Interval:
    """Widen a ratio's interval by the deviation between runs: variances add, on the logarithmic scale."""
    low, high = (math.log(bound / ratio) for bound in interval)
    reach = _REACH * deviation
    return ratio * math.exp(-math.hypot(min(low, 0.0), reach)), ratio * math.exp(math.hypot(max(high, 0.0), reach))


def widened_difference(difference: float, interval: Interval, deviation_ms: float) -> Interval:
    """Widen the interval of a difference by a standard deviation between runs, in milliseconds."""
    low, high = (bound - difference for bound in interval)
    reach = _REACH * deviation_ms
    return difference - math.hypot(min(low, 0.0), reach), difference + math.hypot(max(high, 0.0), reach)
