"""Judge whether a run is valid, and whether its comparison can show a difference."""

from collections.abc import Sequence

import msgspec

from loadtests.schedule.plan import Plan
from loadtests.statistics.comparisons import SoapOverRest
from loadtests.statistics.counts import Counts
from loadtests.statistics.figures import Figures, plain_quantiles, rounded
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.measured import Measured

MOST_CPU = 0.95
#: How late requests may start, as a share of the median and of the p99 of the service time.
MOST_LAG = {"p50": 0.10, "p99": 0.20}
#: LEAST_LAG_MS: a process needs this long to wake up, so a shorter lag does not count. LEAST_ACHIEVED: share of the
#: rate.
LEAST_LAG_MS = {"p50": 0.05, "p99": 0.3}
LEAST_ACHIEVED = 0.95
MOST_ERRORS = 0.01


class GeneratorFigures(msgspec.Struct, kw_only=True):
    """Figures on the load generator: the `generator` of latency.json, whose JSON Schema describes each field."""

    cpu_share: float | None
    lag_ms: Figures
    lag_limits_ms: Figures
    real_time: bool
    late: int
    connects: int
    resends: int


def generator_figures(measured: Measured, cpu_share: float | None) -> GeneratorFigures:
    """Return figures on the load generator, over all measured phases.

    Args:
        measured: the records.
        cpu_share: the busiest worker's share of a core.
    """
    plan, counters = measured.plan, measured.recorder.counters
    lag, service, late = Histogram(), Histogram(), 0
    for name in plan.series_names():
        for phase in ("duel", "aa", "against"):
            if phase == "aa" and plan.alone:
                continue  # those of the duel are both
            cell = measured.total(name, phase)
            late += cell.late
            if name[2] == plan.clients[0]:
                service.merge(cell.service)
                lag.merge(measured.spans(phase, name).lag)
    return GeneratorFigures(
        cpu_share=rounded(cpu_share),
        lag_ms=plain_quantiles(lag),
        lag_limits_ms=_lag_limits(service),
        real_time=counters.get("real time", 0) > 0,
        late=late,
        connects=counters.get("connects", 0),
        resends=counters.get("resends", 0),
    )


def _lag_limits(service: Histogram) -> Figures:
    """Return how large the lag may be beside the service time."""
    times = plain_quantiles(service)
    return {
        name: None if (time := times[name]) is None else rounded(max(share * time, LEAST_LAG_MS[name]))
        for name, share in MOST_LAG.items()
    }


def invalid_because(
    figures: GeneratorFigures, counts: Counts, plan: Plan, pacing: str, spoilt: Sequence[str]
) -> tuple[list[str], list[str]]:
    """Return the reasons why the figures do not describe the robot, and notes.

    Args:
        figures: on the load generator.
        counts: of the requests.
        plan: the plan that the generator had to carry out.
        pacing: the clock that started the requests.
        spoilt: remarks on the generator's machine, which may have made requests late.
    """
    reasons: list[str] = []
    notes: list[str] = []
    if not counts.answered:
        reasons.append("no request succeeded: nothing was measured")
    if figures.cpu_share is not None and figures.cpu_share > MOST_CPU:
        reasons.append(
            f"the generator was busy {figures.cpu_share:.0%} of the time, so that it measured itself: "
            "use more --processes or a lower rate"
        )
    if plan.open_model:
        # Two robots are compared by their service times, which begin at the actual start: lag affects both alike.
        (notes if plan.robots > 1 else reasons).extend(_late(figures, pacing, spoilt))
        if counts.lost > (1 - LEAST_ACHIEVED) * counts.asked:
            reasons.append(f"{counts.lost} of {counts.asked} requests were neither sent nor given up")
    if figures.resends:
        reasons.append(f"a client library silently retried {figures.resends} requests")
    return reasons, notes


def _late(figures: GeneratorFigures, pacing: str, spoilt: Sequence[str]) -> list[str]:
    late = [
        f"{lag:.3f} ms ({name}, at most {limit:.3f} ms)"
        for name, limit in figures.lag_limits_ms.items()
        if limit is not None and (lag := figures.lag_ms[name] or 0.0) > limit
    ]
    if not late:
        return []
    causes = "; ".join(spoilt) or "the generator's machine is overloaded"
    hint = "" if figures.real_time else "; with CAP_SYS_NICE the generator would run before other processes"
    return [f"requests started {' and '.join(late)} after their time ({pacing}): {causes}{hint}"]


def failures(counts: Counts) -> list[str]:
    """Return why the robot's failures leave nothing to compare; service levels are judged all the same."""
    found, failed = [], sum(counts.failed.values())
    if failed > MOST_ERRORS * counts.sent:
        found.append(f"{failed} of {counts.sent} requests failed ({failed / counts.sent:.1%})")
    if counts.not_sent > MOST_ERRORS * max(1, counts.asked):
        found.append(f"{counts.not_sent} of {counts.asked} requests never started: no connection was free in time")
    return found


def says_nothing(comparisons: Sequence[SoapOverRest]) -> list[str]:
    """Return the reasons why no comparison supports a claim; empty if one does, or if there was no comparison."""
    medians = [entry for entry in comparisons if entry.quantile == "p50"]
    if not medians or any(entry.judgement != "none" for entry in medians):
        return []
    reasons = dict.fromkeys(str(entry.judgement_reason) for entry in medians)
    return [f"SOAP and REST cannot be compared: {'; '.join(reasons)}"]
