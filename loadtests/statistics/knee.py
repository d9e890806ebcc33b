"""The rate at which a robot breaks down, found by repeated bisection: the `knee_search` of latency.json.

A search brackets the knee between a rate that met the criterion and one that missed it. Chance may fail a step: so a
step that missed is tried again, a bracket ends only where a second, higher rate missed too, and there are several
searches. Of n searches' estimates the lowest and the highest enclose the median with probability 1 - 2^(1 - n) (the
sign test's interval); the brackets' own ends make it no narrower.

A step of the search is one rate for a few seconds, and whether the robot met the criterion.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import msgspec

from conformance.statement.load import ServiceLevel
from loadtests.schedule.arrivals import arrivals_due
from loadtests.schedule.plan import Plan
from loadtests.statistics.figures import rounded, rounded_interval
from loadtests.statistics.histogram import SHARES
from loadtests.statistics.intervals import samples_for_interval
from loadtests.statistics.measured import Measured, counted_times
from loadtests.statistics.recorder import Recorder

_MOST_P99_MS = 50.0
_MOST_ERRORS = 0.01
_LEAST_ACHIEVED = 0.95
#: From this share of a core on, the generator may limit the rate.
BUSY = 0.9
RESOLUTION = 1.08  # a bracket whose ends differ by no more is narrow enough
_GROWTH = 2.0
_NEAR = 1.5  # the next search begins this far from an earlier one's bracket
#: A rate counts as too high only if a second rate, higher by at most this factor, misses the target too.
_CONFIRMED = 1.25
_MISSES, _MOST_TRIALS = 2, 5  # of one rate: misses in which the generator was on time; trials in all


@dataclass(frozen=True)
class Criterion:
    """The limits that a step must meet.

    Attributes:
        limits: values in ms that quantiles of the response time have to be below, by quantile.
    """

    limits: dict[str, float]

    @classmethod
    def of(cls, level: ServiceLevel | None) -> Self:
        """Return the criterion by an operation's service level, or the usual one."""
        most = level.limits.items() if level else ()
        return cls({name.removesuffix("_ms"): ms for name, ms in most if name.endswith("_ms")} or {"p99": _MOST_P99_MS})

    @property
    def needed_requests(self) -> int:
        """Return how many requests a step must have, so that its quantiles are known at all."""
        return max(samples_for_interval(SHARES[quantile]) for quantile in self.limits)

    def words(self) -> str:
        """Return the criterion as a sentence."""
        limits = ", ".join(f"{quantile} response time below {below:g} ms" for quantile, below in self.limits.items())
        return (
            f"{limits}, errors at most {_MOST_ERRORS:.0%}, {_LEAST_ACHIEVED:.0%} of the offered rate answered in time"
        )


class Step(msgspec.Struct, kw_only=True):
    """One rate over one interface: a point of the `curve` of a search for the knee in latency.json.

    Attributes:
        reason: why the step does not meet the criterion.
        achieved_rate: good responses in a second of the step, from its first responses on.
        cpu_share: the busiest generator process's share of a core.
        lag_p99_ms: how late the generator itself was in this step.
    """

    interface: str
    client: str = "wire"
    offered_rate: float
    achieved_rate: float
    count: int
    errors: int
    dropped: int
    p50_ms: float | None
    p95_ms: float | None
    p99_ms: float | None
    max_ms: float | None
    meets: bool
    reason: str | None
    cpu_share: float | None = None
    lag_p99_ms: float | None = None

    @property
    def requests(self) -> int:
        """Return how many requests were due in the step."""
        return self.count + self.errors + self.dropped

    @property
    def limited_by_generator(self) -> bool:
        """Return whether the generator was too busy or too late for the step to judge the robot."""
        return (self.cpu_share or 0.0) > BUSY or 2 * (self.lag_p99_ms or 0.0) > (self.p99_ms or math.inf)


def step_result(plan: Plan, recorder: Recorder, interface: str, operation: str, criterion: Criterion) -> Step:
    """Return the result of a plan of one interface that was carried out."""
    measured, name = Measured([plan], recorder), (operation, interface, "wire")
    asked = arrivals_due(plan, plan.length_s, phase="step")
    blocks = list(measured.blocks(name, "step"))
    whole = measured.total(name, "step")
    # Before its first responses, even a robot that keeps up has answered nothing. A median is late if it falls behind.
    early_s, usual_s = ((blocks[0].cell.response.quantile_ms(at) or 0.0) / 1e3 if blocks else 0.0 for at in (0.1, 0.5))
    first_s = max(early_s, min(usual_s, plan.length_s / 10))
    seconds, offered = max(plan.length_s - first_s, plan.length_s / 10), asked / plan.length_s
    achieved = min(recorder.in_time[plan.first_segment] / seconds, offered)
    reasons = []
    if achieved < _LEAST_ACHIEVED * offered:
        reasons.append(f"{achieved:.0f}/s answered of {offered:.0f}/s")
    started = whole.service.total + whole.errors
    if started and whole.errors / started > _MOST_ERRORS:
        reasons.append(f"{whole.errors} of {started} requests failed")
    response, lag = counted_times(whole, "response"), measured.spans("step", name).lag
    for quantile, below in criterion.limits.items():
        value = response.figure_ms(quantile)
        if value is not None and value >= below:
            reasons.append(f"{quantile} response time {value:.3f} ms is not below {below:g} ms")
    return Step(
        interface=interface,
        offered_rate=round(plan.step_rate or 0.0, 6),
        achieved_rate=round(achieved, 6),
        count=whole.service.total,
        errors=whole.errors,
        dropped=whole.dropped,
        meets=not reasons,
        reason="; ".join(reasons) or None,
        lag_p99_ms=rounded(lag.figure_ms("p99")),
        p50_ms=rounded(response.figure_ms("p50")),
        p95_ms=rounded(response.figure_ms("p95")),
        p99_ms=rounded(response.figure_ms("p99")),
        max_ms=rounded(response.figure_ms("max")),
    )


