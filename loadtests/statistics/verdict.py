"""Whether a run is worth anything, and whether the robot kept its thresholds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from loadtests.statistics.figures import Measured, plain_quantiles, quantiles, rounded
from loadtests.statistics.histogram import Histogram, edges_us
from loadtests.statistics.intervals import SHARES, at_most
from loadtests.statistics.recorder import Cell

if TYPE_CHECKING:
    from collections.abc import Iterable

    from conformance.contract.thresholds import Threshold
    from loadtests.schedule.plan import Plan

MOST_CPU = 0.95
MOST_LAG_MEDIAN_MS = 1.0
MOST_LAG_P95_MS = 20.0
MOST_LAG_P99_MS = 100.0
_SMALL_CHANCE = 0.025
NOTED_LAG_P99_MS = 1.0
LEAST_ACHIEVED = 0.95
MOST_ERRORS = 0.01


def generator_figures(measured: Measured, asked: int, elapsed_s: float, cpu_share: float | None) -> dict[str, Any]:
    """The `generator` object: what the load generator did, over all measured phases.

    `asked` arrivals should have started so far, in `elapsed_s` without the warm-up; the busiest worker has `cpu_share`.
    """
    plan, recorder = measured.plan, measured.recorder
    lag, wire = Histogram(), "wire" in plan.clients
    total = Cell()
    for name in measured.plan.series_names():
        for phase in ("duel", "aa", "against"):
            cell = measured.total(phase, name)
            total.merge(cell)
            if name[2] == "wire" or not wire:
                lag.merge(measured.spans(phase, name).lag)
    completed = total.service.total
    started = completed + total.errors
    return {
        "cpu_share": rounded(cpu_share),
        "lag_ms": plain_quantiles(lag),
        "asked_rate": rounded(asked / elapsed_s) if plan.open_model and elapsed_s > 0 else None,
        "achieved_rate": rounded(started / elapsed_s) if elapsed_s > 0 else None,
        "scheduled": asked if plan.open_model else started,
        "started": started,
        "completed": completed,
        "late": total.late,
        "dropped": total.dropped,
        "errors": total.errors,
        "error_share": rounded(total.errors / started) if started else 0.0,
        "connects": recorder.counters.get("connects", 0),
        "resends": recorder.counters.get("resends", 0),
    }


def invalid_because(figures: dict[str, Any], plan: Plan, pacing: str) -> tuple[list[str], list[str]]:
    """Reasons why the figures say nothing about the robot; and notes on what is merely worth knowing."""
    reasons, notes = [], []
    if not figures["completed"]:
        reasons.append("no request succeeded: nothing was measured")
    cpu = figures["cpu_share"]
    if cpu is not None and cpu > MOST_CPU:
        reasons.append(
            f"the generator was busy {cpu:.0%} of the time, so that it measured itself: "
            "use more --processes or a lower rate"
        )
    lag = figures["lag_ms"]
    if plan.open_model and lag["p50"] is not None:
        limits = {"p50": MOST_LAG_MEDIAN_MS, "p95": MOST_LAG_P95_MS, "p99": MOST_LAG_P99_MS}
        if any((lag[name] or 0.0) > limit for name, limit in limits.items()):
            told = " and ".join(f"{lag[name]:.3f} ms ({name})" for name in limits if lag[name] is not None)
            reasons.append(f"requests started {told} after their time: the generator's machine is overloaded")
        elif (lag["p99"] or 0.0) > NOTED_LAG_P99_MS:
            notes.append(f"1 % of the requests started {lag['p99']:.3f} ms or more after their time ({pacing})")
    if plan.open_model and figures["scheduled"]:
        share = figures["started"] / figures["scheduled"]
        if share < LEAST_ACHIEVED:
            reasons.append(
                f"only {figures['started']} of {figures['scheduled']} scheduled requests were started "
                f"and accounted for ({share:.0%})"
            )
    if figures["error_share"] > MOST_ERRORS:
        reasons.append(f"{figures['errors']} of {figures['started']} requests failed ({figures['error_share']:.1%})")
    if figures["resends"]:
        reasons.append(f"{figures['resends']} requests were silently sent again by a client library")
    return reasons, notes


def _surely_above(histogram: Histogram, threshold: Threshold) -> bool:
    """Whether even few samples prove a quantile to lie above its threshold.

    They do when, were it below, so few samples under the threshold would turn up in less than 2.5 % of all runs.
    """
    bins, counts = histogram.arrays()
    below = int(counts[edges_us(bins)[0] < threshold.below_ms * 1e3].sum())
    return histogram.total > 0 and at_most(below, histogram.total, SHARES[threshold.quantile]) < _SMALL_CHANCE


def judge(measured: Measured, thresholds: Iterable[Threshold]) -> list[dict[str, Any]]:
    """The `thresholds` of latency.json: each against the upper bound of its interval."""
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
        whole = getattr(measured.total("duel", name), threshold.time)
        entry["measured_ms"] = quantiles(whole)[0][threshold.quantile]
        if threshold.quantile == "max":
            bound, reason = entry["measured_ms"], None if whole.total else "no samples"
        else:
            interval, reason = measured.interval(name, threshold.time, threshold.quantile)
            bound = interval[1] if interval else None
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
