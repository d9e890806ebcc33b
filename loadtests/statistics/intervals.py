"""Confidence intervals of medians, p99s and other quantiles, and of their differences, by resampling blocks.

Requests that follow one another are not independent: a stall or a drift meets many at once. The unit that is
drawn again is therefore the block (Carlstein 1986), and for a difference or a ratio the pair of neighbouring
blocks, one of each side, so that a drift which met both stays in both. Percentile intervals of 1,000 draws.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from loadtests.statistics.histogram import Floats, Histogram, Ints, edges_us, quantiles_us

if TYPE_CHECKING:
    from collections.abc import Sequence

DRAWS = 1000
LEAST_BLOCKS = 6
_AT_ONCE = 100  # draws held in memory together
_TAIL = 0.025
SHARES = {"p50": 0.5, "p90": 0.9, "p95": 0.95, "p99": 0.99, "p999": 0.999}

Interval = tuple[float, float]


def samples_for_point(quantile: float) -> int:
    """Fewest samples for a quantile to be given: two beyond it."""
    return math.ceil(2 / (1 - quantile) - 1e-9)


def samples_for_interval(quantile: float) -> int:
    """Fewest samples for which any 95 % interval of a quantile exists.

    The largest of n values lies above the quantile with probability 1 - q**n, which has to reach 0.975 (the
    distribution-free interval of order statistics).
    """
    return math.ceil(math.log(_TAIL) / math.log(max(quantile, 1 - quantile)) - 1e-9)


@dataclass(frozen=True)
class Blocks:
    """The histograms of several blocks on common bins.

    Attributes:
        bins: occupied bins, ascending, shape (bins,).
        counts: shape (blocks, bins).
    """

    bins: Ints
    counts: Floats

    @classmethod
    def of(cls, histograms: Sequence[Histogram]) -> Blocks:
        """From one histogram for each block."""
        found = [histogram.arrays() for histogram in histograms]
        occupied = np.unique(np.concatenate([bins for bins, _ in found]))
        counts = np.zeros((len(found), len(occupied)))
        for row, (bins, numbers) in enumerate(found):
            counts[row, np.searchsorted(occupied, bins)] = numbers
        return cls(occupied, counts)

    def statistic_ms(self, weights: Floats, name: str) -> Floats:
        """The mean or a quantile of weighted sums of blocks.

        Args:
            weights: how often each block counts, shape (draws, blocks).
            name: `mean` or a key of SHARES.

        Returns:
            Shape (draws,), milliseconds; NaN for a draw without samples.
        """
        drawn = weights @ self.counts
        totals = drawn.sum(axis=1)
        if name == "mean":
            lower, width = edges_us(self.bins)
            with np.errstate(invalid="ignore", divide="ignore"):
                means: Floats = drawn @ (lower + width / 2) / totals / 1e3
                return means
        found = np.full(len(drawn), np.nan)
        filled = totals > 0
        if filled.any():
            found[filled] = quantiles_us(self.bins, drawn[filled], SHARES[name]) / 1e3
        return found


def _weights(blocks: int, draws: int, lot: np.random.Generator) -> Floats:
    """How often each block is drawn, in each of several draws with replacement."""
    return lot.multinomial(blocks, np.full(blocks, 1 / blocks), size=draws).astype(np.float64)


def _interval(values: Floats) -> Interval | None:
    known = values[np.isfinite(values)]
    if len(known) < DRAWS / 2:
        return None
    low, high = np.quantile(known, [_TAIL, 1 - _TAIL])
    return float(low), float(high)


def quantile_interval_ms(histograms: Sequence[Histogram], name: str, seed: int) -> tuple[Interval | None, str | None]:
    """The 95 % interval of a mean or a quantile (p50, p99, ...) of one series, as latency.json gives it.

    Args:
        histograms: one for each block.
        name: `mean` or a key of SHARES.
        seed: fixes the draws.

    Returns:
        The interval by resampling blocks, or from the order of the samples where there are too few blocks; or None
        and why there is none.
    """
    samples = sum(histogram.total for histogram in histograms)
    needed = 2 if name == "mean" else samples_for_interval(SHARES[name])
    if samples < needed:
        return None, f"{samples} samples; a 95 % interval of {name} needs {needed}"
    interval = resampled_interval_ms(histograms, name, seed)
    if interval is None and name in SHARES:
        whole = Histogram()
        for histogram in histograms:
            whole.merge(histogram)
        interval = order_interval_ms(whole, SHARES[name])
    return interval, None if interval else f"fewer than {LEAST_BLOCKS} blocks"


def at_most(count: int, trials: int, share: float) -> float:
    """The probability that a binomial variable is at most `count`."""
    if count >= trials:
        return 1.0
    steps = np.arange(1, trials + 1)
    logs = np.concatenate([[0.0], np.cumsum(np.log(trials + 1 - steps) - np.log(steps))])
    successes = np.arange(trials + 1)
    logs = logs + successes * math.log(share) + (trials - successes) * math.log1p(-share)
    return float(np.exp(logs[: count + 1]).sum())


def order_interval_ms(histogram: Histogram, quantile: float) -> Interval | None:
    """The distribution-free 95 % interval of a quantile, from the order of the samples alone.

    It takes them as independent, which requests are not quite: it serves where there are too few blocks to draw from.
    """
    samples = histogram.total
    if samples < samples_for_interval(quantile):
        return None
    ranks = [at_most(rank, samples, quantile) for rank in range(samples + 1)]
    low = max(0, sum(chance <= _TAIL for chance in ranks) - 1)
    high = min(samples, sum(chance < 1 - _TAIL for chance in ranks) + 1)
    bounds = [histogram.quantile_ms(rank / samples) for rank in (low, high)]
    return (bounds[0] or 0.0), (bounds[1] or 0.0)


def resampled_interval_ms(histograms: Sequence[Histogram], name: str, seed: int) -> Interval | None:
    """The 95 % interval of a statistic of one series, from its blocks; None with fewer than LEAST_BLOCKS."""
    filled = [histogram for histogram in histograms if histogram.total]
    if len(filled) < LEAST_BLOCKS:
        return None
    blocks, lot = Blocks.of(filled), np.random.default_rng([seed, 6])
    values = [blocks.statistic_ms(_weights(len(filled), _AT_ONCE, lot), name) for _ in range(0, DRAWS, _AT_ONCE)]
    return _interval(np.concatenate(values))


@dataclass(frozen=True)
class Compared:
    """Two sides' statistic: the second minus the first, and over it."""

    difference_ms: float
    ratio: float
    ci95: Interval | None
    ci95_difference_ms: Interval | None


