"""Confidence intervals of medians, p99s and other quantiles, and of their ratios and differences.

They come from a bootstrap over rounds (module `rounds`), or over repeats and the rounds within them (Davison and
Hinkley 1997, section 3.8) where the run has enough repeats. Percentile intervals of few rounds are too narrow: they are
taken at the level that makes them as wide as Student's t (Hesterberg 2015). They are widened by the correlation that is
left between rounds, and by what the repeats differ beyond each run's own scatter (Birge 1932). How often they are right
is measured by `benchmarks/calibration.py`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from loadtests.statistics.histogram import SHARES, Floats, Histogram, Ints
from loadtests.statistics.rounds import (
    LEAST_REPEATS,
    Interval,
    Rounds,
    Sample,
    Unit,
    in_rounds,
    widened_difference,
    widened_ratio,
    widening,
)

RESAMPLES = 2000
LEAST_ROUNDS = 6
#: Six parts of a run agree by chance on which side is slower in 2 of 64 runs (the sign test).
PARTS = 6
_AT_ONCE = 100  # resamples held in memory together
_TAIL = 0.025
_UPPER_TAIL = 0.99
#: Limit on the logarithmic scale: an interval wider than a factor of 1e13 says nothing more, and its bounds would
#: become 0 and infinite.
_FARTHEST = 30.0


def samples_for_point(quantile: float) -> int:
    """Return the fewest samples for a quantile: two beyond it, and ten from p99 on (1,000 samples)."""
    beyond = 10 if quantile >= _UPPER_TAIL else 2
    return math.ceil(beyond / (1 - quantile) - 1e-9)


def samples_for_interval(quantile: float) -> int:
    """Return the fewest samples for which any 95 % interval of a quantile exists.

    The largest of n values lies above the quantile with probability 1 - q**n, which has to reach 0.975 (the
    distribution-free interval of order statistics).
    """
    return math.ceil(math.log(_TAIL) / math.log(max(quantile, 1 - quantile)) - 1e-9)


@dataclass(frozen=True)
class Replicates:
    """A figure of each side, and its value in each resample (Davison and Hinkley's bootstrap replicates).

    Attributes:
        estimates: of the whole, shape (sides,), milliseconds.
        values: shape (sides, resamples).
        rounds: the resampled rounds.
        degrees: degrees of freedom of Student's t.
        widening: factor by which the interval must be wider than the replicates show.
    """

    estimates: Floats
    values: Floats
    rounds: Rounds
    degrees: int
    widening: float

    def interval(self, combined: Floats, estimate: float) -> Interval | None:
        """Return the 95 % interval of a positive figure, `combined` from the sides' replicates."""
        known = combined[np.isfinite(combined) & (combined > 0)]
        if len(known) < RESAMPLES / 2 or estimate <= 0:
            return None
        reach = (np.log(expanded_percentiles(known, self.degrees)) - math.log(estimate)) * self.widening
        low, high = np.clip(reach, -_FARTHEST, _FARTHEST).tolist()
        return estimate * math.exp(low), estimate * math.exp(high)

    def difference_interval(self) -> Interval | None:
        """Return the 95 % interval of the second side's figure less the first's."""
        combined = self.values[1] - self.values[0]
        known = combined[np.isfinite(combined)]
        if len(known) < RESAMPLES / 2:
            return None
        estimate = float(self.estimates[1] - self.estimates[0])
        low, high = (expanded_percentiles(known, self.degrees) - estimate).tolist()
        return estimate + low * self.widening, estimate + high * self.widening


def expanded_percentiles(replicates: Floats, degrees: int) -> Floats:
    """Return the quantiles of the replicates between which 95 % lie by Student's t with these degrees of freedom."""
    reach = special.stdtrit(degrees, 1 - _TAIL) * math.sqrt((degrees + 1) / degrees)
    tail = float(special.ndtr(-reach))
    found: Floats = np.quantile(replicates, [tail, 1 - tail])
    return found


def resample(units: Sequence[Unit], name: str, seed: int, stream: int = 0) -> Replicates | None:
    """Resample units; returns None where fewer than LEAST_ROUNDS have samples on each side."""
    filled = [unit for unit in units if all(side.total for side in unit.sides)]
    if len(filled) < LEAST_ROUNDS:
        return None
    rounds = in_rounds(Sample.of(filled), name)
    sample, rng = rounds.sample, np.random.default_rng([seed, 6, stream])
    repeats = len(np.unique(sample.repeats))
    nested = repeats >= LEAST_REPEATS
    outer = repeats if nested else sample.size

    found = []
    for _ in range(RESAMPLES // _AT_ONCE):
        times = _times(rng.integers(0, outer, (_AT_ONCE, outer)), outer)
        found.append(sample.statistic_ms(_within(times, sample.repeats, rng) if nested else times, name))
    whole = sample.statistic_ms(np.ones((1, sample.size)), name)[:, 0]
    wider = widening(rounds.correlation) * (1.0 if nested else birge_ratio(rounds))
    return Replicates(whole, np.concatenate(found, axis=-1), rounds, outer - 1, wider)


def _times(chosen: Ints, number: int) -> Floats:
    """Return how often each of `number` items was chosen, shape (resamples, number)."""
    rows = np.arange(len(chosen))[:, None] * number
    counted = np.bincount((chosen + rows).ravel(), minlength=len(chosen) * number)
    return counted.reshape(len(chosen), number).astype(np.float64)


def _within(times: Floats, repeats: Ints, rng: np.random.Generator) -> Floats:
    """Resample rounds within the chosen repeats: how often each round counts, shape (resamples, rounds)."""
    found = np.zeros((len(times), len(repeats)))
    for number, repeat in enumerate(np.unique(repeats).tolist()):
        members = np.flatnonzero(repeats == repeat)
        trials = (times[:, number] * len(members)).astype(np.int64)
        found[:, members] = rng.multinomial(trials, np.full(len(members), 1 / len(members)))
    return found


def birge_ratio(rounds: Rounds) -> float:
    """Return by how much repeats scatter more than their rounds explain, 1 or more."""
    numbers = np.unique(rounds.sample.repeats)
    within = [rounds.influence[rounds.sample.repeats == number] for number in numbers]
    within = [values for values in within if len(values) > 1]
    if len(within) < 2:  # noqa: PLR2004 -- one run has nothing to be compared with
        return 1.0
    means = np.array([values.mean() for values in within])
    errors = np.array([values.var(ddof=1) / len(values) for values in within]) * widening(rounds.correlation) ** 2
    errors = np.maximum(errors, 1e-18)
    centre = float((means / errors).sum() / (1 / errors).sum())
    return max(1.0, math.sqrt(float(((means - centre) ** 2 / errors).sum()) / (len(within) - 1)))


@dataclass(frozen=True)
class Estimate:
    """A figure's 95 % interval with its replicates, or the reason why there is no interval."""

    interval: Interval | None
    reason: str | None
    replicates: Replicates | None


def figure_interval_ms(units: Sequence[Unit], name: str, seed: int) -> Estimate:
    """Return the 95 % interval of a mean or a quantile (p50, p99, ...) of one series, in ms.

    The interval comes from resampled rounds, or from the order of the samples if these are too few.

    Args:
        units: with one side each.
        name: `mean` or a key of SHARES.
        seed: fixes the resamples.
    """
    samples = sum(unit.sides[0].total for unit in units)
    needed = 2 if name == "mean" else max(samples_for_interval(SHARES[name]), samples_for_point(SHARES[name]))
    if samples < needed:
        return Estimate(None, f"{samples} samples; a 95 % interval of {name} needs {needed}", None)
    replicates = resample(units, name, seed)
    if replicates is not None:
        interval = _within_samples(replicates.interval(replicates.values[0], float(replicates.estimates[0])), units)
        return Estimate(interval, None if interval else "too few resamples hold samples", replicates)
    if name not in SHARES:
        return Estimate(None, f"fewer than {LEAST_ROUNDS} rounds of blocks", None)
    whole = Histogram.sum_of(unit.sides[0] for unit in units)
    return Estimate(order_interval_ms(whole, SHARES[name]), None, None)


def _within_samples(interval: Interval | None, units: Sequence[Unit]) -> Interval | None:
    """Return an interval no wider than the samples: a widened one may reach far beyond what was ever measured."""
    whole = Histogram.sum_of(unit.sides[0] for unit in units)
    least, most = whole.quantile_ms(0.0), whole.quantile_ms(1.0)
    if interval is None or least is None or most is None:
        return interval
    return max(interval[0], least), min(interval[1], most)


def order_interval_ms(histogram: Histogram, quantile: float) -> Interval | None:
    """Return the distribution-free 95 % interval of a quantile, from the order of the samples alone.

    It assumes independent samples, which requests are not quite: it is used where there are too few blocks to resample.
    """
    samples = histogram.total
    if samples < samples_for_interval(quantile):
        return None
    low = binomial_quantile(_TAIL, samples, quantile) - 1
    high = binomial_quantile(1 - _TAIL, samples, quantile) + 1
    bounds = [histogram.quantile_ms(min(max(rank / samples, 0.0), 1.0)) for rank in (low, high)]
    return (bounds[0] or 0.0), (bounds[1] or 0.0)


def binomial_quantile(share: float, trials: int, chance: float) -> int:
    """Return the least number of successes whose cumulative probability reaches a share."""
    found: int = max(0, math.floor(special.bdtrik(share, trials, chance)) - 1)
    while special.bdtr(found, trials, chance) < share:
        found += 1
    return found


@dataclass(frozen=True)
class Compared:
    """The difference and the ratio of two sides' figures: the second minus, and divided by, the first.

    `parts` are the ratios of successive sixths of the run; empty without an interval.
    """

    difference_ms: float
    ratio: float
    ci95: Interval | None
    ci95_difference_ms: Interval | None
    replicates: Replicates | None
    parts: list[float]


def compare(units: Sequence[Unit], name: str, seed: int, *, stream: int = 0, deviation: float = 0.0) -> Compared | None:
    """Compare two sides by units that hold both; returns None where a side is empty.

    Args:
        units: with the first and the second side's histogram each.
        name: `mean` or a key of SHARES.
        seed: fixes the resamples.
        stream: keeps apart the resamples of comparisons that are pooled.
        deviation: relative standard deviation of the ratio between runs, to be in the interval (see `between_runs`).
    """
    filled = [unit for unit in units if all(side.total for side in unit.sides)]
    if not filled:
        return None
    sample = Sample.of(filled)
    first, second = (float(value) for value in sample.statistic_ms(np.ones((1, sample.size)), name)[:, 0])
    if first <= 0:
        return None
    replicates = resample(filled, name, seed, stream)
    if replicates is None:
        return Compared(second - first, second / first, None, None, None, [])
    ratio, within = second / first, replicates.interval(replicates.values[1] / replicates.values[0], second / first)
    difference, within_ms = second - first, replicates.difference_interval()
    of_part = np.arange(sample.size) * PARTS // sample.size == np.arange(PARTS)[:, None]
    parts = sample.statistic_ms(of_part.astype(np.float64), name)
    return Compared(
        difference,
        ratio,
        None if within is None else widened_ratio(ratio, within, deviation),
        None if within_ms is None else widened_difference(difference, within_ms, deviation * second),
        replicates,
        (parts[1] / np.maximum(parts[0], 1e-9)).tolist(),
    )


def pooled_interval(parts: Sequence[Compared]) -> Interval | None:
    """Return the 95 % interval of the geometric mean of the ratios of comparisons with independent resamples.

    None where one of them has no interval.
    """
    known = [part.replicates for part in parts if part.replicates is not None]
    if not known or len(known) < len(parts):
        return None
    ratio = math.exp(float(np.mean([math.log(part.ratio) for part in parts])))
    with np.errstate(invalid="ignore", divide="ignore"):
        ratios = np.exp(np.mean([np.log(replicates.values[1] / replicates.values[0]) for replicates in known], axis=0))
    degrees, wider = sum(replicates.degrees for replicates in known), max(replicates.widening for replicates in known)
    return replace(known[0], degrees=degrees, widening=wider).interval(ratios, ratio)
