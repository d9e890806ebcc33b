"""Whether the robot kept its thresholds."""

from collections.abc import Iterable
from typing import Any

from scipy import stats

from conformance.packs.table1.thresholds import Threshold
from loadtests.statistics.figures import quantiles
from loadtests.statistics.histogram import Histogram, edges_us
from loadtests.statistics.intervals import figure_interval_ms
from loadtests.statistics.measured import Measured
from loadtests.statistics.rounds import SHARES

_SMALL_CHANCE = 0.025


def _surely_above(histogram: Histogram, threshold: Threshold) -> bool:
    """Whether even few samples prove a quantile to lie above its threshold.

    They do when, were it below, so few samples under the threshold would turn up in less than 2.5 % of all runs.
    """
    bins, counts = histogram.arrays()
    below = int(counts[edges_us(bins)[0] < threshold.below_ms * 1e3].sum())
    chance = float(stats.binom.cdf(below, histogram.total, SHARES[threshold.quantile]))
    return histogram.total > 0 and chance < _SMALL_CHANCE


def judge(measured: Measured, thresholds: Iterable[Threshold]) -> list[dict[str, Any]]:
    """The `thresholds` of latency.json: each against the upper bound of its interval, failed requests included."""
    found = []
    for threshold in thresholds:
        entry = threshold.as_message() | {
            "measured_ms": None,
            "bound_ms": None,
            "outcome": "inconclusive",
            "reason": None,
        }
        name = (threshold.operation, threshold.interface, threshold.client)
        if name not in measured.plan.series_names():
            entry["reason"] = "not measured in this run"
            found.append(entry)
            continue
        units = measured.units(name, threshold.time)
        whole = measured.whole(name, threshold.time)
        entry["measured_ms"] = quantiles(whole)[0][threshold.quantile]
        if threshold.quantile == "max":
            bound, reason = entry["measured_ms"], None if whole.total else "no samples"
        else:
            estimate = figure_interval_ms(units, threshold.quantile, measured.plan.load.seed)
            bound, reason = estimate.interval[1] if estimate.interval else None, estimate.reason
        entry["bound_ms"], entry["reason"] = bound, reason
        if bound is None and threshold.quantile in SHARES and _surely_above(whole, threshold):
            entry["outcome"] = "missed"
            entry["reason"] = f"too many of the {whole.total} samples are not below {threshold.below_ms:g} ms"
        if bound is not None:
            met = bound < threshold.below_ms
            entry["outcome"] = "met" if met else "missed"
            entry["reason"] = None if met else f"{bound:.3f} ms is not below {threshold.below_ms:g} ms"
        found.append(entry)
    return found
