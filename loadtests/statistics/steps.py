"""Where it breaks: a load stepped up until the robot no longer keeps to the criterion."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Self

from conformance.packs.table1.thresholds import Threshold
from loadtests.schedule.plan import Plan
from loadtests.statistics.figures import rounded
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.measured import counted
from loadtests.statistics.recorder import Cell, Recorder
from loadtests.statistics.rounds import SHARES

_MOST_P99_MS = 50.0
_MOST_ERRORS = 0.01
_LEAST_ACHIEVED = 0.95
_BUSY = 0.9


@dataclass(frozen=True)
class Criterion:
    """What a step has to keep to.

    Attributes:
        limits: (time, quantile, below ms) for each interface.
    """

    limits: dict[str, list[tuple[str, str, float]]]

    @classmethod
    def of(cls, thresholds: Iterable[Threshold], operation: str) -> Self:
        """The thresholds on an operation's wire series, or a default where there are none."""
        limits: dict[str, list[tuple[str, str, float]]] = {}
        for threshold in thresholds:
            if threshold.operation == operation and threshold.client == "wire":
                kept = limits.setdefault(threshold.interface, [])
                kept.append((threshold.time, threshold.quantile, threshold.below_ms))
        return cls(limits)

    def of_interface(self, interface: str) -> list[tuple[str, str, float]]:
        """The limits of an interface."""
        return self.limits.get(interface) or [("response", "p99", _MOST_P99_MS)]

    def words(self, interface: str) -> str:
        """The criterion in a sentence."""
        limits = ", ".join(
            f"{quantile} {time} time below {below:g} ms" for time, quantile, below in self.of_interface(interface)
        )
        return (
            f"{limits}, errors at most {_MOST_ERRORS:.0%}, {_LEAST_ACHIEVED:.0%} of the offered rate answered in time"
        )


def figure(histogram: Histogram, name: str) -> float | None:
    """Mean, quantile or maximum in ms, whatever the number of samples."""
    if name == "mean":
        return histogram.mean_ms()
    if name == "max":
        return histogram.highest_ns / 1e6 if histogram.total else None
    return histogram.quantile_ms(SHARES[name])


def step_result(plan: Plan, recorder: Recorder, interface: str, asked: int, criterion: Criterion) -> dict[str, Any]:
    """One interface's step of a plan, in which it should have had `asked` arrivals."""
    whole, last, seconds = Cell(), Histogram(), 0.0
    for index, segment in enumerate(plan.segments):
        if segment.interface != interface:
            continue
        seconds += segment.active_s
        for number in range(len(plan.operations)):
            cell = recorder.cells.get((plan.first_segment + index, number))
            if cell is not None:
                whole.merge(cell)
                last = cell.response
    achieved = _answered_in_time(whole.service.total, last, seconds)
    reasons = []
    if achieved < _LEAST_ACHIEVED * asked / seconds:
        reasons.append(f"{achieved:.0f}/s answered of {asked / seconds:.0f}/s")
    started = whole.service.total + whole.errors
    if started and whole.errors / started > _MOST_ERRORS:
        reasons.append(f"{whole.errors} of {started} requests failed")
    for time, quantile, below in criterion.of_interface(interface):
        value = figure(counted(whole, time, getattr(whole, time).highest_ns), quantile)
        if value is not None and value >= below:
            reasons.append(f"{quantile} {time} time {value:.3f} ms is not below {below:g} ms")
    response = counted(whole, "response", whole.response.highest_ns)
    return {
        "interface": interface,
        "client": "wire",
        "offered_rate": rounded(plan.step_rate),
        "achieved_rate": rounded(achieved),
        "count": whole.service.total,
        "errors": whole.errors,
        "dropped": whole.dropped,
        "p50_ms": rounded(figure(response, "p50")),
        "p99_ms": rounded(figure(response, "p99")),
        "max_ms": rounded(figure(response, "max")),
        "meets": not reasons,
        "reason": "; ".join(reasons) or None,
    }


def _answered_in_time(answered: int, last: Histogram, seconds: float) -> float:
    """Requests answered per second, from the step's beginning to its last answers.

    A robot that cannot follow answers the last arrivals late, by as much as its queue is long: the time that all
    answers took together is the step's length and that delay. The median of the last half second stands for it,
    so that a single hiccup does not.
    """
    delay = (last.quantile_ms(0.5) or 0.0) / 1e3
    length = seconds if delay < seconds * (1 - _LEAST_ACHIEVED) else seconds + delay
    return answered / length if length > 0 else 0.0


def knee(results: list[dict[str, Any]], interfaces: tuple[str, ...], criterion: Criterion) -> list[dict[str, Any]]:
    """The highest rate up to which every step met the criterion, for each interface."""
    found = []
    for interface in interfaces:
        steps = sorted(
            (step for step in results if step["interface"] == interface), key=lambda step: step["offered_rate"]
        )
        highest, missed = None, None
        for step in steps:
            if not step["meets"]:
                missed = step
                break
            highest = step["offered_rate"]
        busy = missed is not None and (missed["cpu_share"] or 0.0) > _BUSY
        found.append(
            {
                "interface": interface,
                "highest_rate": highest,
                "first_rate_missed": missed["offered_rate"] if missed else None,
                "criterion": criterion.words(interface),
                "reason": missed["reason"] if missed else None,
                "limited_by": None if missed is None else ("generator" if busy else "robot"),
            }
        )
    return found
