"""Where a robot breaks down: a load that is stepped up until the robot no longer meets the criterion."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Self

import msgspec

from conformance.papers_robot.thresholds import Threshold
from conformance.statement.load import ServiceLevel
from loadtests.schedule.arrivals import arrivals_due
from loadtests.schedule.plan import Plan
from loadtests.statistics.figures import rounded
from loadtests.statistics.histogram import Histogram
from loadtests.statistics.measured import Measured, counted
from loadtests.statistics.recorder import Recorder

_MOST_P99_MS = 50.0
_MOST_ERRORS = 0.01
_LEAST_ACHIEVED = 0.95
#: From this share of a core on, the generator may be what limits the rate.
BUSY = 0.9


@dataclass(frozen=True)
class Criterion:
    """What a step has to meet.

    Attributes:
        limits: (time, quantile, below ms) for each interface.
        usual: the same for an interface without limits of its own.
    """

    limits: dict[str, list[tuple[str, str, float]]]
    usual: tuple[tuple[str, str, float], ...] = (("response", "p99", _MOST_P99_MS),)

    @classmethod
    def of(cls, thresholds: Iterable[Threshold], operation: str, level: ServiceLevel | None = None) -> Self:
        """Return the criterion by the thresholds on an operation's wire series, or by its service level."""
        limits: dict[str, list[tuple[str, str, float]]] = {}
        for threshold in thresholds:
            if threshold.operation == operation and threshold.client == "wire":
                kept = limits.setdefault(threshold.interface, [])
                kept.append((threshold.time, threshold.quantile, threshold.below_ms))
        most = level.limits.items() if level else ()
        usual = tuple(("response", name.removesuffix("_ms"), ms) for name, ms in most if name.endswith("_ms"))
        return cls(limits, usual or cls.usual)

    def of_interface(self, interface: str) -> list[tuple[str, str, float]]:
        """Return the limits for an interface, or the usual ones if no threshold is on that interface."""
        return self.limits.get(interface) or list(self.usual)

    def words(self, interface: str) -> str:
        """Return the criterion as a sentence."""
        limits = ", ".join(
            f"{quantile} {time} time below {below:g} ms" for time, quantile, below in self.of_interface(interface)
        )
        return (
            f"{limits}, errors at most {_MOST_ERRORS:.0%}, {_LEAST_ACHIEVED:.0%} of the offered rate answered in time"
        )


class Step(msgspec.Struct, kw_only=True):
    """One rate over one interface: an entry of `steps` in latency.json.

    Attributes:
        reason: why the step does not meet the criterion.
        cpu_share: the busiest generator process's share of a core.
    """

    interface: str
    client: str = "wire"
    offered_rate: float
    achieved_rate: float
    count: int
    errors: int
    dropped: int
    p50_ms: float | None
    p99_ms: float | None
    max_ms: float | None
    meets: bool
    reason: str | None
    cpu_share: float | None = None

    @property
    def limited_by_generator(self) -> bool:
        """Return whether the generator was too busy for the step to say anything about the robot."""
        return (self.cpu_share or 0.0) > BUSY


def step_result(plan: Plan, recorder: Recorder, interface: str, operation: str, criterion: Criterion) -> Step:
    """Return one interface's step of a plan that was carried out."""
    measured, name = Measured([plan], recorder), (operation, interface, "wire")
    asked = arrivals_due(plan, plan.length_s, phase="step", interface=interface)
    seconds = sum(segment.active_s for segment in plan.segments if segment.interface == interface)
    whole, last = measured.total(name, "step"), Histogram()
    for block in measured.blocks(name, "step"):
        last = block.cell.response
    achieved = _answered_in_time(whole.service.total, last, seconds)
    reasons = []
    if achieved < _LEAST_ACHIEVED * asked / seconds:
        reasons.append(f"{achieved:.0f}/s answered of {asked / seconds:.0f}/s")
    started = whole.service.total + whole.errors
    if started and whole.errors / started > _MOST_ERRORS:
        reasons.append(f"{whole.errors} of {started} requests failed")
    for time, quantile, below in criterion.of_interface(interface):
        value = counted(whole, time).figure_ms(quantile)
        if value is not None and value >= below:
            reasons.append(f"{quantile} {time} time {value:.3f} ms is not below {below:g} ms")
    response = counted(whole, "response")
    return Step(
        interface=interface,
        offered_rate=round(plan.step_rate or 0.0, 6),
        achieved_rate=round(achieved, 6),
        count=whole.service.total,
        errors=whole.errors,
        dropped=whole.dropped,
        p50_ms=rounded(response.figure_ms("p50")),
        p99_ms=rounded(response.figure_ms("p99")),
        max_ms=rounded(response.figure_ms("max")),
        meets=not reasons,
        reason="; ".join(reasons) or None,
    )


def _answered_in_time(answered: int, last: Histogram, seconds: float) -> float:
    """Return the requests answered per second, from the step's beginning to its last responses.

    An overloaded robot answers the last arrivals late, by the length of its queue: all responses together took the
    step's length plus that delay. The median of the last half second is taken as the delay, so that one outlier does
    not count.
    """
    delay = (last.quantile_ms(0.5) or 0.0) / 1e3
    length = seconds if delay < seconds * (1 - _LEAST_ACHIEVED) else seconds + delay
    return answered / length if length > 0 else 0.0


def knee(results: Iterable[Step], interfaces: tuple[str, ...], criterion: Criterion) -> list[dict[str, Any]]:
    """Return the highest rate up to which every step met the criterion, for each interface."""
    found = []
    for interface in interfaces:
        steps = sorted((step for step in results if step.interface == interface), key=lambda step: step.offered_rate)
        missed = next((step for step in steps if not step.meets), None)
        met = steps if missed is None else steps[: steps.index(missed)]
        found.append(
            {
                "interface": interface,
                "highest_rate": met[-1].offered_rate if met else None,
                "first_rate_missed": missed.offered_rate if missed else None,
                "criterion": criterion.words(interface),
                "reason": missed.reason if missed else None,
                "limited_by": None if missed is None else ("generator" if missed.limited_by_generator else "robot"),
            }
        )
    return found