@dataclass
class Search:
    """One search for the highest rate that meets the criterion.

    Attributes:
        lowest, highest: limits on the rate.
        near: the bracket of an earlier search.
        results: for each rate the trial that counts.
        tried: all trials.
    """

    lowest: float
    highest: float
    near: tuple[float, float] | None = None
    results: dict[float, Step] = field(default_factory=dict)
    tried: list[Step] = field(default_factory=list)

    @property
    def floor(self) -> float | None:
        """Return the highest rate that has met the criterion so far: misses below it were chance."""
        return max((rate for rate, trial in self.results.items() if trial.meets), default=None)

    @property
    def ceiling(self) -> float | None:
        """Return the lowest rate above it that has missed the criterion."""
        return min(self._rates_missed(), default=None)

    def _rates_missed(self) -> list[float]:
        return [rate for rate, trial in self.results.items() if not trial.meets and rate > (self.floor or 0.0)]

    def next_rate(self) -> float | None:
        """Return the rate to try next; None when the bracket is narrow enough, or a limit is reached."""
        kept, missed = self.floor, self.ceiling
        if kept is None and missed is None:
            return self._within(self.near[0] / _NEAR if self.near else self.lowest)
        if missed is None:
            kept = kept or self.lowest
            return None if kept >= self.highest else self._within(kept * (_NEAR if self.near else _GROWTH))
        if kept is None:
            return None if missed <= self.lowest else self._within(missed / _GROWTH)
        if missed / kept > RESOLUTION:
            return math.sqrt(kept * missed)
        above = self._within(missed * _CONFIRMED)
        confirmed = any(missed < rate <= above for rate in self._rates_missed())
        return None if confirmed or above <= missed else above

    def learn(self, rate: float, *trials: Step) -> None:
        """Add the trials of a rate, of which the last counts."""
        self.results[rate] = trials[-1]
        self.tried += trials

    def estimate(self) -> float | None:
        """Return the knee, between the ends of the bracket; None where an end was not found."""
        return None if self.floor is None or self.ceiling is None else math.sqrt(self.floor * self.ceiling)

    def _within(self, rate: float) -> float:
        return min(max(rate, self.lowest), self.highest)


def knee_search(interface: str, criterion: Criterion, searches: list[Search]) -> dict[str, Any]:
    """Return the combined result of all searches for the knee of one interface.

    With too few requests in a step that kept the criterion, there is no confidence: that nothing was slow is chance.
    """
    found = [(search, estimate) for search in searches if (estimate := search.estimate()) is not None]
    estimates = [estimate for _, estimate in found]
    trials = [trial for search in searches for trial in search.tried]
    missed = [search.results[search.ceiling] for search, _ in found if search.ceiling is not None]
    busy = sum(trial.limited_by_generator for trial in missed)
    kept = [search.floor for search in searches if search.floor is not None]
    failing = [trial.offered_rate for trial in trials if trial.errors or trial.dropped]
    requests = min((search.results[floor].requests for search, _ in found if (floor := search.floor)), default=None)
    enough = requests is not None and requests >= criterion.needed_requests
    lowest = min((search.floor or 0.0 for search, _ in found), default=0.0)
    highest = max((search.ceiling or 0.0 for search, _ in found), default=0.0)
    return {
        "interface": interface,
        "criterion": criterion.words(),
        "searches": len(searches),
        "rate": rounded(math.exp(sum(map(math.log, estimates)) / len(estimates))) if estimates else None,
        "interval": rounded_interval((lowest, highest)) if estimates else None,
        "step_requests": requests,
        "needed_requests": criterion.needed_requests,
        "confidence": rounded(1 - 2.0 ** (1 - len(estimates))) if estimates and enough else None,
        "brackets": [[rounded(search.floor), rounded(search.ceiling)] for search in searches],
        "held_up_to": rounded(max(kept, default=None)) if not estimates and kept else None,
        "errors_from": rounded(min(failing, default=None)),
        "reason": missed[0].reason if missed else None,
        "limited_by": None if not missed else ("generator" if 2 * busy > len(missed) else "robot"),
        "trials": len(trials),
        "curve": sorted(trials, key=lambda trial: trial.offered_rate),
    }


def _is_decided(trials: Sequence[Step]) -> bool:
    """Return whether a rate is known to be kept or missed: a miss counts where the generator was not the limit."""
    if not trials:
        return False
    misses = sum(not trial.limited_by_generator for trial in trials)
    return trials[-1].meets or misses >= _MISSES or len(trials) >= _MOST_TRIALS


def search_again(
    searches: int, limits: tuple[float, float], attempt: Callable[[float, int], Step | None]
) -> list[Search]:
    """Search several times within the limits; `attempt` tries a rate in a search, and returns None when time is up."""
    found: list[Search] = []
    near: tuple[float, float] | None = None
    for number in range(1, searches + 1):
        search = Search(*limits, near=near)
        while (rate := search.next_rate()) is not None:
            trials: list[Step] = []
            while not _is_decided(trials):
                trial = attempt(rate, number)
                if trial is None:
                    return found
                trials.append(trial)
            search.learn(rate, *trials)
        found.append(search)
        if search.floor is not None and search.ceiling is not None:
            near = (search.floor, search.ceiling)
    return found
