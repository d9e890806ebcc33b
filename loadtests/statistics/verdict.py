"""Whether a run is worth anything: gates on the generator, and on what the duel can say."""

from collections.abc import Sequence
from typing import Any

from loadtests.schedule.plan import Plan
from loadtests.statistics.figures import plain_quantiles, rounded
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.measured import Measured
from loadtests.statistics.recorder import Cell

MOST_CPU = 0.95
#: Arrivals that wait for a free connection wait for the generator where it is as busy as this in their block.
BUSY_CPU = 0.9
#: Of the median and of the p99 of the service time: how late requests may start.
MOST_LAG = {"p50": 0.10, "p99": 0.20}
#: A lag that no clock of this kind goes below is none: the wake-up of a process.
LEAST_LAG_MS = {"p50": 0.05, "p99": 0.3}
LEAST_ACHIEVED = 0.95
MOST_ERRORS = 0.01


def generator_figures(measured: Measured, asked: int, active_s: float, cpu_share: float | None) -> dict[str, Any]:
    """The `generator` object: what the load generator did, over all measured phases.

    `asked` arrivals should have started so far, in blocks that were open for `active_s` together; the busiest worker
    has `cpu_share`.
    """
    plan, recorder = measured.plan, measured.recorder
    lag, service = Histogram(), Histogram()
    total, queued = Cell(), 0
    for name in measured.plan.series_names():
        for phase in ("duel", "aa", "against"):
            cell = measured.total(phase, name)
            total.merge(cell)
            if name[2] == plan.clients[0]:
                service.merge(cell.service)
                lag.merge(measured.spans(phase, name).lag)
                waited = _waited_for_generator(measured, phase, name)
                queued += waited.total
                lag.merge(waited)
    completed = total.service.total
    started = completed + total.errors
    return {
        "cpu_share": rounded(cpu_share),
        "lag_ms": plain_quantiles(lag),
        "lag_limits_ms": _lag_limits(service),
        "queued_by_generator": queued,
        "real_time": recorder.counters.get("real time", 0) > 0,
        "asked_rate": rounded(asked / active_s) if plan.open_model and active_s > 0 else None,
        "achieved_rate": rounded(started / active_s) if active_s > 0 else None,
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


def _waited_for_generator(measured: Measured, phase: str, name: tuple[str, str, str]) -> Histogram:
    """How late arrivals were for which no user was free while the generator's processor was taken up."""
    found = Histogram()
    for plan in measured.plans:
        number = plan.operations.index(name[0])
        for index, segment in enumerate(plan.segments):
            if (segment.phase, segment.interface, segment.client) != (phase, *name[1:]):
                continue
            key = plan.first_segment + index
            cell = measured.recorder.cells.get((key, number))
            if cell is not None and measured.recorder.busy.get(key, 0.0) >= BUSY_CPU:
                found.merge(cell.queued)
    return found


def _lag_limits(service: Histogram) -> dict[str, float | None]:
    """What the lag may come to, measured by the service time."""
    times = plain_quantiles(service)
    return {
        name: None if (time := times[name]) is None else rounded(max(share * time, LEAST_LAG_MS[name]))
        for name, share in MOST_LAG.items()
    }


def invalid_because(
    figures: dict[str, Any], plan: Plan, pacing: str, spoilt: Sequence[str]
) -> tuple[list[str], list[str]]:
    """Reasons why the figures say nothing about the robot; and notes on what is merely worth knowing.

    `spoilt` are remarks on the generator's machine: what may have made it late.
    """
    reasons: list[str] = []
    notes: list[str] = []
    if not figures["completed"]:
        reasons.append("no request succeeded: nothing was measured")
    cpu = figures["cpu_share"]
    if cpu is not None and cpu > MOST_CPU:
        reasons.append(
            f"the generator was busy {cpu:.0%} of the time, so that it measured itself: "
            "use more --processes or a lower rate"
        )
    if plan.open_model:
        # Two robots are compared by their service times, which begin at the actual start: lag meets both alike.
        (notes if plan.robots > 1 else reasons).extend(_late(figures, pacing, spoilt))
        if figures["scheduled"] and figures["started"] + figures["dropped"] < LEAST_ACHIEVED * figures["scheduled"]:
            share = (figures["started"] + figures["dropped"]) / figures["scheduled"]
            reasons.append(
                f"only {figures['started'] + figures['dropped']} of {figures['scheduled']} scheduled requests were "
                f"accounted for ({share:.0%})"
            )
    if figures["queued_by_generator"]:
        notes.append(
            f"{figures['queued_by_generator']} requests waited for a free connection while the generator was busy: "
            "their wait counts as its lag"
        )
    if figures["resends"]:
        reasons.append(f"{figures['resends']} requests were silently sent again by a client library")
    return reasons, notes


def _late(figures: dict[str, Any], pacing: str, spoilt: Sequence[str]) -> list[str]:
    lag, limits = figures["lag_ms"], figures["lag_limits_ms"]
    missed = [name for name, limit in limits.items() if limit is not None and (lag[name] or 0.0) > limit]
    if not missed:
        return []
    told = " and ".join(f"{lag[name]:.3f} ms ({name}, at most {limits[name]:.3f} ms)" for name in missed)
    causes = list(spoilt) or ["the generator's machine is overloaded"]
    help_ = "" if figures["real_time"] else "; CAP_SYS_NICE would let the generator go before what else runs there"
    return [f"requests started {told} after their time ({pacing}): {'; '.join(causes)}{help_}"]


def failures(figures: dict[str, Any]) -> list[str]:
    """Why the robot's failures leave nothing to compare; thresholds are judged all the same."""
    found = []
    if figures["error_share"] > MOST_ERRORS:
        found.append(f"{figures['errors']} of {figures['started']} requests failed ({figures['error_share']:.1%})")
    if figures["dropped"] > MOST_ERRORS * max(1, figures["scheduled"]):
        found.append(
            f"{figures['dropped']} of {figures['scheduled']} requests never started: no connection was free in time"
        )
    return found


def says_nothing(comparisons: Sequence[dict[str, Any]]) -> list[str]:
    """Why a duel carries no statement at all; empty where it carries one, or where there was no duel."""
    medians = [entry for entry in comparisons if entry["quantile"] == "p50"]
    if not medians or any(entry["judgement"] != "none" for entry in medians):
        return []
    reasons = dict.fromkeys(str(entry["judgement_reason"]) for entry in medians)
    return [f"the duel tells nothing of SOAP and REST: {'; '.join(reasons)}"]