def compare(pairs: Sequence[tuple[Histogram, Histogram]], name: str, seed: int) -> Compared | None:
    """Compare two sides by pairs of neighbouring blocks; None where a side is empty.

    Args:
        pairs: the first side's and the second side's histogram of each pair.
        name: `mean` or a key of SHARES.
        seed: fixes the draws.
    """
    whole = [pair for pair in pairs if pair[0].total and pair[1].total]
    if not whole:
        return None
    sides = [Blocks.of([pair[side] for pair in whole]) for side in (0, 1)]
    ones = np.ones((1, len(whole)))
    first, second = (float(side.statistic_ms(ones, name)[0]) for side in sides)
    if first <= 0:
        return None
    if len(whole) < LEAST_BLOCKS:
        return Compared(second - first, second / first, None, None)
    lot = np.random.default_rng([seed, 7])
    drawn: tuple[list[Floats], list[Floats]] = ([], [])
    for _ in range(0, DRAWS, _AT_ONCE):
        weights = _weights(len(whole), _AT_ONCE, lot)
        for side, kept in zip(sides, drawn, strict=True):
            kept.append(side.statistic_ms(weights, name))
    firsts, seconds = (np.concatenate(kept) for kept in drawn)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios = seconds / firsts
    return Compared(second - first, second / first, _interval(ratios), _interval(seconds - firsts))
