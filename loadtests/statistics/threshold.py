"""Judge whether the robot met its thresholds."""

from collections.abc import Iterable
from typing import Any

from scipy import special

from conformance.papers_robot.thresholds import Threshold
from loadtests.statistics.figures import plain_quantiles
from loadtests.statistics.histogram import SHARES, Histogram, edges_us
from loadtests.statistics.intervals import figure_interval_ms
from loadtests.statistics.measured import Measured

_SMALL_CHANCE = 0.025


def judge(measured: Measured, thresholds: Iterable[Threshold]) -> list[dict[str, Any]]:
    """Return the `thresholds` of latency.json: each against its interval's upper bound, failed requests included."""
    return [threshold.as_message() | _judged(measured, threshold) for threshold in thresholds]


def _judged(measured: Measured, threshold: Threshold) -> dict[str, Any]:
    name, limit = (threshold.operation, threshold.interface, threshold.client), threshold.below_ms
    found: dict[str, Any] = {"measured_ms": None, "bound_ms": None, "outcome": "inconclusive"}
    if name not in measured.plan.series_names():
        return found | {"reason": "not measured in this run"}
    whole = measured.whole(name, threshold.time)
    found["measured_ms"] = plain_quantiles(whole)[threshold.quantile]
    bound, reason = found["measured_ms"], None if whole.total else "no samples"
    if threshold.quantile != "max":
        estimate = figure_interval_ms(measured.units(name, threshold.time), threshold.quantile, measured.plan.load.seed)
        bound, reason = estimate.interval[1] if estimate.interval else None, estimate.reason
    found |= {"bound_ms": bound, "reason": reason}
    if bound is not None and bound < limit:
        return found | {"outcome": "met", "reason": None}
    if bound is not None:
        return found | {"outcome": "missed", "reason": f"{bound:.3f} ms is not below {limit:g} ms"}
    if threshold.quantile in SHARES and _surely_above(whole, threshold):
        said = f"too many of the {whole.total} samples are not below {limit:g} ms"
        return found | {"outcome": "missed", "reason": said}
    return found


def _surely_above(histogram: Histogram, threshold: Threshold) -> bool:
    """Return whether even few samples prove that a quantile lies above its threshold.

    They do where so few samples below the threshold would occur in less than 2.5 % of all runs if it were met.
    """
    bins, counts = histogram.arrays()
    below = int(counts[edges_us(bins)[0] < threshold.below_ms * 1e3].sum())
    chance = float(special.bdtr(below, histogram.total, SHARES[threshold.quantile]))
    return histogram.total > 0 and chance < _SMALL_CHANCE
